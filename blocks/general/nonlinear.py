"""Nonlinearities without dynamics of their own: limits, zones, hysteresis, steps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, ScalarOrVector, live_parameter
from ...runtime.language.signals import Field, Signal
from .vectors import (
    Bounded,
    Bounds,
    Flags,
    SourceParameters,
    UnitFromParameters,
    UnitOfInput,
    Vector,
    VectorParameters,
)


class Saturation(Bounded, UnitOfInput, Block):
    """Every element kept within its bounds: y = min(max(u, lower), upper).

    A bound that is left out does not bind.
    """

    class Params(VectorParameters):
        lower: ScalarOrVector | None = live_parameter(None, text="the least output")
        upper: ScalarOrVector | None = live_parameter(None, text="the greatest output")

    levels = ("lower", "upper")
    params: Params
    u = Input(Vector, text="the signal to bound")
    y = Output(Vector, text="u within the bounds")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, constants: Bounds) -> None:
        y.value[:] = min(constants.upper, max(constants.lower, u.value))


class DeadZone(Bounded, UnitOfInput, Block):
    """Nothing within a zone, and what goes beyond it outside: y = u - min(max(u, lower), upper)."""

    class Params(VectorParameters):
        lower: ScalarOrVector = live_parameter(-0.5, text="begin of the zone")
        upper: ScalarOrVector = live_parameter(0.5, text="end of the zone")

    levels = ("lower", "upper")
    params: Params
    u = Input(Vector, text="the signal that is passed on outside the zone")
    y = Output(Vector, text="distance of u beyond the zone")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, params: Params) -> None:
        y.value[:] = u.value - min(params.upper, max(params.lower, u.value))


class Backlash(UnitOfInput, Block):
    """Play: y[n] = min(max(y[n-1], u[n] - width / 2), u[n] + width / 2), from y = 0."""

    class Params(VectorParameters):
        width: ScalarOrVector = live_parameter(1.0, text="the play from one side to the other")

    levels = ("width",)
    params: Params
    u = Input(Vector, text="position of the driving part")
    y = Output(Vector, text="position of the driven part")
    x = State(Vector, text="position of the driven part before")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: Vector, params: Params) -> None:
        for i in range(u.value.shape[0]):
            half = 0.5 * max(params.width[i], 0.0)  # a negative play counts as none
            x.value[i] = min(u.value[i] + half, max(u.value[i] - half, x.value[i]))
        y.value[:] = x.value


class Quantiser(UnitOfInput, Block):
    """The nearest whole multiple of a step: y = interval round(u / interval), halves to even."""

    class Params(VectorParameters):
        interval: float = live_parameter(0.5, gt=0.0, text="from one output value to the next")

    params: Params
    u = Input(Vector, text="the signal to round")
    y = Output(Vector, text="the rounded vector")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, params: Params) -> None:
        y.value[:] = u.value / params.interval
        np.rint(y.value, y.value)
        y.value[:] *= params.interval


class LastOutput(Signal):
    """Memory of a block that starts at its first input."""

    value = Field("n", text="the last output")
    started = Field((), dtype="bool", text="there was one")


class RateLimiter(UnitOfInput, Block):
    """The input, followed only so fast: y[n] = min(max(u[n], y[n-1] - T f), y[n-1] + T r).

    r and f are the rates ``rising`` and ``falling`` and T is the block's period. The first output
    is the first input.
    """

    class Params(VectorParameters):
        rising: ScalarOrVector = live_parameter(1.0, text="the fastest growth per second, positive")
        falling: ScalarOrVector = live_parameter(1.0, text="the fastest fall per second, positive")

    levels = ("rising", "falling")
    params: Params
    u = Input(Vector, text="the signal to follow")
    y = Output(Vector, text="the signal that follows it")
    x = State(LastOutput, text="the output before")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: LastOutput, params: Params, period: float) -> None:
        if not x.started:
            x.value[:] = u.value
            x.started = True
        for i in range(u.value.shape[0]):
            lowest = x.value[i] - period * max(
                params.falling[i], 0.0
            )  # a negative rate counts as zero
            highest = x.value[i] + period * max(params.rising[i], 0.0)
            x.value[i] = min(highest, max(lowest, u.value[i]))
        y.value[:] = x.value


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
    u = Input(Vector, text="the signal that switches")
    y = Output(Vector, text="on_value or off_value")
    on = Output(Flags, text="elements that are on")
    x = State(Flags, text="elements that are on")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a block that does not switch off below where it switches on."""
        assert isinstance(params, cls.Params)
        if params.switch_off > params.switch_on:
            yield UnmetRequirement(
                "switch_off is above switch_on",
                parameter="switch_off",
                expected=f"at most {params.switch_on:g}",
                found=f"{params.switch_off:g}",
            )

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, on: Flags, x: Flags, params: Params) -> None:
        for i in range(u.value.shape[0]):
            stays = x.value[i] and u.value[i] > params.switch_off
            x.value[i] = stays or u.value[i] >= params.switch_on
            on.value[i] = x.value[i]
            y.value[i] = params.on_value if x.value[i] else params.off_value
