"""The whole-body controller's program: its data, its limits and its solution.

The unknowns are the generalised acceleration a (n_velocities) and the forces f on the points in
stance (3 each, world). Tasks are rows J a = d, each with a weight; the program is

    minimise    sum_i w_i (J_i a - d_i)^2 + w_a |a|^2 + w_f |f|^2
    subject to  M_b a + h_b - J_b' f = 0          (the six rows of the floating base)
                |f_x| <= mu f_z, |f_y| <= mu f_z  (friction; with round cones |f_t| <= mu f_z)
                force_min <= f_z <= force_max
                lower <= T tau <= upper           (torque limits), tau = M_j a + h_j - J_j' f

which is the paper's problem (section V, wbc_qp). ``whole_body_reduction`` eliminates a. Kernels write
into arrays that their caller owns and allocate nothing.
"""

from __future__ import annotations

from typing import NamedTuple

from .arrays import Array1D, Array2D, Array3D, Flags1D, Indices1D, Rows3
from .kernel import kernel

PYRAMID_ROWS = 6
"""Inequality rows of a point in stance: four of its pyramid, two bounds of its normal force."""

NO_CONTACT = 0
"""Result where no point is in stance: nothing to solve."""
SOLVED = 1
ILL_POSED = -4
"""The terms or the tasks are not finite, or leave no positive definite matrix."""
NOT_FOUND = -5
"""A library's solver found no solution."""

NO_LIMITS, JOINT_LIMITS, MOTOR_LIMITS = 0, 1, 2
"""Kinds of torque limits."""


class TaskRows(NamedTuple):
    """Rows of J a = d: ``jacobian`` (n, n_velocities), ``desired`` (n,), ``weights`` (n,)."""

    jacobian: Array2D
    desired: Array1D
    weights: Array1D


class RigidBodyTerms(NamedTuple):
    """The equation of motion M a + h = S' tau + sum J_c' f_c of a robot with a floating base.

    ``mass_matrix`` (n_velocities square), ``nonlinear`` h (n_velocities,) and ``jacobian`` of the
    contact points (n_contacts, 3, n_velocities).
    """

    mass_matrix: Array2D
    nonlinear: Array1D
    jacobian: Array3D


class ProgramWeights(NamedTuple):
    """Numbers that may change during a run, each an array of one element.

    ``acceleration`` w_a and ``force`` w_f are weights, ``friction`` is mu, and ``force_min`` and
    ``force_max`` [N] bound the normal force of a point.
    """

    acceleration: Array1D
    force: Array1D
    friction: Array1D
    force_min: Array1D
    force_max: Array1D


class TorqueLimits(NamedTuple):
    """The limits of the torques, those of motors or of joints, (n,) each.

    ``kind`` is NO_LIMITS, JOINT_LIMITS or MOTOR_LIMITS. A motor has its ``peak`` torque [N m] up to the
    ``corner`` speed [rad/s]; from there the torque falls linearly to zero at the ``no_load`` speed
    [rad/s]; of the three there are left the shares ``peak_share``, ``corner_share`` and ``no_load_share``. At the present ``speed`` the torques must be within ``lower`` and ``upper``. ``to_speed`` and
    ``to_torque`` T (n, n) are products with joint velocities and joint torques; ``to_torque`` is the
    identity where joints are limited.
    """

    kind: int
    to_speed: Array2D
    to_torque: Array2D
    peak: Array1D
    corner: Array1D
    no_load: Array1D
    peak_share: Array1D
    corner_share: Array1D
    no_load_share: Array1D
    speed: Array1D
    lower: Array1D
    upper: Array1D


class WholeBodyProgram(NamedTuple):
    """The data of a tick's program: ``stance`` (n_contacts,) are the points in stance, and
    ``joint_velocity`` (n_joints,) [rad/s] is that at which the motors' limits are taken."""

    tasks: TaskRows
    terms: RigidBodyTerms
    stance: Flags1D
    joint_velocity: Array1D
    weights: ProgramWeights
    motors: TorqueLimits


class WholeBodySolution(NamedTuple):
    """The result: torques (n_joints,), accelerations (n,), forces (n_contacts, 3); ``code`` (1,).

    ``code`` is SOLVED, NO_CONTACT, ILL_POSED, NOT_FOUND or a negative code of ``active_set``. Only with
    SOLVED the others are of use.
    """

    torque: Array1D
    acceleration: Array1D
    force: Rows3
    code: Indices1D


