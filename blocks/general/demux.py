"""One vector as two."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters
from ...runtime.language.quantities import Carried, Given
from .pairs import First, Joined, PairSizes, Second


class Demux(Block):
    """The first ``n_a`` elements and the ``n_b`` behind them: [a, b] = u."""

    Params = PairSizes
    params: PairSizes
    u = Input(Joined, text="what is split")
    a = Output(First, text="the first elements")
    b = Output(Second, text="the elements behind them")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` is the sum of ``n_a`` and ``n_b``."""
        assert isinstance(params, cls.Params)
        return params.sizes()

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both are what u is."""
        return {"a": given["u"], "b": given["u"]}

    def step(self) -> None:
        """Split."""
        np.copyto(self.a.value, self.u.value[: self.params.n_a])
        np.copyto(self.b.value, self.u.value[self.params.n_a :])
