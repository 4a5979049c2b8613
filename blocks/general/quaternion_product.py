"""Two rotations, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.rotations import conjugate, multiply
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from .rotation_signals import Quaternion, random_unit


class QuaternionProduct(Block):
    """The product of two unit quaternions: y = a b, which turns first by b and then by a.

    With ``inverse`` it is y = a* b: the rotation b seen from a, so the error from a to b.
    """

    class Params(Parameters):
        inverse: bool = parameter(False, text="whether a is inverted")

    params: Params
    a = Input(Quaternion, text="the second rotation")
    b = Input(Quaternion, text="the first rotation")
    y = Output(Quaternion, text="both")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Unit quaternions."""
        return {"a": random_unit(rng), "b": random_unit(rng)}

    def setup(self) -> None:
        """Make room for the inverse."""
        self._inverse = np.zeros(4)

    def step(self) -> None:
        """Multiply."""
        a = self.a.value
        if self.params.inverse:
            conjugate(a, self._inverse)
            a = self._inverse
        multiply(a, self.b.value, self.y.value)
