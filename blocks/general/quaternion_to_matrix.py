"""A rotation matrix from a quaternion."""

from __future__ import annotations

from ...mathematics.rotations import to_matrix
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import OfQuaternion, Quaternion, RotationMatrix


class QuaternionToMatrix(OfQuaternion, Block):
    """The rotation matrix (3, 3) of a unit quaternion; it takes body vectors to the world."""

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(RotationMatrix, text="the same rotation")

    def step(self) -> None:
        """Convert."""
        to_matrix(self.u.value, self.y.value)
