"""The whole-body controller's program from its terms to torques, as one kernel.

It puts the elimination (``whole_body_reduction``) and the active-set method (``active_set``) in
order for one tick.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .active_set import ActiveSetMemory, QuadraticProgram, active_set_memory, polish, solve_program
from .arrays import Array1D, Flags1D, Indices1D, Rows3
from .kernel import kernel
from .whole_body_qp import (
    RigidBodyTerms,
    TaskRows,
    TorqueLimits,
    motor_limits,
)
from .whole_body_reduction import (
    Reduction,
    eliminate,
    force_gradient,
    force_program,
    free_motions,
    friction_rows,
    recover_acceleration,
    recover_torque,
    reduction_memory,
    torque_rows,
    within_limits,
)

NO_CONTACT = 0
"""Result where no point is in stance: nothing to solve."""
SOLVED = 1
ILL_POSED = -4
"""The terms or the tasks are not finite, or leave no positive definite matrix."""

POLISHING = 2
"""Newton steps after the solution; each divides the error by more than a thousand."""

NO_LIMITS, JOINT_LIMITS, MOTOR_LIMITS = 0, 1, 2
"""Kinds of torque limits."""


class ProgramWeights(NamedTuple):
    """Numbers that may change during a run, each an array of one element.

    ``acceleration`` w_a and ``force`` w_f are weights, ``friction`` is the pyramid's coefficient, and
    ``force_min`` and ``force_max`` [N] bound the normal force of a point.
    """

    acceleration: Array1D
    force: Array1D
    friction: Array1D
    force_min: Array1D
    force_max: Array1D


class WholeBodySolution(NamedTuple):
    """The result: torques (n_joints,), accelerations (n,), forces (n_contacts, 3); ``code`` (1,)."""

    torque: Array1D
    acceleration: Array1D
    force: Rows3
    code: Indices1D


class SolutionMemory(NamedTuple):
    """Memory for intermediate results; ``unknowns`` are the forces and the e of the reduction."""

    reduction: Reduction
    program: QuadraticProgram
    memory: ActiveSetMemory
    unknowns: Array1D
    gradient: Array1D
    active: Indices1D


def solution_memory(n_velocities: int, n_contacts: int) -> SolutionMemory:
    """Zero memory for a robot of that size."""
    joints = n_velocities - 6
    n, m = 3 * n_contacts + joints, 6 * n_contacts + 2 * joints
    return SolutionMemory(
        reduction_memory(n_velocities, 3 * n_contacts),
        QuadraticProgram(np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m)),
        active_set_memory(n, m),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n_contacts, dtype=np.int64),
    )


@kernel
def solve_whole_body(
    tasks: TaskRows,
    terms: RigidBodyTerms,
    stance: Flags1D,
    joint_velocity: Array1D,
    weights: ProgramWeights,
    limits: int,
    motors: TorqueLimits,
    memory: SolutionMemory,
    solution: WholeBodySolution,
) -> None:
    """Solve the program of ``whole_body_qp`` and write torques, accelerations and forces.

    ``solution.code`` becomes SOLVED, NO_CONTACT, ILL_POSED or a negative code of ``active_set``. Only
    with SOLVED the other results are of use.

    First the program is solved without the limits on torque. If its solution keeps them, it is the
    solution; otherwise the larger program is solved that has them.

    Args:
        stance: the points in stance, (n_contacts,).
        joint_velocity: (n_joints,) [rad/s], for the motors' limits.
        limits: one of the kinds of torque limits.
    """
    reduction, active = memory.reduction, memory.active
    count = reduce_program(
        tasks, terms, stance, joint_velocity, weights, limits, motors, reduction, active, solution
    )
    if count == 0:
        return
    code = solve_forces(terms, weights, motors, count, 0, memory, solution)
    if code >= 0 and exceeds_limits(limits, motors, reduction, solution):
        joints = solution.torque.shape[0]
        code = solve_forces(terms, weights, motors, count, joints, memory, solution)
    write_forces(code, active, count, memory.unknowns, solution)


@kernel
def reduce_program(
    tasks: TaskRows,
    terms: RigidBodyTerms,
    stance: Flags1D,
    joint_velocity: Array1D,
    weights: ProgramWeights,
    limits: int,
    motors: TorqueLimits,
    reduction: Reduction,
    active: Indices1D,
    solution: WholeBodySolution,
) -> int:
    """Eliminate the accelerations and compute the motors' limits of this tick.

    Writes the points in stance to ``active`` and returns their number; it returns 0, and writes the
    reason to ``solution.code``, where there is nothing to solve.
    """
    count = 0
    for point in range(stance.shape[0]):
        if stance[point]:
            active[count] = point
            count += 1
    if count == 0:
        solution.code[0] = NO_CONTACT
        return 0
    if not eliminate(tasks, terms, active, count, weights.acceleration[0], reduction):
        solution.code[0] = ILL_POSED
        return 0
    if limits != NO_LIMITS:
        limit_motors(joint_velocity, limits, motors)
    return count


@kernel
def exceeds_limits(
    limits: int, motors: TorqueLimits, reduction: Reduction, solution: WholeBodySolution
) -> bool:
    """Whether the solution's torques exceed their limits; if so, prepares the larger program."""
    if limits == NO_LIMITS or within_limits(solution.torque, motors):
        return False
    free_motions(reduction)
    return True


