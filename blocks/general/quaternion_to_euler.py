"""Roll, pitch and yaw from a quaternion."""

from __future__ import annotations

from ...mathematics.rotations import to_euler
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import EulerAngles, OfQuaternion, Quaternion


class QuaternionToEuler(OfQuaternion, Block):
    """Roll, pitch and yaw of a unit quaternion: R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll and yaw jump where they pass pi, and near a pitch of +-pi/2 they are ill-conditioned: use
    them to look at, and quaternions to control with.
    """

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(EulerAngles, text="roll, pitch, yaw")

    def step(self) -> None:
        """Convert."""
        to_euler(self.u.value, self.y.value)
