"""The own method for the whole-body program with round friction cones |f_t| <= mu f_z.

It is ``whole_body_solution`` with other constraints: planes that touch the cones. They are added where the
solution leaves a cone until it does so by little; then Newton steps make it exact.

Two facts make it exact. A plane that touches a cone along a direction u, u'f_t <= mu f_z, holds for all forces
in the cone, so the program with some of these planes in the place of the cones has a lower minimum, and planes
where its solution leaves the cones raise it (outer approximation). And a cone is curved across u only: with the
multiplier p of the cone and r = |f_t|, its curvature in the Lagrangian is p / r (1 - u u'), which maps f_t to
zero. So a Newton step for the cones is the program with this matrix added to the Hessian, the same gradient,
and the plane at the present u; where u no longer changes the conditions of optimality hold. At a cone's apex
the planes themselves are enough, because their normals are in the cone's polar.

References: J. E. Kelley, "The cutting-plane method for solving convex programs", J. SIAM 8, 1960; J. F. Bonnans,
H. Ramirez, "Perturbation analysis of second-order cone programming problems", Mathematical Programming 104,
2005 (the curvature).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .active_set import (
    TOO_LONG,
    ActiveSetMemory,
    QuadraticProgram,
    fulfil,
    polish,
    recompute_multipliers,
    solve_program,
)
from .arrays import Array1D, Array2D, Array3D, Indices1D
from .kernel import kernel
from .whole_body_qp import PYRAMID_ROWS, WholeBodyProgram, WholeBodySolution
from .whole_body_reduction import (
    Reduction,
    force_gradient,
    force_program,
    limit_rows,
    recover_motion,
    write_forces,
)
from .whole_body_solution import ActiveSetProgram, exceeds_limits

PLANES = 8
"""Planes of a cone at the same time, besides those of its pyramid. At most three are active."""
APEX = 1e-6
"""A force is at its cone's apex if its tangential part is less than this [N]."""
NEAR = 2e-2
"""Planes closer to each other than this [rad] are one plane in a Newton step. The active-set method fulfils a
plane up to 1e-10 N, so it cannot tell apart two that differ by less than the root of that, and would choose
any."""


class Cones(NamedTuple):
    """The planes of the cones, and what a Newton step has of them.

    ``planes`` (n_contacts, PLANES, 2) are unit vectors u in the order of their rows, the first ``used``
    (n_contacts,) of them; ``direction`` (n_contacts, 2) is u, ``curvature`` (n_contacts,) is p / r.
    """

    planes: Array3D
    used: Indices1D
    direction: Array2D
    curvature: Array1D


def cone_memory(n_contacts: int) -> Cones:
    """Zeroed memory for this number of cones."""
    return Cones(
        np.zeros((n_contacts, PLANES, 2)), np.zeros(n_contacts, np.int64),
        np.zeros((n_contacts, 2)), np.zeros(n_contacts),
    )  # fmt: skip


@kernel
def write_planes(
    count: int, n: int, first: int, friction: float, cones: Cones, program: QuadraticProgram
) -> int:
    """Rows for all planes of ``count`` cones, from row ``first`` on; zero where there is none yet.

    Returns the number of rows in all.
    """
    for point in range(count):
        for k in range(PLANES):
            row = first + PLANES * point + k
            program.bound[row] = 0.0
            for i in range(n):
                program.matrix[row, i] = 0.0
            if k < cones.used[point]:
                program.matrix[row, 3 * point] = cones.planes[point, k, 0]
                program.matrix[row, 3 * point + 1] = cones.planes[point, k, 1]
                program.matrix[row, 3 * point + 2] = -friction
    return first + PLANES * count


@kernel
def add_plane(
    point: int,
    first: int,
    friction: float,
    cones: Cones,
    program: QuadraticProgram,
    memory: ActiveSetMemory,
) -> None:
    """Add a plane along the cone's ``direction``. Where all are in use, it takes the place of the
    one that is not active and farthest from it."""
    x, y = cones.direction[point, 0], cones.direction[point, 1]
    place = cones.used[point]
    if place < PLANES:
        cones.used[point] = place + 1
    else:
        place, nearest = 0, 2.0
        for k in range(PLANES):
            near = x * cones.planes[point, k, 0] + y * cones.planes[point, k, 1]
            if near < nearest and not memory.is_active[first + PLANES * point + k]:
                place, nearest = k, near
    row = first + PLANES * point + place
    cones.planes[point, place, 0], cones.planes[point, place, 1] = x, y
    program.matrix[row, 3 * point], program.matrix[row, 3 * point + 1] = x, y
    program.matrix[row, 3 * point + 2] = -friction
    memory.size[row] = math.sqrt(1.0 + friction * friction)