@kernel
def write_forces(
    code: int, active: Indices1D, count: int, unknowns: Array1D, solution: WholeBodySolution
) -> None:
    """Write the forces of the points in stance, zeros for the others, and SOLVED; or a failure's code."""
    if code < 0:
        solution.code[0] = code
        return
    for point in range(solution.force.shape[0]):
        solution.force[point, :] = 0.0
    for j in range(count):
        for axis in range(3):
            solution.force[active[j], axis] = unknowns[3 * j + axis]
    solution.code[0] = SOLVED


@kernel
def solve_forces(
    terms: RigidBodyTerms,
    weights: ProgramWeights,
    motors: TorqueLimits,
    count: int,
    extra: int,
    memory: SolutionMemory,
    solution: WholeBodySolution,
) -> int:
    """Solve the program in forces, and with ``extra`` unknowns also with the limits on torque.

    Writes ``memory.unknowns``, the acceleration and the torque. Returns the result of
    ``solve_program``.
    """
    active, program, reduction = memory.active, memory.program, memory.reduction
    size, force_weight = 3 * count, weights.force[0]
    force_program(reduction, size, extra, force_weight, program.hessian, program.gradient)
    rows = limit_rows(
        terms, weights, motors, count, extra, memory.reduction, active, memory.program
    )
    code = solve_program(size + extra, rows, program, memory.memory, memory.unknowns)
    if code < 0:
        return code
    for _ in range(POLISHING):
        force_gradient(
            reduction, terms, active, count, extra, force_weight, memory.unknowns,
            memory.gradient,
        )  # fmt: skip
        polish(size + extra, memory.gradient, memory.memory, memory.unknowns)
    recover_acceleration(reduction, size, extra, memory.unknowns, solution.acceleration)
    recover_torque(terms, active, count, solution.acceleration, memory.unknowns, solution.torque)
    return code


@kernel
def limit_rows(
    terms: RigidBodyTerms,
    weights: ProgramWeights,
    motors: TorqueLimits,
    count: int,
    extra: int,
    reduction: Reduction,
    active: Indices1D,
    program: QuadraticProgram,
) -> int:
    """Write the rows of friction, and with ``extra`` unknowns those of torque; returns their number."""
    matrix, bound = program.matrix, program.bound
    rows = friction_rows(
        count, extra, weights.friction[0], weights.force_min[0],
        weights.force_max[0], matrix, bound,
    )  # fmt: skip
    if extra > 0:
        rows = torque_rows(reduction, terms, active, count, motors, rows, matrix, bound)
    return rows


@kernel
def limit_motors(joint_velocity: Array1D, limits: int, motors: TorqueLimits) -> None:
    """The bounds on the torques: of motors at their present speed, or of joints at any speed."""
    for i in range(motors.speed.shape[0]):
        if limits == JOINT_LIMITS:
            motors.upper[i] = motors.peak[i]
            motors.lower[i] = -motors.peak[i]
            continue
        total = 0.0
        for j in range(joint_velocity.shape[0]):
            total += motors.to_speed[i, j] * joint_velocity[j]
        motors.speed[i] = total
    if limits == MOTOR_LIMITS:
        motor_limits(motors)
