"""One of two vectors."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters
from ...runtime.language.quantities import Carried, Given
from .elements import Elements
from .flags import Flag
from .vector import Vector


class Switch(Block):
    """The first vector where the condition holds, else the second: y = a if condition else b."""

    Params = Elements
    params: Elements
    condition = Input(Flag, text="whether a is taken")
    a = Input(Vector, text="taken where the condition holds")
    b = Input(Vector, text="taken where it does not")
    y = Output(Vector, text="the one that is taken")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both vectors must be the same quantity, and so is the output."""
        return {"y": given.alike("a", "b")}

    def step(self) -> None:
        """Choose."""
        np.copyto(self.y.value, self.a.value if self.condition.value else self.b.value)
