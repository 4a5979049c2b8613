"""One vector as two."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters
from ...runtime.language.quantities import Carried, Given
from .pairs import First, Joined, Pairs, PairSizes, Second


class Demux(Pairs, Block):
    """The first ``n_a`` elements and the ``n_b`` behind them: [a, b] = u."""

    Params = PairSizes
    params: PairSizes
    u = Input(Joined, text="what is split")
    a = Output(First, text="the first elements")
    b = Output(Second, text="the elements behind them")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both are what u is."""
        return {"a": given["u"], "b": given["u"]}

    def step(self) -> None:
        """Split."""
        np.copyto(self.a.value, self.u.value[: self.params.n_a])
        np.copyto(self.b.value, self.u.value[self.params.n_a :])
