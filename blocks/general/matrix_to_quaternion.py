"""A quaternion from a rotation matrix."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.rotations import from_matrix, to_matrix
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import Quaternion, RotationMatrix, random_unit


class MatrixToQuaternion(Block):
    """The unit quaternion of a rotation matrix, with w >= 0 where w is not tiny (Shepperd)."""

    u = Input(RotationMatrix, text="the rotation matrix")
    y = Output(Quaternion, text="the same rotation")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A rotation matrix."""
        matrix = np.zeros((3, 3))
        to_matrix(random_unit(rng)["value"], matrix)
        return {"u": {"value": matrix}}

    def step(self) -> None:
        """Convert."""
        from_matrix(self.u.value, self.y.value)
