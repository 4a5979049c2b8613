"""A train of rectangular pulses."""

from __future__ import annotations

import math

import numpy as np

from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import live_parameter, parameter
from .elements import Elements, PerElement, spread
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Pulse(Says, Block):
    """Rectangular pulses: y = offset + amplitude in the first ``width`` share of every period.

    In between, and before ``start``, y = offset. Edges fall on the first tick that is not before
    them.
    """

    class Params(Elements, SourceParameters):
        in_unit = (
            "amplitude",
            "offset",
        )

        duration: float = parameter(1.0, unit="s", gt=0.0, text="from one pulse to the next")
        width: float = parameter(0.5, ge=0.0, le=1.0, text="share of it that the pulse lasts")
        start: float = parameter(0.0, unit="s", ge=0.0, text="when the first pulse begins")
        amplitude: PerElement = live_parameter(1.0, text="height of the pulses")
        offset: PerElement = live_parameter(0.0, text="the value between pulses")

    params: Params
    y = Output(Vector, text="the pulses")

    def setup(self) -> None:
        """Keep both levels at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._low = spread(self.params.offset, self.params.n)
        self._high = self._low + spread(self.params.amplitude, self.params.n)

    def step(self) -> None:
        """Write the level of the present time."""
        p = self.params
        periods = (self.time - p.start) / p.duration + 1e-9
        share = periods - math.floor(periods)
        high = periods >= 0.0 and share < p.width
        np.copyto(self.y.value, self._high if high else self._low)
