"""A rotation matrix from a quaternion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.rotations import to_matrix
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import Quaternion, RotationMatrix, random_unit


class QuaternionToMatrix(Block):
    """The rotation matrix (3, 3) of a unit quaternion; it takes body vectors to the world."""

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(RotationMatrix, text="the same rotation")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A unit quaternion."""
        return {"u": random_unit(rng)}

    def step(self) -> None:
        """Convert."""
        to_matrix(self.u.value, self.y.value)
