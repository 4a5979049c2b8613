"""Signals that are functions of time: constants, steps, ramps, pulses, sines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import field_validator

from ...mathematics.elementary import expm1, log, sin
from ...mathematics.kernel import kernel
from ...mathematics.ticks import first_tick, in_ticks, since_begin
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Clock, Output
from ...runtime.language.parameters import Parameters, ScalarOrVector, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from .vectors import (
    SourceParameters,
    UnitFromParameters,
    Vector,
    VectorParameters,
)


class Constant(UnitFromParameters, Block):
    """A constant vector: y[n] = value. It has as many elements as ``value``."""

    class Params(SourceParameters):
        in_unit = ("value",)

        value: list[float] = live_parameter(text="the vector", min_length=1)

    params: Params
    y = Output(Vector, text="the vector")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` is the length of ``value``."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.value)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three numbers."""
        return {"value": [1.0, -2.0, 0.5]}

    @kernel
    @staticmethod
    def step(y: Vector, params: Params) -> None:
        y.value[:] = params.value


class Step(UnitFromParameters, Block):
    """A vector that jumps once: y = before while t < at, y = after from then on.

    The jump comes in the first tick that is not before ``at``.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "before",
            "after",
        )

        at: float = parameter(1.0, unit="s", ge=0.0, text="time of the step")
        before: ScalarOrVector = live_parameter(0.0, text="the value before the step")
        after: ScalarOrVector = live_parameter(1.0, text="the value from the step on")

    params: Params
    y = Output(Vector, text="the step")

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, clock: Clock) -> None:
        if clock.tick < first_tick(params.at, clock.base_period):
            y.value[:] = params.before
        else:
            y.value[:] = params.after


class Ramp(UnitFromParameters, Block):
    """Even growth: y = offset + slope min(max(t - start, 0), duration).

    Without ``duration`` it grows for ever.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("offset",)

        start: float = parameter(0.0, unit="s", ge=0.0, text="time at which it begins to grow")
        duration: float | None = parameter(None, unit="s", ge=0.0, text="time for which it grows")
        slope: ScalarOrVector = live_parameter(1.0, text="growth per second")
        offset: ScalarOrVector = live_parameter(0.0, text="the value before the start")

    class Constants(Signal):
        """Constants derived from the parameters."""

        duration = Field(unit="s", text="time for which it grows, maybe for ever")

    params: Params
    y = Output(Vector, text="the ramp")

    def prepare(self) -> None:
        duration = self.params.duration
        self.constants.duration = math.inf if duration is None else duration

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, constants: Constants, clock: Clock) -> None:
        time = clock.base_period * clock.tick
        elapsed = min(max(time - params.start, 0.0), constants.duration)
        y.value[:] = params.slope * elapsed + params.offset


class Pulse(UnitFromParameters, Block):
    """Rectangular pulses: y = offset + amplitude in the first ``width`` share of every period.

    In between, and before ``start``, y = offset. Edges fall on the first tick that is not before
    them.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "amplitude",
            "offset",
        )

        duration: float = parameter(1.0, unit="s", gt=0.0, text="from one pulse to the next")
        width: float = parameter(0.5, ge=0.0, le=1.0, text="share of it that the pulse lasts")
        start: float = parameter(0.0, unit="s", ge=0.0, text="time at which the first pulse begins")
        amplitude: ScalarOrVector = live_parameter(1.0, text="height of the pulses")
        offset: ScalarOrVector = live_parameter(0.0, text="the value between pulses")

    params: Params
    y = Output(Vector, text="the pulses")

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, clock: Clock) -> None:
        now = float(clock.tick)
        begin = in_ticks(params.start, clock.base_period)
        length = in_ticks(params.duration, clock.base_period)
        high = in_ticks(params.width * length, 1.0)
        y.value[:] = params.offset
        if now >= begin and since_begin(now, begin, length) < high:
            y.value[:] += params.amplitude


class SineWave(UnitFromParameters, Block):
    """A sine of time in every element: y = offset + amplitude sin(2 pi frequency t + phase).

    Each parameter is one number for all ``n`` elements, or a list with one for each.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "amplitude",
            "offset",
        )

        amplitude: ScalarOrVector = live_parameter(1.0, text="half of peak to peak")
        frequency: ScalarOrVector = live_parameter(1.0, unit="Hz", text="oscillations per second")
        phase: ScalarOrVector = live_parameter(0.0, unit="rad", text="angle at time zero")
        offset: ScalarOrVector = live_parameter(0.0, text="the mean")

        @field_validator("frequency")
        @classmethod
        def _check_frequency(cls, value: ScalarOrVector) -> ScalarOrVector:
            if min(value if isinstance(value, list) else [value]) < 0.0:
                raise ValueError("expected frequencies of zero or more")
            return value

        def live_range(self, name: str) -> tuple[float | None, float | None]:
            """Return the bounds of a parameter, from which a page makes a slider."""
            return (0.0, None) if name == "frequency" else (None, None)

    params: Params
    y = Output(Vector, text="the sine")

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, clock: Clock) -> None:
        time = clock.base_period * clock.tick
        y.value[:] = 2.0 * math.pi * params.frequency * time + params.phase
        for i in range(y.value.shape[0]):
            y.value[i] = sin(y.value[i])
        y.value[:] = params.offset + params.amplitude * y.value


class Chirp(UnitFromParameters, Block):
    """A sine that sweeps from one frequency to another: y = offset + amplitude sin(phi(t)).

    With frequencies f0 to f1 and duration D the phase is, for t <= D,

    * linear: phi = 2 pi (f0 t + (f1 - f0) t^2 / (2 D));
    * exponential: phi = 2 pi f0 D (k^(t / D) - 1) / ln k with k = f1 / f0.

    After D the sine goes on at f1 with no jump of its phase.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "amplitude",
            "offset",
        )

        start_frequency: float = parameter(0.1, unit="Hz", gt=0.0, text="frequency at time zero")
        end_frequency: float = parameter(10.0, unit="Hz", gt=0.0, text="frequency at the end")
        duration: float = parameter(10.0, unit="s", gt=0.0, text="of the sweep")
        sweep: Literal["linear", "exponential"] = parameter(
            "linear", text="the frequency or its logarithm grows evenly"
        )
        amplitude: float = live_parameter(1.0, text="half of peak to peak")
        offset: float = live_parameter(0.0, text="the mean")

    params: Params
    y = Output(Vector, text="the sine, the same in every element")

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, clock: Clock) -> None:
        time = clock.base_period * clock.tick
        start, end, duration = params.start_frequency, params.end_frequency, params.duration
        inside = min(time, duration)
        cycles = end * (time - inside)
        ratio = log(end / start)
        if params.sweep == "linear":
            growth = (end - start) / duration
            cycles += start * inside + 0.5 * growth * inside * inside
        elif ratio == 0.0:
            cycles += start * inside
        else:
            cycles += start * duration * expm1(ratio * inside / duration) / ratio
        y.value[:] = params.offset + params.amplitude * sin(2.0 * math.pi * cycles)