@kernel
def friction_rows(
    count: int, n: int, weights: ProgramWeights, matrix: Array2D, bound: Array1D
) -> int:
    """``PYRAMID_ROWS`` rows of n elements for each of ``count`` points (paper, cone), whose forces are
    the first unknowns: |f_x| <= mu f_z, |f_y| <= mu f_z, force_min <= f_z <= force_max.

    Returns the number of rows.
    """
    for row in range(PYRAMID_ROWS * count):
        for k in range(n):
            matrix[row, k] = 0.0
        bound[row] = 0.0
    for j in range(count):
        row, column = PYRAMID_ROWS * j, 3 * j
        for k in range(2):
            matrix[row + 2 * k, column + k], matrix[row + 2 * k + 1, column + k] = 1.0, -1.0
        for k in range(4):
            matrix[row + k, column + 2] = -weights.friction[0]
        matrix[row + 4, column + 2], bound[row + 4] = 1.0, weights.force_max[0]
        matrix[row + 5, column + 2], bound[row + 5] = -1.0, -weights.force_min[0]
    return PYRAMID_ROWS * count


@kernel
def torque_rows(
    motors: TorqueLimits,
    n: int,
    torque_map: Array2D,
    torque_rest: Array1D,
    first: int,
    matrix: Array2D,
    bound: Array1D,
) -> int:
    """Two rows for each limited torque, from row ``first`` on; returns the number of rows in all.

    Args:
        n: the number of unknowns.
        torque_map: with ``torque_rest`` the joint torques as an affine function of the unknowns.
    """
    joints = torque_rest.shape[0]
    for motor in range(joints):
        high, low = first + motor, first + joints + motor
        for i in range(n):
            matrix[high, i] = 0.0
        torque = 0.0
        for j in range(joints):
            share = motors.to_torque[motor, j]
            if share != 0.0:
                torque += share * torque_rest[j]
                for i in range(n):
                    matrix[high, i] = matrix[high, i] + share * torque_map[j, i]
        for i in range(n):
            matrix[low, i] = -matrix[high, i]
        bound[high] = motors.upper[motor] - torque
        bound[low] = torque - motors.lower[motor]
    return int(first + 2 * joints)


@kernel
def within_limits(torque: Array1D, motors: TorqueLimits) -> bool:
    """Return whether torques (n_joints,) [N m] keep their limits, up to 1e-10 N m."""
    for motor in range(torque.shape[0]):
        total = 0.0
        for j in range(torque.shape[0]):
            total += motors.to_torque[motor, j] * torque[j]
        if total > motors.upper[motor] + 1e-10:
            return False
        if total < motors.lower[motor] - 1e-10:
            return False
    return True


@kernel
def limit_torques(joint_velocity: Array1D, motors: TorqueLimits) -> None:
    """Compute the bounds on the torques: of motors at their present speed, or of joints at any
    speed."""
    for i in range(motors.speed.shape[0]):
        if motors.kind == JOINT_LIMITS:
            motors.upper[i] = motors.peak[i] * motors.peak_share[i]
            motors.lower[i] = -motors.upper[i]
            continue
        total = 0.0
        for j in range(joint_velocity.shape[0]):
            total += motors.to_speed[i, j] * joint_velocity[j]
        motors.speed[i] = total
    if motors.kind == MOTOR_LIMITS:
        motor_limits(motors)


@kernel
def motor_limits(motors: TorqueLimits) -> None:
    """Compute the bounds of each motor's torque at its speed.

    The driving torque follows the torque-speed curve; the braking torque is ``peak`` at any speed.
    """
    for i in range(motors.speed.shape[0]):
        value, peak = motors.speed[i], motors.peak[i] * motors.peak_share[i]
        corner = motors.corner[i] * motors.corner_share[i]
        no_load = motors.no_load[i] * motors.no_load_share[i]
        share = (no_load - abs(value)) / max(no_load - corner, 1e-9)
        driving = peak * min(max(share, 0.0), 1.0)
        motors.upper[i] = driving if value > 0.0 else peak
        motors.lower[i] = -driving if value < 0.0 else -peak
