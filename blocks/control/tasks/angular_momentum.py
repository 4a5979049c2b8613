"""The task for the angular momentum about the centre of mass: it is damped, or follows the plan."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, WholeBodyTarget
from .task import Task

Vector = tuple[float, float, float]


class AngularGains(Parameters):
    """Weights and gains of the angular momentum; vectors are x, y, z of the world."""

    angular_weight: Vector = parameter(
        (1.0, 1.0, 1.0), text="weight of the angular momentum, per N m"
    )
    angular_damping: Vector = parameter(
        (5.0, 5.0, 5.0), unit="1/s", text="gain on the error of the angular momentum"
    )
    track_angular_momentum: bool = parameter(
        False, text="track the target's angular momentum instead of damping all of it"
    )


class AngularMomentum(Task):
    """The rate of the angular momentum k is -K_d k, the paper's damping (V, task 4), or, with
    ``track_angular_momentum``, k_ref' + K_d (k_ref - k).

    The rows are the angular rows of the centroidal momentum matrix, in N m. The torso's error is in
    rad/s^2; for an equal effect the weight here must be larger by the factor 1/I^2, with I the
    inertia of the whole robot: about 160 for a robot of 5 kg, and below one for a robot of 30 kg.
    """

    Gains = Params = AngularGains
    size = 3

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms, target: WholeBodyTarget, params: AngularGains, rows: TaskRows
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
