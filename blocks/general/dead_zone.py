"""A vector whose small values count as zero."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output
from ...runtime.language.parameters import Parameters, live_parameter
from .bounds import crossed_bounds
from .elements import Elements, PerElement, spread
from .quantity_parameters import Keeps
from .vector import Vector


class DeadZone(Keeps, Block):
    """Nothing within a zone, and what goes beyond it outside: y = u - min(max(u, lower), upper)."""

    class Params(Elements):
        lower: PerElement = live_parameter(-0.5, text="where the zone begins")
        upper: PerElement = live_parameter(0.5, text="where the zone ends")

    params: Params
    u = Input(Vector, text="what is passed on outside the zone")
    y = Output(Vector, text="how far u is beyond the zone")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The bounds must not cross."""
        assert isinstance(params, cls.Params)
        return crossed_bounds(params.lower, params.upper, params.n)

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
