"""The whole-body program in the contact forces alone: accelerations and torques eliminated exactly.

The program of ``whole_body_qp`` in x = [a; f] has the equations of motion of the base as equality
constraints. For given forces f these and the tasks determine a; so what remains is a program in f
with the same minimum. With Q = sum_i w_i J_i' J_i + w_a 1, c = sum_i w_i d_i J_i' and the base's
equations M_b a + h_b = B f, B = J_b'::

    Q = U'U,   W = M_b U^-1,   y = U'^-1 c
    S = W W' = R'R,   K = R'^-1 B,   k = R'^-1 (h_b + W y)
    minimise  1/2 f' (K'K + w_f 1) f - k'K f
    a = U^-1 y + X (K f - k),   X = U^-1 W' R^-1

Limits on torques tau = M_j a + h_j - J_j' f restrict a as well as f. Where they matter the program
has further unknowns e, one for every joint: a = (as above) + N e with M_b N = 0 and N'Q N = 1, so
they add 1/2 |e|^2 to the cost and nothing else.

Matrices are stored by rows, so that inner loops run along memory; in the records below W, X and N
are transposed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array1D, Array2D, Indices1D
from .kernel import kernel
from .linear_algebra import factorise, solve_rows_transposed, solve_transposed, solve_upper
from .whole_body_qp import RigidBodyTerms, TaskRows, TorqueLimits


class Reduction(NamedTuple):
    """The matrices of the elimination, for n velocities, 6 of the base, and up to m force elements.

    As in the module's equations: ``factor`` U (n, n), ``base`` W (6, n), ``y`` (n,), ``R`` (6, 6), ``K`` (6, m),
    ``k_0`` the vector k (6,), ``X_t`` X' (6, n), ``a_0`` the acceleration without forces (n,), ``multiplier`` (6,) of
    the equations of motion of the base, ``N_t`` N' (n - 6, n), ``reflections`` (6, n) the Householder vectors that make
    N, ``torque_map`` (n - 6, m + n - 6) and ``torque_rest`` (n - 6,) the torques as an affine function of f and e.
    """

    factor: Array2D
    base: Array2D
    y: Array1D
    R: Array2D
    K: Array2D
    k_0: Array1D
    X_t: Array2D
    a_0: Array1D
    multiplier: Array1D
    N_t: Array2D
    reflections: Array2D
    torque_map: Array2D
    torque_rest: Array1D


def reduction_memory(n: int, m: int) -> Reduction:
    """Zero memory for n velocities and up to m elements of force."""
    shapes = (
        (n, n), (6, n), n, (6, 6), (6, m), 6, (6, n), n, 6, (n - 6, n), (6, n),
        (n - 6, m + n - 6), n - 6,
    )  # fmt: skip
    return Reduction(*(np.zeros(shape) for shape in shapes))


@kernel
def eliminate(
    tasks: TaskRows,
    terms: RigidBodyTerms,
    active: Indices1D,
    count: int,
    acceleration_weight: float,
    reduction: Reduction,
) -> bool:
    """Compute everything in ``reduction`` but the torques. Returns whether it can be done.

    Args:
        active: the points in stance, of which the first ``count`` are used.
    """
    factor, y, base = reduction.factor, reduction.y, reduction.base
    n = y.shape[0]
    for i in range(n):
        y[i] = 0.0
        for k in range(n):
            factor[i, k] = 0.0
        factor[i, i] = acceleration_weight
    for row in range(tasks.jacobian.shape[0]):
        weight = tasks.weights[row]
        if weight == 0.0:
            continue
        desired = tasks.desired[row]
        for i in range(n):
            value = weight * tasks.jacobian[row, i]
            if value != 0.0:
                y[i] = y[i] + value * desired
                for k in range(i, n):
                    factor[i, k] = factor[i, k] + value * tasks.jacobian[row, k]
    if not factorise(factor, 0.0):
        return False
    solve_transposed(factor, y)
    for k in range(6):
        for i in range(n):
            base[k, i] = terms.mass_matrix[k, i]
        solve_transposed(factor, base[k])
    R, k_0, K = reduction.R, reduction.k_0, reduction.K
    for k in range(6):
        for j in range(k, 6):
            total = 0.0
            for i in range(n):
                total += base[k, i] * base[j, i]
            R[k, j] = total
        total = terms.nonlinear[k]
        for i in range(n):
            total += base[k, i] * y[i]
        k_0[k] = total
        for j in range(count):
            for axis in range(3):
                K[k, 3 * j + axis] = terms.jacobian[active[j], axis, k]
    if not factorise(R, 0.0):
        return False
    solve_transposed(R, k_0)
    solve_rows_transposed(R, 3 * count, K)
    X_t, a_0 = reduction.X_t, reduction.a_0
    for k in range(6):
        for i in range(n):
            X_t[k, i] = base[k, i]
    solve_rows_transposed(R, n, X_t)
    for k in range(6):
        solve_upper(factor, X_t[k])
    for i in range(n):
        a_0[i] = y[i]
    solve_upper(factor, a_0)
    for k in range(6):
        value = k_0[k]
        for i in range(n):
            a_0[i] = a_0[i] - value * X_t[k, i]
    return True


@kernel
def force_program(
    reduction: Reduction,
    size: int,
    extra: int,
    force_weight: float,
    hessian: Array2D,
    gradient: Array1D,
) -> None:
    """The cost in the first ``size`` elements of force and the first ``extra`` elements of e."""
    K, k_0 = reduction.K, reduction.k_0
    for i in range(size + extra):
        gradient[i] = 0.0
        for j in range(size + extra):
            hessian[i, j] = 0.0
        hessian[i, i] = force_weight if i < size else 1.0
    for k in range(6):
        for i in range(size):
            value = K[k, i]
            gradient[i] = gradient[i] - value * k_0[k]
            for j in range(size):
                hessian[i, j] = hessian[i, j] + value * K[k, j]


@kernel
def force_gradient(
    reduction: Reduction,
    terms: RigidBodyTerms,
    active: Indices1D,
    count: int,
    extra: int,
    force_weight: float,
    unknowns: Array1D,
    out: Array1D,
) -> None:
    """The gradient of the cost: w_f f + B'R^-1 (K f - k), then e; (3 count + extra,).

    It has no rounding errors along forces that do not move the base, where only w_f decides and
    K'K + w_f 1 has lost most of its digits.
    """
    size, multiplier = 3 * count, reduction.multiplier
    for k in range(6):
        total = -reduction.k_0[k]
        for i in range(size):
            total += reduction.K[k, i] * unknowns[i]
        multiplier[k] = total
    solve_upper(reduction.R, multiplier)
    for j in range(count):
        for axis in range(3):
            i = 3 * j + axis
            total = force_weight * unknowns[i]
            for k in range(6):
                total += terms.jacobian[active[j], axis, k] * multiplier[k]
            out[i] = total
    for k in range(size, size + extra):
        out[k] = unknowns[k]


@kernel
def friction_rows(
    count: int,
    extra: int,
    friction: float,
    least: float,
    most: float,
    matrix: Array2D,
    bound: Array1D,
) -> int:
    """Six rows for each point: |f_x| <= mu f_z, |f_y| <= mu f_z, least <= f_z <= most.

    Returns the number of rows.
    """
    for row in range(6 * count):
        for k in range(3 * count + extra):
            matrix[row, k] = 0.0
        bound[row] = 0.0
    for j in range(count):
        row, column = 6 * j, 3 * j
        for k in range(2):
            matrix[row + 2 * k, column + k], matrix[row + 2 * k + 1, column + k] = 1.0, -1.0
        for k in range(4):
            matrix[row + k, column + 2] = -friction
        matrix[row + 4, column + 2], bound[row + 4] = 1.0, most
        matrix[row + 5, column + 2], bound[row + 5] = -1.0, -least
    return 6 * count


@kernel
def free_motions(reduction: Reduction) -> None:
    """Compute N, the accelerations that do not push the base, by reflections (Householder)."""
    reflections, N_t = reduction.reflections, reduction.N_t
    n = reduction.a_0.shape[0]
    for k in range(6):
        for i in range(n):
            reflections[k, i] = reduction.base[k, i]
    for k in range(6):
        square = 0.0
        for i in range(k, n):
            square += reflections[k, i] * reflections[k, i]
        head = reflections[k, k]
        reflections[k, k] = head + math.copysign(math.sqrt(square), head)
        square += reflections[k, k] * reflections[k, k] - head * head
        scale = math.sqrt(2.0 / square) if square > 0.0 else 0.0
        for i in range(k):
            reflections[k, i] = 0.0
        for i in range(k, n):
            reflections[k, i] = reflections[k, i] * scale
        for other in range(k + 1, 6):
            reflect(reflections[k], reflections[other])
    for j in range(n - 6):
        for i in range(n):
            N_t[j, i] = 0.0
        N_t[j, 6 + j] = 1.0
        for k in range(5, -1, -1):
            reflect(reflections[k], N_t[j])
        solve_upper(reduction.factor, N_t[j])


@kernel
def reflect(mirror: Array1D, vector: Array1D) -> None:
    """Replace x by x - v (v'x), a reflection where v has the length sqrt(2)."""
    total = 0.0
    for i in range(vector.shape[0]):
        total += mirror[i] * vector[i]
    vector[:] = vector - total * mirror


@kernel
def torque_rows(
    reduction: Reduction,
    terms: RigidBodyTerms,
    active: Indices1D,
    count: int,
    motors: TorqueLimits,
    first: int,
    matrix: Array2D,
    bound: Array1D,
) -> int:
    """Two rows in [f; e] for each limited torque, from row ``first`` on; returns the number in all."""
    X_t, K, N_t = reduction.X_t, reduction.K, reduction.N_t
    torque_map, torque_rest = reduction.torque_map, reduction.torque_rest
    joints, n, size = torque_rest.shape[0], reduction.a_0.shape[0], 3 * count
    for j in range(joints):
        torque = terms.nonlinear[6 + j]
        for i in range(n):
            torque += terms.mass_matrix[6 + j, i] * reduction.a_0[i]
        torque_rest[j] = torque
        for point in range(count):
            for axis in range(3):
                torque_map[j, 3 * point + axis] = -terms.jacobian[active[point], axis, 6 + j]
        for k in range(6):
            total = 0.0
            for i in range(n):
                total += terms.mass_matrix[6 + j, i] * X_t[k, i]
            for i in range(size):
                torque_map[j, i] = torque_map[j, i] + total * K[k, i]
        for k in range(joints):
            total = 0.0
            for i in range(n):
                total += terms.mass_matrix[6 + j, i] * N_t[k, i]
            torque_map[j, size + k] = total
    for motor in range(joints):
        high, low = first + motor, first + joints + motor
        for i in range(size + joints):
            matrix[high, i] = 0.0
        torque = 0.0
        for j in range(joints):
            share = motors.to_torque[motor, j]
            if share != 0.0:
                torque += share * torque_rest[j]
                for i in range(size + joints):
                    matrix[high, i] = matrix[high, i] + share * torque_map[j, i]
        for i in range(size + joints):
            matrix[low, i] = -matrix[high, i]
        bound[high] = motors.upper[motor] - torque
        bound[low] = torque - motors.lower[motor]
    return int(first + 2 * joints)


@kernel
def within_limits(torque: Array1D, motors: TorqueLimits) -> bool:
    """Whether torques (n_joints,) [N m] keep their limits, up to 1e-10 N m."""
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
def recover_acceleration(
    reduction: Reduction, size: int, extra: int, unknowns: Array1D, out: Array1D
) -> None:
    """The acceleration (n,) for ``size`` elements of force and ``extra`` elements of e."""
    X_t, K, N_t = reduction.X_t, reduction.K, reduction.N_t
    out[:] = reduction.a_0
    for k in range(6):
        value = 0.0
        for i in range(size):
            value += K[k, i] * unknowns[i]
        out[:] = out + value * X_t[k]
    for k in range(extra):
        value = unknowns[size + k]
        out[:] = out + value * N_t[k]


@kernel
def recover_torque(
    terms: RigidBodyTerms,
    active: Indices1D,
    count: int,
    acceleration: Array1D,
    force: Array1D,
    torque: Array1D,
) -> None:
    """The joint torques M_j a + h_j - J_j' f (paper, opt_torque), (n_joints,) [N m].

    Args:
        force: of the first ``count`` points of ``active``, three elements each.
    """
    for j in range(torque.shape[0]):
        total = terms.nonlinear[6 + j]
        for i in range(acceleration.shape[0]):
            total += terms.mass_matrix[6 + j, i] * acceleration[i]
        for point in range(count):
            for axis in range(3):
                total -= terms.jacobian[active[point], axis, 6 + j] * force[3 * point + axis]
        torque[j] = total
