"""The task for the centre of mass: linear momentum with feedforward and feedback."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, WholeBodyTarget
from .task import FeedbackTask, TaskError, TaskJacobian

Vector = tuple[float, float, float]


class LinearMomentum(FeedbackTask):
    """The centre of mass accelerates by a_ref + K_p (p_ref - p) + K_d (v_ref - v) (paper, V, task 2).

    With the linear rows A_l of the centroidal momentum matrix, their drift and the desired
    acceleration c'' above, the rows are A_l / m a = c'' - drift / m, in m/s^2. The mass m is that of
    the mass matrix, or the description's where the mass matrix is zero.
    """

    class Gains(Parameters):
        """Weights and gains of the centre of mass; vectors are x, y, z of the world."""

        linear_weight: Vector = parameter(
            (100.0, 100.0, 100.0), text="weight of the centre of mass, per m/s^2"
        )
        linear_stiffness: Vector = parameter(
            (100.0, 100.0, 100.0), unit="1/s^2", text="position gain of the centre of mass"
        )
        linear_damping: Vector = parameter(
            (20.0, 20.0, 20.0), unit="1/s", text="velocity gain of the centre of mass"
        )

    size = 3
    gains_prefix = "linear_"

    def setup(self) -> None:
        self.nominal_mass = self.robot.total_mass

    @kernel
    @staticmethod
    def error(terms: DynamicsTerms, target: WholeBodyTarget, e: TaskError) -> None:
        e.value[:] = target.com - terms.com
        e.rate[:] = target.com_velocity - terms.com_velocity
        e.feedforward[:] = target.com_acceleration

    @kernel
    @staticmethod
    def jacobian(terms: DynamicsTerms, nominal_mass: float, j: TaskJacobian) -> None:
        mass = terms.mass_matrix[0, 0]
        if mass == 0.0:
            mass = nominal_mass
        for row in range(3):
            for column in range(j.matrix.shape[1]):
                j.matrix[row, column] = terms.centroidal_matrix[row, column] / mass
            j.drift[row] = terms.centroidal_drift[row] / mass
