"""The solvers of the whole-body controller, chosen by name: the own method and those of libraries."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...mathematics.arrays import Array1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.quadratic_program import CLARABEL, QuadraticProgramSolver, cone_rows
from ...mathematics.whole_body_cones import PLANES, cone_memory, solve_with_cones
from ...mathematics.whole_body_qp import NOT_FOUND, WholeBodyProgram, WholeBodySolution
from ...mathematics.whole_body_reduction import (
    Reduction,
    equality_program,
    recover_solution,
    write_program,
)
from ...mathematics.whole_body_solution import active_set_program, solve_with_pyramids
from ...runtime.language.steps import PythonCall

Cones = Literal["pyramid", "round"]
ACTIVE_SET = "active_set"
"""The name of the own method, which needs no library."""


def check_solver(name: str, cones: Cones) -> None:
    """Raise ``LookupError`` if there is no such solver, or it does not solve programs with these cones."""
    if name != ACTIVE_SET:
        QuadraticProgramSolver.check_name(name)
    if cones == "round" and name not in (ACTIVE_SET, CLARABEL):
        raise LookupError(
            f"{name} cannot solve a program with round cones; {ACTIVE_SET} and {CLARABEL} can"
        )


def solver_call(
    name: str,
    cones: Cones,
    program: WholeBodyProgram,
    reduction: Reduction,
    solution: WholeBodySolution,
) -> KernelCall | PythonCall:
    """Return the call that writes the solution of the program that ``reduce_program`` has reduced."""
    if name != ACTIVE_SET:
        return PythonCall(ExternalSolver(name, cones, program, reduction, solution).solve, ())
    n, n_contacts = len(solution.acceleration), len(solution.force)
    if cones == "round":
        own = active_set_program(n, n_contacts, PLANES)
        memory = cone_memory(n_contacts)
        return KernelCall(solve_with_cones, program, reduction, memory, own, solution)
    own = active_set_program(n, n_contacts)
    return KernelCall(solve_with_pyramids, program, reduction, own, solution)


def fallback_call(
    name: str,
    cones: Cones,
    program: WholeBodyProgram,
    inscribed: Array1D,
    reduction: Reduction,
    solution: WholeBodySolution,
) -> KernelCall | None:
    """Return the call that solves the program where the solver ``name`` finds no solution.

    After a library's solver that is the own method. After the own method there is none with pyramids: of 59,000
    programs it solved all that DAQP could solve. With round cones its search fails in 2 of 50,000; then the
    cones become the pyramids inside them.

    Args:
        inscribed: the friction of those pyramids, (1,), which the caller keeps up to date.
    """
    if name != ACTIVE_SET:
        own = solver_call(ACTIVE_SET, cones, program, reduction, solution)
        assert isinstance(own, KernelCall)
        return own
    if cones == "pyramid":
        return None
    inside = program._replace(weights=program.weights._replace(friction=inscribed))
    pyramids = active_set_program(len(solution.acceleration), len(solution.force))
    return KernelCall(solve_with_pyramids, inside, reduction, pyramids, solution)


class ExternalSolver:
    """A library's solver on the reduced program, see ``whole_body_reduction``."""

    def __init__(
        self,
        name: str,
        cones: Cones,
        program: WholeBodyProgram,
        reduction: Reduction,
        solution: WholeBodySolution,
    ) -> None:
        n, n_contacts = len(solution.acceleration), len(solution.force)
        self.solver = QuadraticProgramSolver(name)
        self._round, self._friction = cones == "round", program.weights.friction
        self._reduction, self._solution = reduction, solution
        self._whole = equality_program(n, n_contacts)
        self._unknowns = np.zeros(3 * n_contacts + n)
        self._write = KernelCall(write_program, program, reduction, self._whole)
        self._recover = KernelCall(recover_solution, program, reduction, self._unknowns, solution)

    def solve(self) -> None:
        """Write the solution."""
        count = int(self._reduction.n_active[0])
        if count == 0:  # the reduction has said why
            return
        self._write.run()
        whole, limits = self._whole, self._whole.limits
        n, rows = (int(size) for size in whole.size)
        # pyramids contain the round cones, so their rows may stay
        cones = cone_rows(count, n, 0, float(self._friction[0])) if self._round else None
        x = self.solver.solve(
            limits.hessian[:n, :n].copy(), limits.gradient[:n], limits.matrix[:rows, :n].copy(),
            limits.bound[:rows], whole.matrix[:, :n].copy(), whole.bound, cones,
        )  # fmt: skip
        if x is None:
            self._solution.code[0] = NOT_FOUND
            return
        self._unknowns[:n] = x
        self._recover.run()
