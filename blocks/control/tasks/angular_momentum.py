"""The task for the angular momentum about the centre of mass: it is damped, or follows the plan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import Array1D, Array2D, Vector3
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.parameters import Parameters, parameter
from .task import KernelTask, Situation

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


class Feedback(NamedTuple):
    """Weights and gains as arrays, (3,) each, and whether the target is tracked."""

    weight: Array1D
    damping: Array1D
    track: bool


class Momentum(NamedTuple):
    """An angular momentum [N m s] and its rate [N m] about the centre of mass, (3,) each, world."""

    value: Vector3
    rate: Vector3


class AngularMomentum(KernelTask):
    """The rate of the angular momentum k is -K_d k, the paper's damping (V, task 4), or, with
    ``track_angular_momentum``, k_ref' + K_d (k_ref - k).

    The rows are the angular rows of the centroidal momentum matrix, in N m. The torso's error is in
    rad/s^2; for an equal effect the weight here must be larger by the factor 1/I^2, with I the
    inertia of the whole robot: about 160 for a robot of 5 kg, and below one for a robot of 30 kg.
    """

    Gains = AngularGains

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        super().__init__(situation, rows)
        terms, target = situation.terms, situation.target
        self._measured = Momentum(terms.angular_momentum, terms.centroidal_drift[3:6])
        self._target = Momentum(target.angular_momentum, target.angular_momentum_rate)

    @classmethod
    def row_count(cls, robot: RobotDescription, gains: AngularGains) -> int:
        return 3

    def prepare(self, gains: AngularGains) -> KernelCall:
        feedback = Feedback(
            np.array(gains.angular_weight), np.array(gains.angular_damping),
            gains.track_angular_momentum,
        )  # fmt: skip
        matrix = self.situation.terms.centroidal_matrix
        return KernelCall(angular_rows, matrix, self._measured, self._target, feedback, self.rows)


@kernel
def angular_rows(
    matrix: Array2D, measured: Momentum, target: Momentum, gains: Feedback, rows: TaskRows
) -> None:
    """Three rows for the rate of the angular momentum.

    Args:
        matrix: centroidal momentum matrix (6, n_velocities).
        measured: the measured momentum; its ``rate`` is the drift, the rate at zero acceleration.
        target: the planned momentum and its rate.
    """
    for i in range(3):
        for k in range(matrix.shape[1]):
            rows.jacobian[i, k] = matrix[3 + i, k]
        wanted = -float(gains.damping[i]) * float(measured.value[i])
        if gains.track:
            wanted += float(target.rate[i]) + float(gains.damping[i]) * float(target.value[i])
        rows.desired[i] = wanted - float(measured.rate[i])
        rows.weights[i] = gains.weight[i]
