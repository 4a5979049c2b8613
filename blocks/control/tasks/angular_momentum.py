"""The task for the angular momentum about the centre of mass: it is damped, or follows the plan."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....robots.kinematics import standing_feet
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, WholeBodyTarget
from .task import Task

Vector = tuple[float, float, float]
REFERENCE = 0.553
"""kg m^2, mass times the square of the height at which the centre of mass stands, of the robot whose weights the
parameters are."""


class AngularGains(Parameters):
    """Weights and gains of the angular momentum; vectors are x, y, z of the world."""

    angular_weight: Vector = parameter(
        (1.0, 1.0, 1.0), text="weight of the angular momentum, per N m"
    )
    angular_damping: Vector = parameter(
        (5.0, 5.0, 5.0), unit="1/s", text="gain on the error of the angular momentum"
    )
    angular_by_size: bool = parameter(
        False,
        text="the weight is that of a robot of 5 kg, and falls with the size of others",
    )
    track_angular_momentum: bool = parameter(
        False, text="track the target's angular momentum instead of damping all of it"
    )


class AngularMomentum(Task):
    """The rate of the angular momentum k is -K_d k, the paper's damping (V, task 4), or, with
    ``track_angular_momentum``, k_ref' + K_d (k_ref - k).

    The rows are the angular rows of the centroidal momentum matrix, in N m. Errors of the torso and the centre of
    mass are in rad/s^2 and m/s^2. With ``angular_by_size`` the weights are multiplied by (0.553 kg m^2 / (m h^2))^2,
    with the mass m and the height h at which the centre of mass stands, so that they mean the same beside those of
    the torso for robots of any size. After touchdown a robot of 90 kg would otherwise damp its angular momentum at
    any cost, and its torso would sway.
    """

    Gains = Params = AngularGains
    size = 3

    def setup(self) -> None:
        height = -float(standing_feet(self.robot)[:, 2].mean())
        share = REFERENCE / (self.robot.total_mass * height * height)
        # With two digits it is 1 for the robot that the weights were found with.
        self.size_factor = float(f"{share * share:.2g}")

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms,
        target: WholeBodyTarget,
        params: AngularGains,
        rows: TaskRows,
        size_factor: float,
    ) -> None:
        for i in range(3):
            for k in range(rows.jacobian.shape[1]):
                rows.jacobian[i, k] = terms.centroidal_matrix[3 + i, k]
            damping = params.angular_damping[i]
            rate = -damping * terms.angular_momentum[i]
            if params.track_angular_momentum:
                rate += target.angular_momentum_rate[i] + damping * target.angular_momentum[i]
            rows.desired[i] = rate - terms.centroidal_drift[3 + i]
            rows.weights[i] = params.angular_weight[i]
            if params.angular_by_size:
                rows.weights[i] = rows.weights[i] * size_factor
