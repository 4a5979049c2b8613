"""Integrators, delays, and what holds a sample."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, ScalarOrVector, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .vectors import (
    NEVER,
    Bounded,
    Bounds,
    Flag,
    InitialValueParameters,
    UnitOfInput,
    Vector,
    VectorParameters,
    ask_for_lists,
)


class Integrator(Bounded, Block):
    """The time integral by forward Euler: y[n] = x[n], x[n+1] = x[n] + T u[n], x[0] = initial.

    T is the block's period. With bounds x[n+1] is kept within them, so nothing winds up beyond.
    Where ``reset`` holds in tick n, x[n+1] = initial. A Moore block, so it breaks a loop;
    ``TrapezoidalIntegrator`` is more exact and does not.

    Forward Euler adds energy: two of these in a ring, as a mass on a spring, grow by a factor of
    sqrt(1 + (w T)^2) per run at w rad/s. ``DoubleIntegrator`` does not.
    """

    class Params(InitialValueParameters):
        lower: ScalarOrVector | None = parameter(None, text="the least integral")
        upper: ScalarOrVector | None = parameter(None, text="the greatest integral")

    params: Params
    u = Input(Vector, text="the rate")
    reset = Input(Flag, text="starts anew from the initial value", default=NEVER)
    y = Output(Vector, text="its integral")
    x = State(Vector, text="the integral")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the unit of the rate times a second."""
        ask_for_lists(("initial", "lower", "upper"), params, inputs)
        u = inputs["u"]
        return {"y": u and u.times(SECOND)}

    def setup(self) -> None:
        self.x.value[...] = self.params.initial

    @kernel
    @staticmethod
    def emit(y: Vector, x: Vector) -> None:
        y.value[:] = x.value

    @kernel
    @staticmethod
    def update(
        u: Vector, reset: Flag, x: Vector, params: Params, constants: Bounds, period: float
    ) -> None:
        if reset.value:
            x.value[:] = params.initial
        else:
            x.value[:] += u.value * period
            x.value[:] = min(constants.upper, max(constants.lower, x.value))


class DoubleIntegralState(Signal):
    """State of the double integrator."""

    rate = Field("n", text="the integral of the input")
    value = Field("n", text="the integral of the rate")


class DoubleIntegrator(Block):
    """From acceleration to position by semi-implicit Euler: the position takes the new rate.

    rate[n+1] = rate[n] + T u[n], y[n+1] = y[n] + T rate[n+1], with T the block's period. A mass on a
    spring of w rad/s keeps its amplitude as long as w T < 2, where two of ``Integrator`` in a row
    would grow (symplectic Euler). Where ``reset`` holds in tick n, both start again from their
    initial values. A Moore block, so it breaks a loop.
    """

    class Params(VectorParameters):
        initial: ScalarOrVector = parameter(
            0.0, text="the first position: n numbers, or one for all elements"
        )
        initial_rate: ScalarOrVector = parameter(0.0, text="the first rate, likewise")

    params: Params
    u = Input(Vector, text="the acceleration")
    reset = Input(Flag, text="starts again from the initial values", default=NEVER)
    rate = Output(Vector, text="its integral")
    y = Output(Vector, text="the integral of the rate")
    x = State(DoubleIntegralState, text="position and rate")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the unit of the acceleration times a second, once and twice."""
        u = inputs["u"]
        return {"rate": u and u.times(SECOND), "y": u and u.times(SECOND).times(SECOND)}

    def setup(self) -> None:
        self.x.rate[...] = self.params.initial_rate
        self.x.value[...] = self.params.initial

    @kernel
    @staticmethod
    def emit(rate: Vector, y: Vector, x: DoubleIntegralState) -> None:
        rate.value[:] = x.rate
        y.value[:] = x.value

    @kernel
    @staticmethod
    def update(
        u: Vector, reset: Flag, x: DoubleIntegralState, params: Params, period: float
    ) -> None:
        if reset.value:
            x.rate[:] = params.initial_rate
            x.value[:] = params.initial
        else:
            x.rate[:] += u.value * period
            x.value[:] += x.rate * period


class TrapezoidalState(Signal):
    """Memory of the trapezoidal integrator."""

    integral = Field("n", text="the integral so far")
    rate = Field("n", text="the input before")
    started = Field((), dtype="bool", text="there was an input since the start or a reset")


class TrapezoidalIntegrator(Block):
    """The time integral by trapezoids: y[n] = y[n-1] + T (u[n-1] + u[n]) / 2, y[0] = initial.

    T is the block's period. Where ``reset`` holds it starts anew: y = initial. The output follows
    from the input of the same tick, so it breaks no loop; ``Integrator`` does.
    """

    Params = InitialValueParameters
    params: InitialValueParameters
    u = Input(Vector, text="the rate")
    reset = Input(Flag, text="starts anew from the initial value", default=NEVER)
    y = Output(Vector, text="its integral")
    x = State(TrapezoidalState, text="the integral and the rate before")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the unit of the rate times a second."""
        u = inputs["u"]
        return {"y": u and u.times(SECOND)}

    @kernel
    @staticmethod
    def step(
        u: Vector,
        reset: Flag,
        y: Vector,
        x: TrapezoidalState,
        params: InitialValueParameters,
        period: float,
    ) -> None:
        if reset.value or not x.started:
            x.integral[:] = params.initial
            x.started = True
        else:
            x.integral[:] += (x.rate + u.value) * (0.5 * period)
        x.rate[:] = u.value
        y.value[:] = x.integral


