"""The time integral of a vector by trapezoids."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .flags import NEVER, Flag
from .initial_value import InitialParameters
from .vector import Vector


class Trapezoids(Signal):
    """What the trapezoidal integrator remembers."""

    integral = Field("n", text="the integral so far")
    rate = Field("n", text="the input before")
    started = Field((), dtype="bool", text="whether there was an input since the start or a reset")


class TrapezoidalIntegrator(Block):
    """The time integral by trapezoids: y[n] = y[n-1] + T (u[n-1] + u[n]) / 2, y[0] = initial.

    T is the block's period. Where ``reset`` holds it starts anew: y = initial. The output follows
    from the input of the same tick, so it breaks no loop; ``Integrator`` does.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="the rate")
    reset = Input(Flag, text="whether to start anew from the initial value", default=NEVER)
    y = Output(Vector, text="its integral")
    x = State(Trapezoids, text="the integral and the rate before")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The unit of the rate times a second."""
        u = given["u"]
        return {"y": u and u.times(SECOND)}

    def setup(self) -> None:
        """Keep the initial value and half of the period at hand."""
        self._initial = self.params.start_value()
        self._sum = np.zeros(self.params.n)
        self._half = np.array(0.5 * self.period)

    def step(self) -> None:
        """Add one trapezoid."""
        x = self.x
        if self.reset.value or not x.started:
            np.copyto(x.integral, self._initial)
            x.started[...] = True
        else:
            np.add(x.rate, self.u.value, out=self._sum)
            np.multiply(self._sum, self._half, out=self._sum)
            np.add(x.integral, self._sum, out=x.integral)
        np.copyto(x.rate, self.u.value)
        np.copyto(self.y.value, x.integral)
