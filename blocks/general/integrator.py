"""The time integral of a vector."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.unit_algebra import SECOND
from .bounds import Bounded
from .elements import PerElement, spread_bound
from .flags import NEVER, Flag
from .initial_value import InitialParameters
from .vector import Vector


class Integrator(Bounded, Block):
    """The time integral by forward Euler: y[n] = x[n], x[n+1] = x[n] + T u[n], x[0] = initial.

    T is the block's period. With bounds x[n+1] is kept within them, so nothing winds up beyond.
    Where ``reset`` holds in tick n, x[n+1] = initial. A Moore block, so it breaks a loop;
    ``TrapezoidalIntegrator`` is more exact and does not.
    """

    class Params(InitialParameters):
        lower: PerElement | None = parameter(None, text="the least integral")
        upper: PerElement | None = parameter(None, text="the greatest integral")

    params: Params
    u = Input(Vector, text="the rate")
    reset = Input(Flag, text="whether to start anew from the initial value", default=NEVER)
    y = Output(Vector, text="its integral")
    x = State(Vector, text="the integral")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The unit of the rate times a second."""
        u = given["u"]
        return {"y": u and u.times(SECOND)}

    def setup(self) -> None:
        """Start from the initial value, and keep the bounds at hand."""
        p = self.params
        self._initial = p.start_value()
        self._lower = spread_bound(p.lower, p.n, -np.inf)
        self._upper = spread_bound(p.upper, p.n, np.inf)
        self._step = np.zeros(p.n)
        self._period = np.array(self.period)
        np.copyto(self.x.value, self._initial)

    def emit(self) -> None:
        """Write the integral so far."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Take one Euler step, or start anew."""
        if self.reset.value:
            np.copyto(self.x.value, self._initial)
            return
        np.multiply(self.u.value, self._period, out=self._step)
        np.add(self.x.value, self._step, out=self.x.value)
        np.maximum(self.x.value, self._lower, out=self.x.value)
        np.minimum(self.x.value, self._upper, out=self.x.value)
