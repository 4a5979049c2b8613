"""The task for the torso's orientation."""

from __future__ import annotations

import numpy as np

from ....mathematics.arrays import Array1D
from ....mathematics.kernel import kernel
from ....mathematics.rotations import conjugate, from_matrix, logarithm, multiply
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, WholeBodyTarget
from .task import FeedbackTask, TaskError, TaskJacobian

Vector = tuple[float, float, float]


class TorsoOrientation(FeedbackTask):
    """The base's angular acceleration is s w_ref' + K_p Log(R' R_ref) + K_d (w_ref - w) (paper, V, task 3).

    Without the planned w_ref', of which the share s is fed forward, the torso of BRUCE lagged by 4 degrees when
    a squat swings it ahead, took that through thrust and flight, and touched down tilted by twice as much.

    The rows select the base's angular acceleration [rad/s^2, body].
    """

    class Gains(Parameters):
        """Weights and gains of the torso's orientation; vectors are x, y, z of the body."""

        torso_weight: Vector = parameter(
            (10.0, 10.0, 10.0), text="weight of the torso, per rad/s^2"
        )
        torso_stiffness: Vector = parameter(
            (200.0, 200.0, 200.0), unit="1/s^2", text="gain on the torso's orientation error"
        )
        torso_damping: Vector = parameter(
            (28.0, 28.0, 28.0), unit="1/s", text="gain on the torso's angular velocity error"
        )
        torso_feedforward: float = parameter(
            1.0,
            ge=0.0,
            le=1.0,
            text="share of the planned angular acceleration that is fed forward",
        )

    size = 3
    gains_prefix = "torso_"

    def setup(self) -> None:
        self.quaternion = np.zeros(4)

    @kernel
    @staticmethod
    def error(
        terms: DynamicsTerms,
        target: WholeBodyTarget,
        quaternion: Array1D,
        params: Gains,
        e: TaskError,
    ) -> None:
        from_matrix(terms.base_rotation, quaternion)
        conjugate(quaternion, quaternion)
        multiply(quaternion, target.orientation, quaternion)
        logarithm(quaternion, e.value)
        e.rate[:] = target.angular_velocity - terms.velocity[3:6]
        e.feedforward[:] = params.torso_feedforward * target.angular_acceleration

    @kernel
    @staticmethod
    def jacobian(j: TaskJacobian) -> None:
        j.matrix[:, :] = 0.0
        for row in range(3):
            j.matrix[row, 3 + row] = 1.0