class UnitDelay(UnitOfInput, Block):
    """The input of the run before: y[n] = x[n], x[n+1] = u[n], x[0] = initial.

    A Moore block, so it breaks a loop.
    """

    Params = InitialValueParameters
    levels = ("initial",)
    params: InitialValueParameters
    u = Input(Vector, text="the signal to delay")
    y = Output(Vector, text="u one run ago")
    x = State(Vector, text="u of the last run")

    def setup(self) -> None:
        self.x.value[...] = self.params.initial

    @kernel
    @staticmethod
    def emit(y: Vector, x: Vector) -> None:
        y.value[:] = x.value

    @kernel
    @staticmethod
    def update(u: Vector, x: Vector) -> None:
        x.value[:] = u.value


class DelayLine(Signal):
    """A delay line."""

    values = Field(
        ("samples", "n"), text="the last inputs, each in the place of its turn", ring="next"
    )
    next = Field((), dtype="int64", text="the place of the oldest, which is the next to be written")


class Delay(UnitOfInput, Block):
    """The input of k runs before: y[n] = u[n-k] with k = ``samples``, and initial for n < k.

    A Moore block, so it breaks a loop. A wire delays as well: ``{from: a.y, delay: 3}``.
    """

    class Params(InitialValueParameters):
        samples: int = parameter(1, ge=1, text="k, the delay in runs of the block")

    levels = ("initial",)
    params: Params
    u = Input(Vector, text="the signal to delay")
    y = Output(Vector, text="u, k runs ago")
    x = State(DelayLine, text="the last k inputs")

    def setup(self) -> None:
        self.x.values[...] = self.params.initial

    @kernel
    @staticmethod
    def emit(y: Vector, x: DelayLine) -> None:
        y.value[:] = x.values[x.next, :]

    @kernel
    @staticmethod
    def update(u: Vector, x: DelayLine, params: Params) -> None:
        x.values[x.next, :] = u.value
        x.next = (x.next + 1) % params.samples


class SampleHold(UnitOfInput, Block):
    """The input where ``trigger`` holds, and its last such value where it does not.

    Before the first sample y = initial.
    """

    Params = InitialValueParameters
    levels = ("initial",)
    params: InitialValueParameters
    u = Input(Vector, text="the signal to sample")
    trigger = Input(Flag, text="takes a sample")
    y = Output(Vector, text="the last sample")
    x = State(Vector, text="the last sample")

    def setup(self) -> None:
        self.x.value[...] = self.params.initial

    @kernel
    @staticmethod
    def step(u: Vector, trigger: Flag, y: Vector, x: Vector) -> None:
        if trigger.value:
            x.value[:] = u.value
        y.value[:] = x.value


class HeldSample(Signal):
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
    u = Input(Vector, text="the signal to sample")
    y = Output(Vector, text="the last sample")
    x = State(HeldSample, text="the last sample")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: HeldSample, params: Params) -> None:
        if x.age == 0:
            x.value[:] = u.value
        x.age = (x.age + 1) % params.samples
        y.value[:] = x.value
