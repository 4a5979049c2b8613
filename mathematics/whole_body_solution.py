"""The own method for the whole-body program: a dual active-set method on the forces.

First the program is solved without the limits on torque. If its solution keeps them, it is the
solution; otherwise the larger program is solved that has them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .active_set import ActiveSetMemory, QuadraticProgram, active_set_memory, polish, solve_program
from .arrays import Array1D
from .kernel import kernel
from .whole_body_qp import (
    NO_LIMITS,
    PYRAMID_ROWS,
    WholeBodyProgram,
    WholeBodySolution,
    within_limits,
)
from .whole_body_reduction import (
    Reduction,
    force_gradient,
    force_program,
    free_motions,
    limit_rows,
    recover_motion,
    write_forces,
)

POLISHING = 2
"""Newton steps after the solution; each divides the error by more than a thousand."""


class ActiveSetProgram(NamedTuple):
    """The program in forces, and memory for its solution; ``unknowns`` are f and e of the reduction."""

    qp: QuadraticProgram
    memory: ActiveSetMemory
    unknowns: Array1D
    gradient: Array1D


def active_set_program(n_velocities: int, n_contacts: int, planes: int = 0) -> ActiveSetProgram:
    """Zeroed memory for a robot of this size, with this number of further rows per contact."""
    joints = n_velocities - 6
    n, m = 3 * n_contacts + joints, (PYRAMID_ROWS + planes) * n_contacts + 2 * joints
    return ActiveSetProgram(
        QuadraticProgram(np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m)),
        active_set_memory(n, m), np.zeros(n), np.zeros(n),
    )  # fmt: skip


@kernel
def solve_with_pyramids(
    program: WholeBodyProgram,
    reduction: Reduction,
    own: ActiveSetProgram,
    solution: WholeBodySolution,
) -> None:
    """Solve the program of ``whole_body_qp`` after ``reduce_program``."""
    if reduction.n_active[0] == 0:
        return
    code = solve_forces(program, reduction, 0, own, solution)
    if code >= 0 and exceeds_limits(program, reduction, solution):
        code = solve_forces(program, reduction, solution.torque.shape[0], own, solution)
    write_forces(code, reduction, own.unknowns, solution)


@kernel
def exceeds_limits(
    program: WholeBodyProgram, reduction: Reduction, solution: WholeBodySolution
) -> bool:
    """Return whether the solution's torques exceed their limits; if so, prepare the larger
    program."""
    if program.motors.kind == NO_LIMITS or within_limits(solution.torque, program.motors):
        return False
    free_motions(reduction)
    return True


@kernel
def solve_forces(
    program: WholeBodyProgram,
    reduction: Reduction,
    extra: int,
    own: ActiveSetProgram,
    solution: WholeBodySolution,
) -> int:
    """Solve the program in f, and with ``extra`` unknowns e also with the limits on torque.

    Writes the unknowns, the acceleration and the torque. Returns the result of ``solve_program``.
    """
    n, x = 3 * reduction.n_active[0] + extra, own.unknowns
    force_program(program.weights.force[0], reduction, extra, own.qp)
    rows = limit_rows(program, reduction, extra, own.qp)
    code = solve_program(n, rows, own.qp, own.memory, x)
    if code < 0:
        return code
    for _ in range(POLISHING):
        force_gradient(program, reduction, extra, x, own.gradient)
        polish(n, own.gradient, own.memory, x)
    recover_motion(program, reduction, extra, x, solution)
    return code
