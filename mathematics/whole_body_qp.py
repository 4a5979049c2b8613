"""The whole-body controller's quadratic program as pure functions over arrays.

The unknowns are the generalised acceleration a (n_velocities) and the forces f on the points in
stance (3 each, world). Tasks are rows of J a = d with a weight each; the program is

    minimise    sum_i w_i (J_i a - d_i)^2 + w_a |a|^2 + w_f |f|^2
    subject to  M_b a + h_b - J_b' f = 0        (the six rows of the floating base)
                G [a; f] <= b                   (friction pyramids, force and torque limits)

which is the paper's problem (wbc_qp). Every function writes into arrays its caller owns and
allocates nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernel import kernel
from .rotations import conjugate, logarithm, multiply

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PYRAMID_ROWS = 6
"""Inequality rows of a point in stance: four of its pyramid, two bounds of its normal force."""


@kernel
def contact_tasks(
    jacobian: Array,
    drift: Array,
    position: Array,
    velocity: Array,
    stance: NDArray[np.bool_],
    stance_weight: float,
    stance_damping: float,
    swing_weight: float,
    swing_stiffness: float,
    swing_damping: float,
    rows: Array,
    desired: Array,
    weights: Array,
) -> None:
    """Three rows a contact point: rest in stance, else a fall to the ground under the others.

    Stance (paper, task 1): J a + drift = -damping velocity. Elsewhere the height falls to the
    mean height of the points in stance as a spring and damper would bring it there, and what
    speed it has along the ground is damped.

    Args:
        jacobian, drift, position, velocity: of the points, as in ``DynamicsTerms``.
        stance: the points that carry load.
        rows, desired, weights: out, (3 n, n_velocities), (3 n,) and (3 n,).
    """
    count = stance.shape[0]
    ground, loaded = 0.0, 0
    for i in range(count):
        if stance[i]:
            ground += float(position[i, 2])
            loaded += 1
    ground = ground / loaded if loaded else 0.0
    for i in range(count):
        for k in range(3):
            row = 3 * i + k
            rows[row, :] = jacobian[i, k, :]
            if stance[i]:
                weights[row] = stance_weight
                desired[row] = -stance_damping * float(velocity[i, k]) - float(drift[i, k])
            else:
                weights[row] = swing_weight
                wanted = -swing_damping * float(velocity[i, k])
                if k == 2:
                    wanted += swing_stiffness * (ground - float(position[i, 2]))
                desired[row] = wanted - float(drift[i, k])


@kernel
def lifting_tasks(
    jacobian: Array,
    drift: Array,
    velocity: Array,
    stance: NDArray[np.bool_],
    foot: Indices,
    foot_rotation: Array,
    weight: float,
    damping: float,
    ankle: Indices,
    ankle_acceleration: Array,
    ankle_weight: float,
    rows: Array,
    desired: Array,
    weights: Array,
) -> None:
    """Points that leave the ground before lift-off, over what ``contact_tasks`` wrote for them:
    free to rise, their velocity across the foot damped, so that the foot rolls over its other
    points and does not turn about them. How fast it rolls is the ankle's task: the motion of
    centre of mass and torso leaves it open.

    Args:
        foot: of every point; foot_rotation: from foot to world, (n_feet, 3, 3).
        ankle: the velocity of every foot's last joint; ankle_acceleration: wanted, by foot.
    """
    for i in range(stance.shape[0]):
        if stance[i]:
            continue
        row, wanted = 3 * i, 0.0
        rows[row, :] = 0.0
        for k in range(3):
            across = float(foot_rotation[foot[i], k, 1])
            wanted -= across * (damping * float(velocity[i, k]) + float(drift[i, k]))
            for j in range(rows.shape[1]):
                rows[row, j] += across * float(jacobian[i, k, j])
        desired[row] = wanted
        rows[row + 1, :] = 0.0
        rows[row + 1, ankle[foot[i]]] = 1.0
        desired[row + 1] = ankle_acceleration[foot[i]]
        weights[row], weights[row + 1], weights[row + 2] = weight, ankle_weight, 0.0


@kernel
def linear_task(
    matrix: Array,
    drift: Array,
    mass: float,
    com: Array,
    com_velocity: Array,
    target: Array,
    target_velocity: Array,
    target_acceleration: Array,
    stiffness: Array,
    damping: Array,
    rows: Array,
    desired: Array,
) -> None:
    """Linear momentum (paper, task 2), in m/s^2: the centre of mass accelerates by

    a_ref + K_p (p_ref - p) + K_d (v_ref - v).

    Args:
        matrix, drift: centroidal momentum matrix (6, n_velocities) and drift (6,).
    """
    np.divide(matrix[0:3], mass, rows)
    for i in range(3):
        desired[i] = (
            float(target_acceleration[i])
            + float(stiffness[i]) * (float(target[i]) - float(com[i]))
            + float(damping[i]) * (float(target_velocity[i]) - float(com_velocity[i]))
            - float(drift[i]) / mass
        )


@kernel
def torso_task(
    orientation: Array,
    angular_velocity: Array,
    target: Array,
    target_velocity: Array,
    stiffness: Array,
    damping: Array,
    error: Array,
    quaternion: Array,
    rows: Array,
    desired: Array,
) -> None:
    """Torso orientation (paper, task 3), in rad/s^2 and the body's frame:

    K_p Log(R' R_ref) + K_d (w_ref - w).

    Args:
        orientation, target: quaternions x, y, z, w.
        error, quaternion: scratch (3,) and (4,).
    """
    rows[:, :] = 0.0
    conjugate(orientation, quaternion)
    multiply(quaternion, target, quaternion)
    logarithm(quaternion, error)
    for i in range(3):
        rows[i, 3 + i] = 1.0
        desired[i] = float(stiffness[i]) * float(error[i]) + float(damping[i]) * (
            float(target_velocity[i]) - float(angular_velocity[i])
        )


@kernel
def angular_task(
    matrix: Array,
    drift: Array,
    momentum: Array,
    target: Array,
    target_rate: Array,
    damping: Array,
    track: bool,
    rows: Array,
    desired: Array,
) -> None:
    """Angular momentum (paper, task 4), in N m: its rate is

    -K_d k, the paper's damping, or with ``track`` k_ref' + K_d (k_ref - k).
    """
    rows[:, :] = matrix[3:6]
    for i in range(3):
        wanted = -float(damping[i]) * float(momentum[i])
        if track:
            wanted += float(target_rate[i]) + float(damping[i]) * float(target[i])
        desired[i] = wanted - float(drift[3 + i])


@kernel
def assemble_cost(
    rows: Array,
    desired: Array,
    weights: Array,
    acceleration_weight: float,
    force_weight: float,
    weighted: Array,
    block: Array,
    vector: Array,
    hessian: Array,
    gradient: Array,
) -> None:
    """The cost as 1/2 x' hessian x + gradient' x over x = [a; f].

    Args:
        weighted, block, vector: scratch of shapes (n_rows, n_v), (n_v, n_v) and (n_v,).
    """
    n = rows.shape[1]
    for i in range(rows.shape[0]):
        np.multiply(rows[i], weights[i], weighted[i])
    np.dot(rows.T, weighted, block)
    np.dot(weighted.T, desired, vector)
    hessian[:, :] = 0.0
    hessian[0:n, 0:n] = block
    gradient[:] = 0.0
    np.negative(vector, gradient[0:n])
    for i in range(n):
        hessian[i, i] += acceleration_weight
    for i in range(n, hessian.shape[0]):
        hessian[i, i] = force_weight


@kernel
def base_dynamics(
    mass_matrix: Array,
    nonlinear: Array,
    jacobian: Array,
    active: Indices,
    matrix: Array,
    vector: Array,
) -> None:
    """The six rows of the floating base (paper, base_dyn): matrix x = vector.

    Args:
        active: the points in stance, in the order of their forces in x.
    """
    n = mass_matrix.shape[0]
    matrix[:, 0:n] = mass_matrix[0:6, :]
    np.negative(nonlinear[0:6], vector)
    for j in range(active.shape[0]):
        point = active[j]
        for k in range(3):
            np.negative(jacobian[point, k, 0:6], matrix[:, n + 3 * j + k])


@kernel
def friction_pyramids(
    count: int,
    first: int,
    friction: float,
    force_min: float,
    force_max: float,
    matrix: Array,
    bound: Array,
) -> None:
    """``PYRAMID_ROWS`` rows a point (paper, cone), of forces that begin in column ``first``:

    |f_x| <= mu f_z, |f_y| <= mu f_z, force_min <= f_z <= force_max.
    """
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
    mass_matrix: Array,
    nonlinear: Array,
    jacobian: Array,
    active: Indices,
    transmission: Array,
    lower: Array,
    upper: Array,
    torque_rows: Array,
    torque_offset: Array,
    product: Array,
    matrix: Array,
    bound: Array,
) -> None:
    """Rows that keep T tau between ``lower`` and ``upper``, tau being affine in x = [a; f].

    Args:
        transmission: T, from joint torque to what is limited: motor torque, or the identity.
        torque_rows, torque_offset, product: scratch (n_joints, n_x), (n_joints,) and
            (n_joints, n_x).
        matrix, bound: out, (2 n_joints, n_x) and (2 n_joints,).
    """
    n = mass_matrix.shape[0]
    joints = n - 6
    torque_rows[:, 0:n] = mass_matrix[6:, :]
    for j in range(active.shape[0]):
        point = active[j]
        for k in range(3):
            np.negative(jacobian[point, k, 6:], torque_rows[:, n + 3 * j + k])
    np.dot(transmission, torque_rows, product)
    np.dot(transmission, nonlinear[6:], torque_offset)
    matrix[0:joints, :] = product
    np.negative(product, matrix[joints:, :])
    np.subtract(upper, torque_offset, bound[0:joints])
    np.subtract(torque_offset, lower, bound[joints:])


@kernel
def motor_limits(
    speed: Array, peak: float, corner: float, no_load: float, lower: Array, upper: Array
) -> None:
    """What a motor can do at its speed: ``peak`` up to ``corner``, then linearly to zero at
    ``no_load``; braking torque is ``peak`` at any speed."""
    for i in range(speed.shape[0]):
        value = float(speed[i])
        share = (no_load - abs(value)) / max(no_load - corner, 1e-9)
        driving = peak * min(max(share, 0.0), 1.0)
        upper[i] = driving if value > 0.0 else peak
        lower[i] = -driving if value < 0.0 else -peak


@kernel
def joint_torque(
    mass_matrix: Array,
    nonlinear: Array,
    jacobian: Array,
    acceleration: Array,
    force: Array,
    product: Array,
    torque: Array,
) -> None:
    """The joints' rows of the dynamics (paper, opt_torque): M_j a + h_j - sum J_j' f.

    Args:
        force: on every contact point (n_contacts, 3), zero where there is none.
        product: scratch (n_joints,).
    """
    np.dot(mass_matrix[6:, :], acceleration, torque)
    np.add(torque, nonlinear[6:], torque)
    for i in range(force.shape[0]):
        for k in range(3):
            np.multiply(jacobian[i, k, 6:], force[i, k], product)
            np.subtract(torque, product, torque)


@kernel
def share_weight(stance: NDArray[np.bool_], weight: float, force: Array) -> None:
    """The robot's weight [N] shared equally, straight up, by the points in stance."""
    force[:, :] = 0.0
    loaded = 0
    for i in range(stance.shape[0]):
        loaded += 1 if stance[i] else 0
    for i in range(stance.shape[0]):
        if stance[i]:
            force[i, 2] = weight / loaded
