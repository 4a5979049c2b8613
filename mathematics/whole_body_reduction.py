"""The whole-body program after the accelerations are eliminated exactly.

For given forces f the base's equations of motion and the tasks of ``whole_body_qp`` determine a; so what
remains is a program in f with the same minimum. With Q = sum_i w_i J_i' J_i + w_a 1, c = sum_i w_i d_i J_i'
and the base's equations M_b a + h_b = B f, B = J_b'::

    Q = U'U,   W = M_b U^-1,   y = U'^-1 c
    S = W W' = R'R,   K = R'^-1 B,   k = R'^-1 (h_b + W y)
    minimise  1/2 f' (K'K + w_f 1) f - k'K f
    a = a_0 + X K f,   a_0 = U^-1 y - X k,   X = U^-1 W' R^-1

Limits on torques tau = M_j a + h_j - J_j' f restrict a as well as f. Where they matter the program
has further unknowns e, one for every joint: a = (as above) + N e with M_b N = 0 and N'Q N = 1, so
they add 1/2 |e|^2 to the cost and nothing else.

The own method solves this program in (f, e). Libraries get it with six more unknowns r = K f - k
(``write_program``)::

    minimise    1/2 |r|^2 + 1/2 |e|^2 + 1/2 w_f |f|^2
    subject to  K f - r = k  and the limits

(e, r) are the accelerations in the coordinates in which the tasks' cost is a sum of squares. The program in
(a, f) has a condition number of 1e7, and K'K squares that of K; this one has neither, so it is solved
more exactly.

Matrices are stored by rows, so that inner loops run along memory; in the records below W, X and N
are transposed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .active_set import QuadraticProgram
from .arrays import Array1D, Array2D, Indices1D
from .kernel import kernel
from .linear_algebra import (
    factorise,
    solve_each_transposed,
    solve_each_upper,
    solve_rows_transposed,
    solve_transposed,
    solve_upper,
)
from .whole_body_qp import (
    ILL_POSED,
    NO_CONTACT,
    NO_LIMITS,
    PYRAMID_ROWS,
    SOLVED,
    WholeBodyProgram,
    WholeBodySolution,
    friction_rows,
    limit_torques,
    torque_rows,
)


class Reduction(NamedTuple):
    """The matrices of the elimination, for n velocities, 6 of the base, and up to m force elements.

    The points in stance are the first ``n_active`` (1,) of ``active`` (n_contacts,). As in the module's
    equations: ``factor`` U (n, n), ``base`` W (6, n), ``y`` (n,), ``R`` (6, 6), ``K`` (6, m), ``k_0`` the vector k
    (6,), ``X_t`` X' (6, n), ``a_0`` the acceleration without forces (n,), ``multiplier`` (6,) of the equations of
    motion of the base, ``N_t`` N' (n - 6, n), ``reflections`` (6, n) the Householder vectors that make N,
    ``torque_map`` (n - 6, m + n) and ``torque_rest`` (n - 6,) the torques as an affine function of f, e and
    X' a.
    """

    active: Indices1D
    n_active: Indices1D
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


def reduction_memory(n: int, n_contacts: int) -> Reduction:
    """Zeroed memory for n velocities and this number of contact points."""
    m = 3 * n_contacts
    shapes = (
        (n, n), (6, n), n, (6, 6), (6, m), 6, (6, n), n, 6, (n - 6, n), (6, n), (n - 6, m + n), n - 6,
    )  # fmt: skip
    indices = np.zeros(n_contacts, np.int64), np.zeros(1, np.int64)
    return Reduction(*indices, *(np.zeros(shape) for shape in shapes))


class EqualityProgram(NamedTuple):
    """The program in (f, e, r), in arrays that may be larger: its cost and ``limits``, and K f - r = k as
    ``matrix`` (6, n) and ``bound`` (6,). ``size`` (2,) are the numbers of unknowns and of rows of ``limits``."""

    limits: QuadraticProgram
    matrix: Array2D
    bound: Array1D
    size: Indices1D


def equality_program(n: int, n_contacts: int) -> EqualityProgram:
    """Zeroed memory for n velocities and this number of contact points."""
    size, rows = 3 * n_contacts + n, PYRAMID_ROWS * n_contacts + 2 * (n - 6)
    limits = QuadraticProgram(
        np.zeros((size, size)), np.zeros(size), np.zeros((rows, size)), np.zeros(rows)
    )
    return EqualityProgram(limits, np.zeros((6, size)), np.zeros(6), np.zeros(2, np.int64))


@kernel
def reduce_program(
    program: WholeBodyProgram, reduction: Reduction, solution: WholeBodySolution
) -> None:
    """Eliminate the accelerations and compute the torques' limits of this tick.

    Where there is nothing to solve, ``n_active`` becomes 0 and ``solution.code`` the reason.
    """
    count = 0
    for point in range(program.stance.shape[0]):
        if program.stance[point]:
            reduction.active[count] = point
            count += 1
    reduction.n_active[0] = count
    if count == 0:
        solution.code[0] = NO_CONTACT
        return
    if not eliminate(program, reduction):
        reduction.n_active[0] = 0
        solution.code[0] = ILL_POSED
        return
    if program.motors.kind != NO_LIMITS:
        limit_torques(program.joint_velocity, program.motors)


@kernel
def eliminate(program: WholeBodyProgram, reduction: Reduction) -> bool:
    """Compute everything in ``reduction`` but N and the torques. Returns whether it can be done."""
    factor, y, base = reduction.factor, reduction.y, reduction.base
    tasks, terms, n = program.tasks, program.terms, y.shape[0]
    active, count = reduction.active, reduction.n_active[0]
    for i in range(n):
        y[i] = 0.0
        for k in range(n):
            factor[i, k] = 0.0
        factor[i, i] = program.weights.acceleration[0]
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
    solve_each_transposed(factor, base)
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
    solve_each_upper(factor, X_t)
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
    force_weight: float, reduction: Reduction, extra: int, qp: QuadraticProgram
) -> None:
    """Write the cost in f and the first ``extra`` elements of e."""
    hessian, gradient, size = qp.hessian, qp.gradient, 3 * reduction.n_active[0]
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
    program: WholeBodyProgram, reduction: Reduction, extra: int, unknowns: Array1D, out: Array1D
) -> None:
    """Compute the gradient of the cost: w_f f + B'R^-1 (K f - k), then e; (3 n_active + extra,).

    It has no rounding errors along forces that do not move the base, where only w_f decides and
    K'K + w_f 1 has lost most of its digits.
    """
    terms, active, count = program.terms, reduction.active, reduction.n_active[0]
    force_weight = program.weights.force[0]
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
    solve_each_upper(reduction.factor, N_t)


@kernel
def reflect(mirror: Array1D, vector: Array1D) -> None:
    """Replace x by x - v (v'x), a reflection where v has the length sqrt(2)."""
    total = 0.0
    for i in range(vector.shape[0]):
        total += mirror[i] * vector[i]
    vector[:] = vector - total * mirror


@kernel
def map_torques(program: WholeBodyProgram, reduction: Reduction) -> None:
    """Compute the joint torques as an affine function of f, e and s, with a = a_0 + N e + X s."""
    terms, torque_map, torque_rest = program.terms, reduction.torque_map, reduction.torque_rest
    joints, n, size = torque_rest.shape[0], reduction.a_0.shape[0], 3 * reduction.n_active[0]
    for j in range(joints):
        torque = terms.nonlinear[6 + j]
        for i in range(n):
            torque += terms.mass_matrix[6 + j, i] * reduction.a_0[i]
        torque_rest[j] = torque
        for i in range(size):
            torque_map[j, i] = -terms.jacobian[reduction.active[i // 3], i % 3, 6 + j]
        for k in range(joints):
            total = 0.0
            for i in range(n):
                total += terms.mass_matrix[6 + j, i] * reduction.N_t[k, i]
            torque_map[j, size + k] = total
        for k in range(6):
            total = 0.0
            for i in range(n):
                total += terms.mass_matrix[6 + j, i] * reduction.X_t[k, i]
            torque_map[j, size + joints + k] = total


@kernel
def limit_rows(
    program: WholeBodyProgram, reduction: Reduction, extra: int, qp: QuadraticProgram
) -> int:
    """Write the rows of friction in f, and with ``extra`` unknowns e also those of torque; return
    their number."""
    size, K, torque_map = 3 * reduction.n_active[0], reduction.K, reduction.torque_map
    n, count = size + extra, reduction.n_active[0]
    rows = friction_rows(count, n, program.weights, qp.matrix, qp.bound)
    if extra > 0:
        map_torques(program, reduction)
        for j in range(extra):
            for k in range(6):
                for i in range(size):
                    torque_map[j, i] = torque_map[j, i] + torque_map[j, n + k] * K[k, i]
        rest = reduction.torque_rest
        rows = torque_rows(program.motors, n, torque_map, rest, rows, qp.matrix, qp.bound)
    return rows


@kernel
def write_program(program: WholeBodyProgram, reduction: Reduction, whole: EqualityProgram) -> None:
    """Write the program in (f, e, r); ``reduction`` is that of this tick, with a point in
    stance."""
    limits, count, joints = whole.limits, reduction.n_active[0], reduction.torque_rest.shape[0]
    first = 3 * count + joints  # of r
    n = first + 6
    for i in range(n):
        limits.gradient[i] = 0.0
        for k in range(n):
            limits.hessian[i, k] = 0.0
        limits.hessian[i, i] = program.weights.force[0] if i < 3 * count else 1.0
    for k in range(6):
        for i in range(n):
            whole.matrix[k, i] = reduction.K[k, i] if i < 3 * count else 0.0
        whole.matrix[k, first + k] = -1.0
        whole.bound[k] = reduction.k_0[k]
    rows = friction_rows(count, n, program.weights, limits.matrix, limits.bound)
    free_motions(reduction)
    if program.motors.kind != NO_LIMITS:
        map_torques(program, reduction)
        torque_map, rest = reduction.torque_map, reduction.torque_rest
        for j in range(joints):
            for k in range(6):
                rest[j] = rest[j] + torque_map[j, first + k] * reduction.k_0[k]  # s = r + k
        rows = torque_rows(program.motors, n, torque_map, rest, rows, limits.matrix, limits.bound)
    whole.size[0], whole.size[1] = n, rows


@kernel
def recover_motion(
    program: WholeBodyProgram,
    reduction: Reduction,
    extra: int,
    unknowns: Array1D,
    solution: WholeBodySolution,
) -> None:
    """Compute the accelerations and the joint torques (paper, opt_torque) for f and ``extra``
    elements of e."""
    recover_acceleration(reduction, extra, unknowns, solution.acceleration)
    recover_torque(program, reduction, solution.acceleration, unknowns, solution.torque)


@kernel
def recover_acceleration(reduction: Reduction, extra: int, unknowns: Array1D, out: Array1D) -> None:
    """Compute the acceleration a_0 + X K f + N e (n,) for ``extra`` elements of e."""
    X_t, K, N_t, size = reduction.X_t, reduction.K, reduction.N_t, 3 * reduction.n_active[0]
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
    program: WholeBodyProgram,
    reduction: Reduction,
    acceleration: Array1D,
    force: Array1D,
    torque: Array1D,
) -> None:
    """Compute the joint torques M_j a + h_j - J_j' f (n_joints,) [N m] for the forces of the points
    in stance."""
    terms = program.terms
    for j in range(torque.shape[0]):
        total = terms.nonlinear[6 + j]
        for i in range(acceleration.shape[0]):
            total += terms.mass_matrix[6 + j, i] * acceleration[i]
        for point in range(reduction.n_active[0]):
            for axis in range(3):
                row = reduction.active[point]
                total -= terms.jacobian[row, axis, 6 + j] * force[3 * point + axis]
        torque[j] = total


@kernel
def write_forces(
    code: int, reduction: Reduction, unknowns: Array1D, solution: WholeBodySolution
) -> None:
    """Write the forces of the points in stance, zeros for the others, and SOLVED; or a failure's code."""
    if code < 0:
        solution.code[0] = code
        return
    for point in range(solution.force.shape[0]):
        solution.force[point, :] = 0.0
    for j in range(reduction.n_active[0]):
        for axis in range(3):
            solution.force[reduction.active[j], axis] = unknowns[3 * j + axis]
    solution.code[0] = SOLVED


@kernel
def recover_solution(
    program: WholeBodyProgram, reduction: Reduction, unknowns: Array1D, solution: WholeBodySolution
) -> None:
    """Compute the solution of the program in (f, e, r)."""
    recover_motion(program, reduction, reduction.torque_rest.shape[0], unknowns, solution)
    write_forces(SOLVED, reduction, unknowns, solution)
