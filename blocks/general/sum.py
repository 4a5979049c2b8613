"""The weighted sum of two vectors."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.quantities import Carried, Given
from .vector import Vector


class Sum(Block):
    """The weighted sum of two inputs: y = weights[0] a + weights[1] b; [1, -1] subtracts."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        weights: list[float] = live_parameter(
            [1.0, 1.0], min_length=2, max_length=2, text="factors of a and b"
        )

    params: Params
    a = Input(Vector, text="the first")
    b = Input(Vector, text="the second")
    y = Output(Vector, text="the sum")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both inputs must be the same quantity, and so is the sum."""
        return {"y": given.alike("a", "b")}

    def setup(self) -> None:
        """Keep the factors at hand."""
        self._product = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep the factors as arrays, so that no tick allocates any."""
        self._first, self._second = (np.array(weight) for weight in self.params.weights)

    def step(self) -> None:
        """Add."""
        np.multiply(self.b.value, self._second, out=self._product)
        np.multiply(self.a.value, self._first, out=self.y.value)
        np.add(self.y.value, self._product, out=self.y.value)
