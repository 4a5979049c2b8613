"""Signals that are functions of time: constants, steps, ramps, pulses, sines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from .vectors import (
    ScalarOrVector,
    SourceParameters,
    UnitFromParameters,
    Vector,
    VectorParameters,
    broadcast,
)


@kernel
def first_tick(seconds: float, base_period: float) -> int:
    """The first tick that is not before an instant [s]; one that is meant to be on a tick is."""
    return math.ceil(seconds / base_period - 1e-6)


class Constant(UnitFromParameters, Block):
    """A constant vector: y[n] = value. It has as many elements as ``value``."""

    class Params(SourceParameters):
        in_unit = ("value",)

        value: list[float] = live_parameter(text="the vector", min_length=1)

    params: Params
    y = Output(Vector, text="the vector")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` is the length of ``value``."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.value)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three numbers."""
        return {"value": [1.0, -2.0, 0.5]}

    def setup(self) -> None:
        """Make the vector."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Make the vector again from the changed parameters."""
        self._value = np.array(self.params.value)

    def step(self) -> None:
        """Write the vector."""
        np.copyto(self.y.value, self._value)


class Step(UnitFromParameters, Block):
    """A vector that jumps once: y = before while t < at, y = after from then on.

    The jump comes in the first tick that is not before ``at``.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "before",
            "after",
        )

        at: float = parameter(1.0, unit="s", ge=0.0, text="when the step comes")
        before: ScalarOrVector = live_parameter(0.0, text="the value before the step")
        after: ScalarOrVector = live_parameter(1.0, text="the value from the step on")

    params: Params
    y = Output(Vector, text="the step")

    def setup(self) -> None:
        """Find the tick of the step."""
        self._tick = first_tick(self.params.at, self.context.clock.base_period)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep both values as arrays."""
        self._before = broadcast(self.params.before, self.params.n)
        self._after = broadcast(self.params.after, self.params.n)

    def step(self) -> None:
        """Write the value of the present tick."""
        np.copyto(self.y.value, self._before if self.tick < self._tick else self._after)


class Ramp(UnitFromParameters, Block):
    """Even growth: y = offset + slope min(max(t - start, 0), duration).

    Without ``duration`` it grows for ever.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("offset",)

        start: float = parameter(0.0, unit="s", ge=0.0, text="when it begins to grow")
        duration: float | None = parameter(None, unit="s", ge=0.0, text="how long it grows")
        slope: ScalarOrVector = live_parameter(1.0, text="growth per second")
        offset: ScalarOrVector = live_parameter(0.0, text="the value before the start")

    params: Params
    y = Output(Vector, text="the ramp")

    def setup(self) -> None:
        """Keep slope and offset at hand."""
        self._elapsed = np.zeros(())
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._slope = broadcast(self.params.slope, self.params.n)
        self._offset = broadcast(self.params.offset, self.params.n)

    def step(self) -> None:
        """Evaluate at the present time."""
        elapsed = max(self.time - self.params.start, 0.0)
        if self.params.duration is not None:
            elapsed = min(elapsed, self.params.duration)
        self._elapsed[...] = elapsed
        np.multiply(self._slope, self._elapsed, out=self.y.value)
        np.add(self.y.value, self._offset, out=self.y.value)


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
        start: float = parameter(0.0, unit="s", ge=0.0, text="when the first pulse begins")
        amplitude: ScalarOrVector = live_parameter(1.0, text="height of the pulses")
        offset: ScalarOrVector = live_parameter(0.0, text="the value between pulses")

    params: Params
    y = Output(Vector, text="the pulses")

    def setup(self) -> None:
        """Keep both levels at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._low = broadcast(self.params.offset, self.params.n)
        self._high = self._low + broadcast(self.params.amplitude, self.params.n)

    def step(self) -> None:
        """Write the level of the present time."""
        p = self.params
        periods = (self.time - p.start) / p.duration + 1e-9
        share = periods - math.floor(periods)
        high = periods >= 0.0 and share < p.width
        np.copyto(self.y.value, self._high if high else self._low)


class SineWave(UnitFromParameters, Block):
    """A sine of time in every element: y = offset + amplitude sin(2 pi frequency t + phase)."""

    class Params(SourceParameters):
        in_unit = (
            "amplitude",
            "offset",
        )

        n: int = parameter(1, ge=1, text="elements")
        amplitude: float = live_parameter(1.0, text="half of peak to peak")
        frequency: float = live_parameter(1.0, unit="Hz", ge=0.0, text="oscillations per second")
        phase: float = live_parameter(0.0, unit="rad", text="angle at time zero")
        offset: float = live_parameter(0.0, text="the mean")

    params: Params
    y = Output(Vector, text="the sine")

    def step(self) -> None:
        """Evaluate at the present time."""
        p = self.params
        angle = 2.0 * math.pi * p.frequency * self.time + p.phase
        self.y.value.fill(p.offset + p.amplitude * math.sin(angle))


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
            "linear", text="whether the frequency or its logarithm grows evenly"
        )
        amplitude: float = live_parameter(1.0, text="half of peak to peak")
        offset: float = live_parameter(0.0, text="the mean")

    params: Params
    y = Output(Vector, text="the sine, the same in every element")

    def step(self) -> None:
        """Evaluate at the present time."""
        p = self.params
        inside = min(self.time, p.duration)
        cycles = p.end_frequency * (self.time - inside)
        ratio = math.log(p.end_frequency / p.start_frequency)
        if p.sweep == "linear":
            growth = (p.end_frequency - p.start_frequency) / p.duration
            cycles += p.start_frequency * inside + 0.5 * growth * inside * inside
        elif ratio == 0.0:
            cycles += p.start_frequency * inside
        else:
            cycles += (
                p.start_frequency * p.duration * math.expm1(ratio * inside / p.duration) / ratio
            )
        self.y.value.fill(p.offset + p.amplitude * math.sin(2.0 * math.pi * cycles))
