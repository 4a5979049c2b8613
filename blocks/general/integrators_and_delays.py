"""Integrators, delays, and what holds a sample."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .vectors import (
    NEVER,
    Bounded,
    Flag,
    InitialValueParameters,
    ScalarOrVector,
    UnitOfInput,
    Vector,
    VectorParameters,
    broadcast_bound,
)


class Integrator(Bounded, Block):
    """The time integral by forward Euler: y[n] = x[n], x[n+1] = x[n] + T u[n], x[0] = initial.

    T is the block's period. With bounds x[n+1] is kept within them, so nothing winds up beyond.
    Where ``reset`` holds in tick n, x[n+1] = initial. A Moore block, so it breaks a loop;
    ``TrapezoidalIntegrator`` is more exact and does not.
    """

    class Params(InitialValueParameters):
        lower: ScalarOrVector | None = parameter(None, text="the least integral")
        upper: ScalarOrVector | None = parameter(None, text="the greatest integral")

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
        self._lower = broadcast_bound(p.lower, p.n, -np.inf)
        self._upper = broadcast_bound(p.upper, p.n, np.inf)
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

    Params = InitialValueParameters
    params: InitialValueParameters
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


class UnitDelay(UnitOfInput, Block):
    """The input of the run before: y[n] = x[n], x[n+1] = u[n], x[0] = initial.

    A Moore block, so it breaks a loop.
    """

    Params = InitialValueParameters
    params: InitialValueParameters
    u = Input(Vector, text="what is delayed")
    y = Output(Vector, text="u one run ago")
    x = State(Vector, text="u of the last run")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()

    def emit(self) -> None:
        """Write the input of the last run."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Remember the input."""
        np.copyto(self.x.value, self.u.value)


class Line(Signal):
    """A delay line."""

    values = Field(("samples", "n"), text="the last inputs, each in the place of its turn")
    next = Field((), dtype="int64", text="the place of the oldest, which is the next to be written")


class Delay(UnitOfInput, Block):
    """The input of k runs before: y[n] = u[n-k] with k = ``samples``, and initial for n < k.

    A Moore block, so it breaks a loop. A wire delays as well: ``{from: a.y, delay: 3}``.
    """

    class Params(InitialValueParameters):
        samples: int = parameter(1, ge=1, text="k, by how many runs of the block")

    params: Params
    u = Input(Vector, text="what is delayed")
    y = Output(Vector, text="u, k runs ago")
    x = State(Line, text="the last k inputs")

    def setup(self) -> None:
        """Fill the line with the initial value."""
        self.x.values[...] = self.params.start_value()

    def emit(self) -> None:
        """Write the oldest."""
        np.copyto(self.y.value, self.x.values[int(self.x.next)])

    def update(self) -> None:
        """Replace the oldest by the input."""
        place = int(self.x.next)
        np.copyto(self.x.values[place], self.u.value)
        self.x.next[...] = (place + 1) % self.params.samples


class SampleHold(UnitOfInput, Block):
    """The input where ``trigger`` holds, and its last such value where it does not.

    Before the first sample y = initial.
    """

    Params = InitialValueParameters
    params: InitialValueParameters
    u = Input(Vector, text="what is sampled")
    trigger = Input(Flag, text="whether to sample")
    y = Output(Vector, text="the last sample")
    x = State(Vector, text="the last sample")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()

    def step(self) -> None:
        """Take a sample if asked to."""
        if self.trigger.value:
            np.copyto(self.x.value, self.u.value)
        np.copyto(self.y.value, self.x.value)


class Held(Signal):
    """A held sample."""

    value = Field("n", text="the last sample")
    age = Field((), dtype="int64", text="runs since it was taken")


class ZeroOrderHold(UnitOfInput, Block):
    """A sample of the input in every k-th run, held in between: y[n] = u[k floor(n / k)].

    Between blocks of different rates none is needed: there a slower reader samples and a faster
    one holds by itself.
    """

    class Params(VectorParameters):
        samples: int = parameter(2, ge=1, text="k, from one sample to the next in runs")

    params: Params
    u = Input(Vector, text="what is sampled")
    y = Output(Vector, text="the last sample")
    x = State(Held, text="the last sample")

    def step(self) -> None:
        """Take a sample if it is time to."""
        age = int(self.x.age)
        if age == 0:
            np.copyto(self.x.value, self.u.value)
        self.x.age[...] = (age + 1) % self.params.samples
        np.copyto(self.y.value, self.x.value)
