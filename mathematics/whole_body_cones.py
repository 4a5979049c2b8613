"""The whole-body controller's program with round friction cones, from its terms to torques, as a kernel.

It is ``whole_body_solution`` with other constraints: planes that touch the cones (``friction_cones``). They are
added where the solution leaves a cone until it does so by little; then Newton steps make it exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .active_set import (
    TOO_LONG,
    ActiveSetMemory,
    Program,
    active_set_memory,
    fulfil,
    polish,
    price_again,
    solve_program,
)
from .arrays import Array, Flags, Indices
from .friction_cones import (
    PLANES,
    Cones,
    add_bending,
    add_curvature,
    bend,
    cone_memory,
    cut,
    touch,
    turned,
    write_planes,
)
from .kernel import kernel
from .whole_body_qp import PYRAMID_ROWS, RigidBodyTerms, TaskRows
from .whole_body_reduction import (
    Reduction,
    force_gradient,
    force_program,
    recover_acceleration,
    recover_torque,
    reduction_memory,
)
from .whole_body_solution import (
    Motors,
    Solution,
    Weights,
    exceeds_limits,
    limit_rows,
    reduce_program,
    write_forces,
)

CUTS = 60
"""The most rounds in which planes are added, in each approach."""
STEPS = 12
"""The most Newton steps after each approach."""
APPROACHES = 4
"""How often planes are added again, each time until forces leave their cones by a hundredth of what they
did before, where Newton's steps do not converge."""
FIRST = 3e-2
"""The share by which forces may leave their cones before the first Newton step."""
EXACT = 1e-12
"""The solution is exact if no force turns by more than this in a Newton step [rad]."""
ENOUGH = 1e-9
"""The same where rounding errors let it turn no less."""


class ConeSolutionMemory(NamedTuple):
    """Memory for intermediate results; ``unknowns`` are the forces and the e of the reduction."""

    reduction: Reduction
    program: Program
    memory: ActiveSetMemory
    cones: Cones
    unknowns: Array
    gradient: Array
    active: Indices


def cone_solution_memory(n_velocities: int, n_contacts: int) -> ConeSolutionMemory:
    """Zero memory for a robot of that size."""
    joints = n_velocities - 6
    n, m = 3 * n_contacts + joints, (PYRAMID_ROWS + PLANES) * n_contacts + 2 * joints
    return ConeSolutionMemory(
        reduction_memory(n_velocities, 3 * n_contacts),
        Program(np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m)),
        active_set_memory(n, m),
        cone_memory(n_contacts),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n_contacts, dtype=np.int64),
    )


@kernel
def solve_whole_body_cones(
    tasks: TaskRows,
    terms: RigidBodyTerms,
    stance: Flags,
    joint_velocity: Array,
    weights: Weights,
    limits: int,
    motors: Motors,
    memory: ConeSolutionMemory,
    solution: Solution,
) -> None:
    """``solve_whole_body`` with the round cone |f_t| <= mu f_z in the place of the pyramid."""
    reduction, active = memory.reduction, memory.active
    count = reduce_program(
        tasks, terms, stance, joint_velocity, weights, limits, motors, reduction, active, solution
    )
    if count == 0:
        return
    for point in range(count):
        memory.cones.used[point] = 0
    code = solve_cone_forces(terms, weights, motors, count, 0, memory, solution)
    if code >= 0 and exceeds_limits(limits, motors, reduction, solution):
        joints = solution.torque.shape[0]
        code = solve_cone_forces(terms, weights, motors, count, joints, memory, solution)
    write_forces(code, active, count, memory.unknowns, solution)


@kernel
def solve_cone_forces(
    terms: RigidBodyTerms,
    weights: Weights,
    motors: Motors,
    count: int,
    extra: int,
    memory: ConeSolutionMemory,
    solution: Solution,
) -> int:
    """``solve_forces`` with round cones. Returns a negative code of ``active_set`` where it fails."""
    active, program, reduction, cones = (
        memory.active, memory.program, memory.reduction, memory.cones,
    )  # fmt: skip
    friction, force_weight = float(weights.friction[0]), float(weights.force[0])
    n, x = 3 * count + extra, memory.unknowns
    first = limit_rows(terms, weights, motors, count, extra, reduction, active, program)
    tolerance, code, solved = FIRST, TOO_LONG, False
    for _ in range(APPROACHES):
        force_program(reduction, 3 * count, extra, force_weight, program.hessian, program.gradient)
        rows = write_planes(count, n, first, friction, cones, program)
        code, held = approach(n, rows, count, first, friction, tolerance, memory)
        if code < 0:
            return code
        solved = refine(terms, rows, count, extra, first, held, friction, force_weight, memory)
        if solved:
            break
        tolerance *= 0.01
    if not solved:
        return TOO_LONG
    recover_acceleration(reduction, 3 * count, extra, x, solution.acceleration)
    recover_torque(terms, active, count, solution.acceleration, x, solution.torque)
    return code


@kernel
def approach(
    n: int,
    rows: int,
    count: int,
    first: int,
    friction: float,
    tolerance: float,
    memory: ConeSolutionMemory,
) -> tuple[int, int]:
    """Solve the program, and add planes until no force leaves its cone by more than that share.

    Returns a negative code where it fails, and the number of active constraints.
    """
    program, x = memory.program, memory.unknowns
    code = solve_program(n, rows, program, memory.memory, x)
    held = 0
    for row in range(rows):
        held += 1 if memory.memory.is_active[row] else 0
    for _ in range(CUTS):
        if code < 0:
            return code, held
        if cut(count, first, friction, tolerance, memory.cones, program, memory.memory, x) == 0:
            return code, held
        code, held = fulfil(n, rows, held, program, memory.memory, x)
    return TOO_LONG, held


@kernel
def refine(
    terms: RigidBodyTerms,
    rows: int,
    count: int,
    extra: int,
    first: int,
    held: int,
    friction: float,
    force_weight: float,
    memory: ConeSolutionMemory,
) -> bool:
    """Newton steps from the solution with planes; returns whether they have become exact."""
    reduction, program, cones, x = memory.reduction, memory.program, memory.cones, memory.unknowns
    size, n = 3 * count, 3 * count + extra
    before = 4.0
    for _ in range(STEPS):
        bend(count, held, first, cones, memory.memory, x)
        touch(count, friction, EXACT, cones, x)
        write_planes(count, n, first, friction, cones, program)
        force_program(reduction, size, extra, force_weight, program.hessian, program.gradient)
        add_curvature(count, cones, program.hessian)
        if solve_program(n, rows, program, memory.memory, x) < 0:
            return False
        held = 0
        for row in range(rows):
            held += 1 if memory.memory.is_active[row] else 0
        for turn in range(2):
            force_gradient(
                reduction, terms, memory.active, count, extra, force_weight, x, memory.gradient
            )
            add_bending(count, cones, x, memory.gradient)
            if turn == 0:
                polish(n, memory.gradient, memory.memory, x)
            else:
                price_again(n, held, memory.gradient, memory.memory)
        angle = turned(count, friction, cones, x)
        if angle <= EXACT or (angle <= ENOUGH and angle > 0.5 * before):
            return True
        before = angle
    return False
