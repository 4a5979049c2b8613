"""The task for the centre of mass: linear momentum with feedforward and feedback."""

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


class LinearGains(Parameters):
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


class Feedback(NamedTuple):
    """Weights and gains as arrays, (3,) each."""

    weight: Array1D
    stiffness: Array1D
    damping: Array1D


class Centre(NamedTuple):
    """A centre of mass: position, velocity and acceleration [m, m/s, m/s^2, world], (3,) each."""

    position: Vector3
    velocity: Vector3
    acceleration: Array1D


class LinearMomentum(KernelTask):
    """The centre of mass accelerates by a_ref + K_p (p_ref - p) + K_d (v_ref - v) (paper, V, task 2).

    With the linear rows A_l of the centroidal momentum matrix, their drift and the desired
    acceleration c'' above, the rows are A_l / m a = c'' - drift / m, in m/s^2. The mass m is that of
    the mass matrix.
    """

    Gains = LinearGains

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        super().__init__(situation, rows)
        terms, target = situation.terms, situation.target
        self._described = situation.robot.total_mass
        self._target = Centre(target.com, target.com_velocity, target.com_acceleration)
        self._measured = Centre(terms.com, terms.com_velocity, terms.centroidal_drift)

    @classmethod
    def row_count(cls, robot: RobotDescription, gains: LinearGains) -> int:
        return 3

    def prepare(self, gains: LinearGains) -> KernelCall:
        feedback = Feedback(
            np.array(gains.linear_weight), np.array(gains.linear_stiffness),
            np.array(gains.linear_damping),
        )  # fmt: skip
        terms = self.situation.terms
        return KernelCall(
            linear_task, terms.mass_matrix, self._described, terms.centroidal_matrix,
            self._measured, self._target, feedback, self.rows,
        )  # fmt: skip


@kernel
def linear_task(
    mass_matrix: Array2D,
    described: float,
    matrix: Array2D,
    measured: Centre,
    target: Centre,
    gains: Feedback,
    rows: TaskRows,
) -> None:
    """``linear_rows`` with the mass of the mass matrix, or where that is zero the ``described`` one."""
    mass = mass_matrix[0, 0]
    linear_rows(matrix, mass if mass != 0.0 else described, measured, target, gains, rows)


@kernel
def linear_rows(
    matrix: Array2D, mass: float, measured: Centre, target: Centre, gains: Feedback, rows: TaskRows
) -> None:
    """Three rows for the acceleration of the centre of mass.

    Args:
        matrix: centroidal momentum matrix (6, n_velocities).
        mass: the mass of the robot [kg].
        measured: the measured motion; its ``acceleration`` holds the drift of the momentum [N], of
            which the first three elements are used.
    """
    for i in range(3):
        for k in range(matrix.shape[1]):
            rows.jacobian[i, k] = matrix[i, k] / mass
        rows.desired[i] = (
            float(target.acceleration[i])
            + float(gains.stiffness[i]) * (float(target.position[i]) - float(measured.position[i]))
            + float(gains.damping[i]) * (float(target.velocity[i]) - float(measured.velocity[i]))
            - float(measured.acceleration[i]) / mass
        )
        rows.weights[i] = gains.weight[i]
