"""A vector that grows evenly with time."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import live_parameter, parameter
from .elements import Elements, PerElement, spread
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Ramp(Says, Block):
    """Even growth: y = offset + slope min(max(t - start, 0), duration).

    Without ``duration`` it grows for ever.
    """

    class Params(Elements, SourceParameters):
        in_unit = ("offset",)

        start: float = parameter(0.0, unit="s", ge=0.0, text="when it begins to grow")
        duration: float | None = parameter(None, unit="s", ge=0.0, text="how long it grows")
        slope: PerElement = live_parameter(1.0, text="growth per second")
        offset: PerElement = live_parameter(0.0, text="the value before the start")

    params: Params
    y = Output(Vector, text="the ramp")

    def setup(self) -> None:
        """Keep slope and offset at hand."""
        self._elapsed = np.zeros(())
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._slope = spread(self.params.slope, self.params.n)
        self._offset = spread(self.params.offset, self.params.n)

    def step(self) -> None:
        """Evaluate at the present time."""
        elapsed = max(self.time - self.params.start, 0.0)
        if self.params.duration is not None:
            elapsed = min(elapsed, self.params.duration)
        self._elapsed[...] = elapsed
        np.multiply(self._slope, self._elapsed, out=self.y.value)
        np.add(self.y.value, self._offset, out=self.y.value)
