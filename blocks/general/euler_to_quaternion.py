"""A quaternion from roll, pitch and yaw."""

from __future__ import annotations

from ...mathematics.rotations import from_euler
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import EulerAngles, Quaternion


class EulerToQuaternion(Block):
    """The unit quaternion of roll, pitch and yaw: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    u = Input(EulerAngles, text="roll, pitch, yaw")
    y = Output(Quaternion, text="the same rotation")

    def step(self) -> None:
        """Convert."""
        from_euler(self.u.value, self.y.value)
