"""A vector whose small values count as zero."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import live_parameter
from .bounds import Bounded
from .elements import Elements, PerElement, spread
from .quantity_parameters import Keeps
from .vector import Vector


class DeadZone(Bounded, Keeps, Block):
    """Nothing within a zone, and what goes beyond it outside: y = u - min(max(u, lower), upper)."""

    class Params(Elements):
        lower: PerElement = live_parameter(-0.5, text="where the zone begins")
        upper: PerElement = live_parameter(0.5, text="where the zone ends")

    params: Params
    u = Input(Vector, text="what is passed on outside the zone")
    y = Output(Vector, text="how far u is beyond the zone")

    def setup(self) -> None:
        """Keep the bounds at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._lower = spread(self.params.lower, self.params.n)
        self._upper = spread(self.params.upper, self.params.n)

    def step(self) -> None:
        """Take off what is within the zone."""
        np.maximum(self.u.value, self._lower, out=self.y.value)
        np.minimum(self.y.value, self._upper, out=self.y.value)
        np.subtract(self.u.value, self.y.value, out=self.y.value)
