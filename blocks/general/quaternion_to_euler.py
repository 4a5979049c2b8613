"""Roll, pitch and yaw from a quaternion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.euler_angles import to_euler
from ...runtime.language.block import Block, Input, Output
from .rotation_signals import EulerAngles, Quaternion, random_unit


class QuaternionToEuler(Block):
    """Roll, pitch and yaw of a unit quaternion: R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll and yaw jump where they pass pi, and near a pitch of +-pi/2 they are ill-conditioned: use
    them to look at, and quaternions to control with.
    """

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(EulerAngles, text="roll, pitch, yaw")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A unit quaternion."""
        return {"u": random_unit(rng)}

    def step(self) -> None:
        """Convert."""
        to_euler(self.u.value, self.y.value)
