"""The whole-body controller's quadratic program as pure functions over arrays.

The unknowns are the generalised acceleration a (n_velocities) and the forces f on the points in
stance (3 each, world). Tasks are rows J a = d, each with a weight; the program is

    minimise    sum_i w_i (J_i a - d_i)^2 + w_a |a|^2 + w_f |f|^2
    subject to  M_b a + h_b - J_b' f = 0        (the six rows of the floating base)
                G [a; f] <= b                   (friction pyramids, force and torque limits)

which is the paper's problem (section V, wbc_qp). Every function writes into arrays that its caller
owns and allocates nothing. Arrays that belong together are passed as a named tuple, which the
caller makes once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arrays import Array1D, Array2D, Array3D, Indices1D, Rows3
from .kernel import kernel

PYRAMID_ROWS = 6
"""Inequality rows of a point in stance: four of its pyramid, two bounds of its normal force."""


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


class Cost(NamedTuple):
    """1/2 x' hessian x + gradient' x over x = [a; f]."""

    hessian: Array2D
    gradient: Array1D


class CostScratch(NamedTuple):
    """Memory for intermediate results of ``assemble_cost``: (n_rows, n_v), (n_v, n_v), (n_v,)."""

    weighted: Array2D
    block: Array2D
    vector: Array1D


class Constraints(NamedTuple):
    """Rows of ``matrix`` x = ``bound``, or of ``matrix`` x <= ``bound``."""

    matrix: Array2D
    bound: Array1D


class TorqueScratch(NamedTuple):
    """Memory for intermediate results of ``torque_limits``: (n_joints, n_x) twice, (n_joints,)."""

    rows: Array2D
    product: Array2D
    offset: Array1D


class TorqueLimits(NamedTuple):
    """The limits of the torques, those of motors or of joints, (n,) each.

    A motor has its ``peak`` torque [N m] up to the ``corner`` speed [rad/s]; from there the torque
    falls linearly to zero at the ``no_load`` speed [rad/s]. At the present ``speed`` the torques must
    be within ``lower`` and ``upper``. ``to_speed`` and ``to_torque`` (n, n) are products with joint
    velocities and joint torques; ``to_torque`` is the identity where joints are limited.
    """

    to_speed: Array2D
    to_torque: Array2D
    peak: Array1D
    corner: Array1D
    no_load: Array1D
    speed: Array1D
    lower: Array1D
    upper: Array1D


@kernel
def assemble_cost(
    tasks: TaskRows,
    acceleration_weight: float,
    force_weight: float,
    scratch: CostScratch,
    cost: Cost,
) -> None:
    """The cost: the tasks' weighted squared errors plus the two regularisation terms."""
    n = tasks.jacobian.shape[1]
    for i in range(tasks.jacobian.shape[0]):
        np.multiply(tasks.jacobian[i], tasks.weights[i], scratch.weighted[i])
    np.dot(tasks.jacobian.T, scratch.weighted, scratch.block)
    np.dot(scratch.weighted.T, tasks.desired, scratch.vector)
    cost.hessian[:, :] = 0.0
    cost.hessian[0:n, 0:n] = scratch.block
    cost.gradient[:] = 0.0
    np.negative(scratch.vector, cost.gradient[0:n])
    for i in range(n):
        cost.hessian[i, i] += acceleration_weight
    for i in range(n, cost.hessian.shape[0]):
        cost.hessian[i, i] = force_weight


@kernel
def base_dynamics(terms: RigidBodyTerms, active: Indices1D, rows: Constraints) -> None:
    """The six equations of motion of the floating base (paper, base_dyn): matrix x = bound.

    Args:
        active: the points in stance, in the order of their forces in x.
    """
    n = terms.mass_matrix.shape[0]
    rows.matrix[:, 0:n] = terms.mass_matrix[0:6, :]
    np.negative(terms.nonlinear[0:6], rows.bound)
    for j in range(active.shape[0]):
        point = active[j]
        for k in range(3):
            np.negative(terms.jacobian[point, k, 0:6], rows.matrix[:, n + 3 * j + k])


