"""Two vectors as one."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters
from ...runtime.language.quantities import UNCHECKED, Carried, Given
from .pairs import First, Joined, Pairs, PairSizes, Second


class Mux(Pairs, Block):
    """Two vectors one behind the other: y = [a, b]. More are joined by several such blocks."""

    Params = PairSizes
    params: PairSizes
    a = Input(First, text="the first elements")
    b = Input(Second, text="the elements behind them")
    y = Output(Joined, text="all elements")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """What both have in common; the unit is not checked where they differ."""
        a, b = given["a"], given["b"]
        if a is None or b is None:
            return {}
        return {"y": a if a == b else UNCHECKED}

    def step(self) -> None:
        """Join."""
        np.copyto(self.y.value[: self.params.n_a], self.a.value)
        np.copyto(self.y.value[self.params.n_a :], self.b.value)
