"""The task for the torso's orientation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import Array1D, Array2D, Vector3
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.kernel import kernel
from ....mathematics.rotations import conjugate, from_matrix, logarithm, multiply
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.parameters import Parameters, parameter
from .task import KernelTask, Situation

Vector = tuple[float, float, float]


class TorsoGains(Parameters):
    """Weights and gains of the torso's orientation; vectors are x, y, z of the body."""

    torso_weight: Vector = parameter((10.0, 10.0, 10.0), text="weight of the torso, per rad/s^2")
    torso_stiffness: Vector = parameter(
        (200.0, 200.0, 200.0), unit="1/s^2", text="gain on the torso's orientation error"
    )
    torso_damping: Vector = parameter(
        (28.0, 28.0, 28.0), unit="1/s", text="gain on the torso's angular velocity error"
    )


class Feedback(NamedTuple):
    """Weights and gains as arrays, (3,) each."""

    weight: Array1D
    stiffness: Array1D
    damping: Array1D


class Attitude(NamedTuple):
    """An orientation as quaternion x, y, z, w and an angular velocity [rad/s, body]."""

    orientation: Array1D
    angular_velocity: Vector3


class TorsoOrientation(KernelTask):
    """The base's angular acceleration is K_p Log(R' R_ref) + K_d (w_ref - w) (paper, V, task 3).

    The rows select the base's angular acceleration [rad/s^2, body].
    """

    Gains = TorsoGains

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        super().__init__(situation, rows)
        terms, target = situation.terms, situation.target
        self._measured = Attitude(np.zeros(4), terms.velocity[3:6])
        self._target = Attitude(target.orientation, target.angular_velocity)
        self._error, self._quaternion = np.zeros(3), np.zeros(4)

    @classmethod
    def row_count(cls, robot: RobotDescription, gains: TorsoGains) -> int:
        return 3

    def prepare(self, gains: TorsoGains) -> KernelCall:
        feedback = Feedback(
            np.array(gains.torso_weight), np.array(gains.torso_stiffness),
            np.array(gains.torso_damping),
        )  # fmt: skip
        return KernelCall(
            torso_task, self.situation.terms.base_rotation, self._measured, self._target, feedback,
            self._error, self._quaternion, self.rows,
        )  # fmt: skip


@kernel
def torso_task(
    rotation: Array2D,
    measured: Attitude,
    target: Attitude,
    gains: Feedback,
    error: Array1D,
    quaternion: Array1D,
    rows: TaskRows,
) -> None:
    """``torso_rows`` for a base whose ``rotation`` (3, 3) is given instead of its quaternion."""
    from_matrix(rotation, measured.orientation)
    torso_rows(measured, target, gains, error, quaternion, rows)


@kernel
def torso_rows(
    measured: Attitude,
    target: Attitude,
    gains: Feedback,
    error: Vector3,
    quaternion: Array1D,
    rows: TaskRows,
) -> None:
    """Three rows for the angular acceleration of the base.

    Args:
        error, quaternion: scratch (3,) and (4,).
    """
    for i in range(3):
        for k in range(rows.jacobian.shape[1]):
            rows.jacobian[i, k] = 0.0
    conjugate(measured.orientation, quaternion)
    multiply(quaternion, target.orientation, quaternion)
    logarithm(quaternion, error)
    for i in range(3):
        rows.jacobian[i, 3 + i] = 1.0
        rows.desired[i] = float(gains.stiffness[i]) * error[i] + float(gains.damping[i]) * (
            float(target.angular_velocity[i]) - float(measured.angular_velocity[i])
        )
        rows.weights[i] = gains.weight[i]
