"""A vector kept within bounds."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import live_parameter
from .bounds import Bounded
from .elements import Elements, PerElement, spread_bound
from .quantity_parameters import Keeps
from .vector import Vector


class Saturation(Bounded, Keeps, Block):
    """Every element kept within its bounds: y = min(max(u, lower), upper).

    A bound that is left out does not bind.
    """

    class Params(Elements):
        lower: PerElement | None = live_parameter(None, text="the least output")
        upper: PerElement | None = live_parameter(None, text="the greatest output")

    params: Params
    u = Input(Vector, text="what is bounded")
    y = Output(Vector, text="u within the bounds")

    def setup(self) -> None:
        """Keep the bounds at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep them as arrays, so that no tick makes them."""
        self._lower = spread_bound(self.params.lower, self.params.n, -np.inf)
        self._upper = spread_bound(self.params.upper, self.params.n, np.inf)

    def step(self) -> None:
        """Apply the bounds."""
        np.maximum(self.u.value, self._lower, out=self.y.value)
        np.minimum(self.y.value, self._upper, out=self.y.value)