@kernel
def friction_pyramids(
    count: int, first: int, friction: float, force_min: float, force_max: float, rows: Constraints
) -> None:
    """``PYRAMID_ROWS`` rows for each of ``count`` points (paper, cone), whose forces begin in
    column ``first``:

    |f_x| <= mu f_z, |f_y| <= mu f_z, force_min <= f_z <= force_max.
    """
    matrix, bound = rows.matrix, rows.bound
    matrix[0 : PYRAMID_ROWS * count, :] = 0.0
    for j in range(count):
        row, column = PYRAMID_ROWS * j, first + 3 * j
        for k in range(2):
            matrix[row + 2 * k, column + k], matrix[row + 2 * k + 1, column + k] = 1.0, -1.0
        for k in range(4):
            matrix[row + k, column + 2] = -friction
            bound[row + k] = 0.0
        matrix[row + 4, column + 2], bound[row + 4] = 1.0, force_max
        matrix[row + 5, column + 2], bound[row + 5] = -1.0, -force_min


@kernel
def torque_limits(
    terms: RigidBodyTerms,
    active: Indices1D,
    motors: TorqueLimits,
    scratch: TorqueScratch,
    rows: Constraints,
) -> None:
    """Rows that keep T tau within its limits, with T = ``motors.to_torque`` and tau affine in x = [a; f].

    Args:
        active: the points in stance, in the order of their forces in x.
        rows: out, (2 n_joints, n_x) and (2 n_joints,).
    """
    n = terms.mass_matrix.shape[0]
    joints = n - 6
    scratch.rows[:, 0:n] = terms.mass_matrix[6:, :]
    for j in range(active.shape[0]):
        point = active[j]
        for k in range(3):
            np.negative(terms.jacobian[point, k, 6:], scratch.rows[:, n + 3 * j + k])
    np.dot(motors.to_torque, scratch.rows, scratch.product)
    np.dot(motors.to_torque, terms.nonlinear[6:], scratch.offset)
    rows.matrix[0:joints, :] = scratch.product
    np.negative(scratch.product, rows.matrix[joints:, :])
    np.subtract(motors.upper, scratch.offset, rows.bound[0:joints])
    np.subtract(scratch.offset, motors.lower, rows.bound[joints:])


@kernel
def motor_limits(motors: TorqueLimits) -> None:
    """The bounds of each motor's torque at its speed.

    The driving torque follows the torque-speed curve; the braking torque is ``peak`` at any speed.
    """
    for i in range(motors.speed.shape[0]):
        value, peak = motors.speed[i], motors.peak[i]
        corner, no_load = motors.corner[i], motors.no_load[i]
        share = (no_load - abs(value)) / max(no_load - corner, 1e-9)
        driving = peak * min(max(share, 0.0), 1.0)
        motors.upper[i] = driving if value > 0.0 else peak
        motors.lower[i] = -driving if value < 0.0 else -peak


@kernel
def joint_torque(
    terms: RigidBodyTerms, acceleration: Array1D, force: Rows3, product: Array1D, torque: Array1D
) -> None:
    """The joint torques, from the joints' rows of the equation of motion (paper, opt_torque):
    tau = M_j a + h_j - sum J_j' f, (n_joints,) [N m].

    Args:
        acceleration: a, the generalised acceleration, (n_velocities,).
        force: f on every contact point [N, world], (n_contacts, 3), zero where there is none.
        product: scratch (n_joints,).
    """
    np.dot(terms.mass_matrix[6:, :], acceleration, torque)
    np.add(torque, terms.nonlinear[6:], torque)
    for i in range(force.shape[0]):
        for k in range(3):
            np.multiply(terms.jacobian[i, k, 6:], force[i, k], product)
            np.subtract(torque, product, torque)


@kernel
def share_weight(stance: NDArray[np.bool_], weight: float, force: Array2D) -> None:
    """Share the robot's weight [N] equally among the points in stance, as upward forces."""
    force[:, :] = 0.0
    loaded = 0
    for i in range(stance.shape[0]):
        loaded += 1 if stance[i] else 0
    for i in range(stance.shape[0]):
        if stance[i]:
            force[i, 2] = weight / loaded
