"""A sine whose frequency sweeps."""

from __future__ import annotations

import math
from typing import Literal

from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import live_parameter, parameter
from .elements import Elements
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Chirp(Says, Block):
    """A sine that sweeps from one frequency to another: y = offset + amplitude sin(phi(t)).

    With frequencies f0 to f1 and duration D the phase is, for t <= D,

    * linear: phi = 2 pi (f0 t + (f1 - f0) t^2 / (2 D));
    * exponential: phi = 2 pi f0 D (k^(t / D) - 1) / ln k with k = f1 / f0.

    After D the sine goes on at f1 with no jump of its phase.
    """

    class Params(Elements, SourceParameters):
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