@kernel
def set_force_direction(point: int, x: Array1D, cones: Cones) -> float:
    """Make a cone's ``direction`` that of its tangential force; returns the size of that [N]. At the
    apex it returns zero, and the direction stays."""
    a, b = x[3 * point], x[3 * point + 1]
    size = math.sqrt(a * a + b * b)
    if size <= APEX:
        return 0.0
    cones.direction[point, 0], cones.direction[point, 1] = a / size, b / size
    return size


@kernel
def add_violated_planes(
    count: int,
    first: int,
    friction: float,
    tolerance: float,
    cones: Cones,
    program: QuadraticProgram,
    memory: ActiveSetMemory,
    x: Array1D,
) -> int:
    """Add a plane where a force has left its cone by more than that share; returns how many."""
    added = 0
    for point in range(count):
        size = set_force_direction(point, x, cones)
        outside = size - friction * x[3 * point + 2] > tolerance * size
        if size > 0.0 and outside:
            add_plane(point, first, friction, cones, program, memory)
            added += 1
    return added


@kernel
def refresh_support_planes(
    count: int, friction: float, tolerance: float, cones: Cones, x: Array1D
) -> None:
    """Have a plane along every force that presses its cone or has left it by more than that share, and
    no other plane near it. The rows of the program are not changed."""
    for point in range(count):
        size = set_force_direction(point, x, cones)
        outside = size - friction * x[3 * point + 2] > tolerance * size
        if size == 0.0 or not (cones.curvature[point] > 0.0 or outside):
            continue
        a, b = cones.direction[point, 0], cones.direction[point, 1]
        kept, farthest, least = 0, 0, 2.0
        for k in range(cones.used[point]):
            c, d = cones.planes[point, k, 0], cones.planes[point, k, 1]
            near = a * c + b * d
            if near > 0.0 and abs(a * d - b * c) < NEAR:
                continue
            if near < least:
                farthest, least = kept, near
            cones.planes[point, kept, 0], cones.planes[point, kept, 1] = c, d
            kept += 1
        place = kept if kept < PLANES else farthest
        cones.planes[point, place, 0], cones.planes[point, place, 1] = a, b
        cones.used[point] = min(kept + 1, PLANES)


@kernel
def multiplier_curvature(
    count: int, active: int, first: int, cones: Cones, memory: ActiveSetMemory, x: Array1D
) -> None:
    """Compute ``direction`` and ``curvature`` from a solution and its ``active`` multipliers.

    The multiplier of a cone is the sum of those of its planes, the pyramid's among them.
    """
    for point in range(count):
        cones.curvature[point] = 0.0
    for j in range(active):
        row = memory.active[j]
        if row >= first:
            point = (row - first) // PLANES
        elif row < PYRAMID_ROWS * count and row % PYRAMID_ROWS < 4:
            point = row // PYRAMID_ROWS
        else:
            continue
        cones.curvature[point] = cones.curvature[point] + memory.multipliers[j]
    for point in range(count):
        size = set_force_direction(point, x, cones)
        pressure = max(cones.curvature[point], 0.0)
        cones.curvature[point] = pressure / size if size > 0.0 else 0.0


@kernel
def add_curvature(count: int, cones: Cones, hessian: Array2D) -> None:
    """Add p / r (1 - u u') of every cone to the Hessian."""
    for point in range(count):
        value, i = cones.curvature[point], 3 * point
        a, b = cones.direction[point, 0], cones.direction[point, 1]
        hessian[i, i] = hessian[i, i] + value * b * b
        hessian[i + 1, i + 1] = hessian[i + 1, i + 1] + value * a * a
        hessian[i, i + 1] = hessian[i, i + 1] - value * a * b
        hessian[i + 1, i] = hessian[i + 1, i] - value * a * b


@kernel
def add_bending(count: int, cones: Cones, x: Array1D, gradient: Array1D) -> None:
    """Add p / r (1 - u u') f_t of every cone to the gradient."""
    for point in range(count):
        i = 3 * point
        a, b = cones.direction[point, 0], cones.direction[point, 1]
        across = cones.curvature[point] * (a * x[i + 1] - b * x[i])
        gradient[i] = gradient[i] - across * b
        gradient[i + 1] = gradient[i + 1] + across * a


@kernel
def turned(count: int, friction: float, cones: Cones, x: Array1D) -> float:
    """Return the distance of the solution from its cones: the largest angle [rad] between a pressed
    cone's ``direction`` and its force, or share by which a force leaves its cone."""
    worst = 0.0
    for point in range(count):
        a, b = x[3 * point], x[3 * point + 1]
        size = math.sqrt(a * a + b * b)
        if size <= APEX:
            continue
        worst = max(worst, (size - friction * x[3 * point + 2]) / size)
        if cones.curvature[point] > 0.0:
            across = cones.direction[point, 0] * b - cones.direction[point, 1] * a
            along = cones.direction[point, 0] * a + cones.direction[point, 1] * b
            worst = max(worst, abs(across) / size if along > 0.0 else 2.0)
    return worst


