"""Nonlinearities without dynamics of their own: limits, zones, hysteresis, steps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from .vectors import (
    Bounded,
    Flags,
    ScalarOrVector,
    SourceParameters,
    UnitFromParameters,
    UnitOfInput,
    Vector,
    VectorParameters,
    broadcast,
    broadcast_bound,
)


class Saturation(Bounded, UnitOfInput, Block):
    """Every element kept within its bounds: y = min(max(u, lower), upper).

    A bound that is left out does not bind.
    """

    class Params(VectorParameters):
        lower: ScalarOrVector | None = live_parameter(None, text="the least output")
        upper: ScalarOrVector | None = live_parameter(None, text="the greatest output")

    params: Params
    u = Input(Vector, text="what is bounded")
    y = Output(Vector, text="u within the bounds")

    def setup(self) -> None:
        """Keep the bounds at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._lower = broadcast_bound(self.params.lower, self.params.n, -np.inf)
        self._upper = broadcast_bound(self.params.upper, self.params.n, np.inf)

    def step(self) -> None:
        """Apply the bounds."""
        np.maximum(self.u.value, self._lower, out=self.y.value)
        np.minimum(self.y.value, self._upper, out=self.y.value)


class DeadZone(Bounded, UnitOfInput, Block):
    """Nothing within a zone, and what goes beyond it outside: y = u - min(max(u, lower), upper)."""

    class Params(VectorParameters):
        lower: ScalarOrVector = live_parameter(-0.5, text="where the zone begins")
        upper: ScalarOrVector = live_parameter(0.5, text="where the zone ends")

    params: Params
    u = Input(Vector, text="what is passed on outside the zone")
    y = Output(Vector, text="how far u is beyond the zone")

    def setup(self) -> None:
        """Keep the bounds at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._lower = broadcast(self.params.lower, self.params.n)
        self._upper = broadcast(self.params.upper, self.params.n)

    def step(self) -> None:
        """Take off what is within the zone."""
        np.maximum(self.u.value, self._lower, out=self.y.value)
        np.minimum(self.y.value, self._upper, out=self.y.value)
        np.subtract(self.u.value, self.y.value, out=self.y.value)


class Backlash(UnitOfInput, Block):
    """Play: y[n] = min(max(y[n-1], u[n] - width / 2), u[n] + width / 2), from y = 0."""

    class Params(VectorParameters):
        width: ScalarOrVector = live_parameter(1.0, text="the play from one side to the other")

    params: Params
    u = Input(Vector, text="position of the driving part")
    y = Output(Vector, text="position of the driven part")
    x = State(Vector, text="position of the driven part before")

    def setup(self) -> None:
        """Keep half of the play at hand."""
        self._bound = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As an array, so that no tick makes one; a negative play counts as none."""
        self._half = 0.5 * np.maximum(broadcast(self.params.width, self.params.n), 0.0)

    def step(self) -> None:
        """Push the driven part along, if it is reached."""
        np.subtract(self.u.value, self._half, out=self._bound)
        np.maximum(self.x.value, self._bound, out=self.x.value)
        np.add(self.u.value, self._half, out=self._bound)
        np.minimum(self.x.value, self._bound, out=self.x.value)
        np.copyto(self.y.value, self.x.value)


class Quantiser(UnitOfInput, Block):
    """The nearest whole multiple of a step: y = interval round(u / interval), halves to even."""

    class Params(VectorParameters):
        interval: float = live_parameter(0.5, gt=0.0, text="from one output value to the next")

    params: Params
    u = Input(Vector, text="what is rounded")
    y = Output(Vector, text="the rounded vector")

    def setup(self) -> None:
        """Keep the step at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """As an array, so that no tick makes one."""
        self._interval = np.array(self.params.interval)

    def step(self) -> None:
        """Round."""
        np.divide(self.u.value, self._interval, out=self.y.value)
        np.rint(self.y.value, out=self.y.value)
        np.multiply(self.y.value, self._interval, out=self.y.value)


class LastOutput(Signal):
    """What a block that starts at its first input remembers."""

    value = Field("n", text="the last output")
    started = Field((), dtype="bool", text="whether there was one")


class RateLimiter(UnitOfInput, Block):
    """The input, followed only so fast: y[n] = min(max(u[n], y[n-1] - T f), y[n-1] + T r).

    r and f are the rates ``rising`` and ``falling`` and T is the block's period. The first output
    is the first input.
    """

    class Params(VectorParameters):
        rising: ScalarOrVector = live_parameter(1.0, text="the fastest growth per second, positive")
        falling: ScalarOrVector = live_parameter(1.0, text="the fastest fall per second, positive")

    params: Params
    u = Input(Vector, text="what is followed")
    y = Output(Vector, text="what follows it")
    x = State(LastOutput, text="the output before")

    def setup(self) -> None:
        """Keep the greatest steps at hand."""
        self._lower = np.zeros(self.params.n)
        self._upper = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Compute the greatest steps of one period; a negative rate counts as zero."""
        n = self.params.n
        self._rise = self.period * np.maximum(broadcast(self.params.rising, n), 0.0)
        self._fall = self.period * np.maximum(broadcast(self.params.falling, n), 0.0)

    def step(self) -> None:
        """Go towards the input."""
        x = self.x
        if not x.started:
            np.copyto(x.value, self.u.value)
            x.started[...] = True
        np.subtract(x.value, self._fall, out=self._lower)
        np.add(x.value, self._rise, out=self._upper)
        np.maximum(self.u.value, self._lower, out=x.value)
        np.minimum(x.value, self._upper, out=x.value)
        np.copyto(self.y.value, x.value)


class Relay(UnitFromParameters, Block):
    """Two values with hysteresis: on from u >= switch_on, off from u <= switch_off.

    In between every element stays as it was; all begin off. y = on_value or off_value.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "on_value",
            "off_value",
        )

        switch_on: float = live_parameter(0.5, text="the input from which it is on")
        switch_off: float = live_parameter(-0.5, text="the input down to which it stays on")
        on_value: float = live_parameter(1.0, text="the output when on")
        off_value: float = live_parameter(0.0, text="the output when off")

    params: Params
    u = Input(Vector, text="what switches")
    y = Output(Vector, text="on_value or off_value")
    on = Output(Flags, text="which elements are on")
    x = State(Flags, text="which elements are on")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """It must switch off below where it switches on."""
        assert isinstance(params, cls.Params)
        if params.switch_off > params.switch_on:
            yield Misfit(
                "switch_off is above switch_on",
                parameter="switch_off",
                expected=f"at most {params.switch_on:g}",
                found=f"{params.switch_off:g}",
            )

    def setup(self) -> None:
        """Keep the thresholds at hand."""
        self._above = np.zeros(self.params.n, bool)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As arrays, so that no tick makes them."""
        self._on, self._off = np.array(self.params.switch_on), np.array(self.params.switch_off)
        self._value = np.array(self.params.on_value)

    def step(self) -> None:
        """Switch what is beyond its threshold."""
        np.greater(self.u.value, self._off, out=self._above)
        np.logical_and(self.x.value, self._above, out=self.x.value)
        np.greater_equal(self.u.value, self._on, out=self._above)
        np.logical_or(self.x.value, self._above, out=self.x.value)
        np.copyto(self.on.value, self.x.value)
        self.y.value.fill(self.params.off_value)
        np.copyto(self.y.value, self._value, where=self.x.value)
