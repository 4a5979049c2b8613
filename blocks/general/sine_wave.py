"""A sine of time."""

from __future__ import annotations

import math

from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import live_parameter, parameter
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class SineWave(Says, Block):
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