CUTS = 60
"""The most rounds in which planes are added, in each approach."""
STEPS = 12
"""The most Newton steps after each approach."""
APPROACHES = 4
"""Number of times that planes are added again, each time until forces leave their cones by a
hundredth of the previous share, where Newton's steps do not converge."""
FIRST = 3e-2
"""The share by which forces may leave their cones before the first Newton step."""
EXACT = 1e-12
"""The solution is exact if no force turns by more than this in a Newton step [rad]."""
ENOUGH = 1e-9
"""The same where rounding errors let it turn no less."""


@kernel
def solve_with_cones(
    program: WholeBodyProgram,
    reduction: Reduction,
    cones: Cones,
    own: ActiveSetProgram,
    solution: WholeBodySolution,
) -> None:
    """``solve_with_pyramids`` with the round cone |f_t| <= mu f_z in the place of the pyramid."""
    count = reduction.n_active[0]
    if count == 0:
        return
    for point in range(count):
        cones.used[point] = 0
    code = solve_cone_forces(program, reduction, 0, cones, own, solution)
    if code >= 0 and exceeds_limits(program, reduction, solution):
        joints = solution.torque.shape[0]
        code = solve_cone_forces(program, reduction, joints, cones, own, solution)
    write_forces(code, reduction, own.unknowns, solution)


@kernel
def solve_cone_forces(
    program: WholeBodyProgram,
    reduction: Reduction,
    extra: int,
    cones: Cones,
    own: ActiveSetProgram,
    solution: WholeBodySolution,
) -> int:
    """``solve_forces`` with round cones. Returns a negative code of ``active_set`` where it fails."""
    friction, count, x = program.weights.friction[0], reduction.n_active[0], own.unknowns
    n = 3 * count + extra
    first = limit_rows(program, reduction, extra, own.qp)
    tolerance, code, solved = FIRST, TOO_LONG, False
    for _ in range(APPROACHES):
        force_program(program.weights.force[0], reduction, extra, own.qp)
        write_planes(count, n, first, friction, cones, own.qp)
        code, held = approach(count, extra, first, friction, tolerance, cones, own)
        if code < 0:
            return code
        solved = refine(program, reduction, extra, first, held, cones, own)
        if solved:
            break
        tolerance *= 0.01
    if not solved:
        return TOO_LONG
    recover_motion(program, reduction, extra, x, solution)
    return code


@kernel
def approach(
    count: int,
    extra: int,
    first: int,
    friction: float,
    tolerance: float,
    cones: Cones,
    own: ActiveSetProgram,
) -> tuple[int, int]:
    """Solve the program, and add planes until no force leaves its cone by more than that share.

    Returns a negative code where it fails, and the number of active constraints.
    """
    n, rows, x = 3 * count + extra, first + PLANES * count, own.unknowns
    code = solve_program(n, rows, own.qp, own.memory, x)
    held = 0
    for row in range(rows):
        held += 1 if own.memory.is_active[row] else 0
    for _ in range(CUTS):
        if code < 0:
            return code, held
        if (
            add_violated_planes(count, first, friction, tolerance, cones, own.qp, own.memory, x)
            == 0
        ):
            return code, held
        code, held = fulfil(n, rows, held, own.qp, own.memory, x)
    return TOO_LONG, held


@kernel
def refine(
    program: WholeBodyProgram,
    reduction: Reduction,
    extra: int,
    first: int,
    held: int,
    cones: Cones,
    own: ActiveSetProgram,
) -> bool:
    """Newton steps from the solution with planes; returns whether they have become exact."""
    friction, count, x = program.weights.friction[0], reduction.n_active[0], own.unknowns
    n, rows = 3 * count + extra, first + PLANES * count
    before = 4.0
    for _ in range(STEPS):
        multiplier_curvature(count, held, first, cones, own.memory, x)
        refresh_support_planes(count, friction, EXACT, cones, x)
        write_planes(count, n, first, friction, cones, own.qp)
        force_program(program.weights.force[0], reduction, extra, own.qp)
        add_curvature(count, cones, own.qp.hessian)
        if solve_program(n, rows, own.qp, own.memory, x) < 0:
            return False
        held = 0
        for row in range(rows):
            held += 1 if own.memory.is_active[row] else 0
        for turn in range(2):
            force_gradient(program, reduction, extra, x, own.gradient)
            add_bending(count, cones, x, own.gradient)
            if turn == 0:
                polish(n, own.gradient, own.memory, x)
            else:
                recompute_multipliers(n, held, own.gradient, own.memory)
        angle = turned(count, friction, cones, x)
        if angle <= EXACT or (angle <= ENOUGH and angle > 0.5 * before):
            return True
        before = angle
    return False
