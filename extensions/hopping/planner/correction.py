"""Correction of a motion near a plan to the nearest one that fulfils the planner's equations: Newton's steps on the
constraints alone.

An interpolated motion is nearly as good as the plans it comes from, but it obeys no law of motion exactly. So nothing
is optimised again: each step is the smallest weighted change of the variables that fulfils the linearised
constraints. These are all equations, and the inequalities that have been violated so far, which are held at
their bounds. A variable that has left its bounds is put on the bound and stays there. Errors fall with their square, in three to
five steps. Near the end, where the same constraints hold as before, a step takes the factors of the last one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import Array
from ....mathematics.banded_system import hold_violated, keep_bounds, smallest_correction
from ....mathematics.compiling.compile_calls import compile_calls
from ....mathematics.compiling.kernel_call import KernelCall, aligned_zeros
from ....planner.problem.problem import FullProblem
from ....planner.problem.program_values import ProgramValues
from ....planner.solving.solver import VIOLATION

STEPS = 8
"""Greatest number of steps."""
ENOUGH = 0.1 * VIOLATION
"""A violation that ends the steps."""
FAST = 1e-2
"""Share of a violation; where a step has left less, the next one takes the same factors."""
LOST = 1e3
"""A violation from which the steps do not come back."""
TOUCHED = 1e-9
"""An inequality violated by more is held at its bound from then on."""
REGULARISATION = 1e-12
"""Share of the diagonal; with 1e-9 the contact rows, which nearly repeat each other, converge slowly."""
BAND = 264
"""Diagonals of the equations' matrix, the rows of a knot and those of the next one: whole lines of the cache."""
PLACE, RATE, ACCELERATION, FORCE, INTERVAL = 0.05, 0.5, 20.0, 10.0, 1e-3
"""Changes that count alike: of coordinates [m, rad], their rates and accelerations, forces [N] and interval lengths [s]."""


class Correction(NamedTuple):
    """The variables, how many steps they took, and the largest violation that is left."""

    values: Array
    steps: int
    violation: float

    @property
    def solved(self) -> bool:
        """True if all constraints hold."""
        return self.violation <= 2.0 * VIOLATION


class Corrector:
    """Corrects motions for problems of one structure. Everything is in memory that is kept."""

    def __init__(self, problem: FullProblem) -> None:
        assembly = problem.assembly
        rows, variables = assembly.constraints, assembly.variables
        self._constraints, self._squares = ProgramValues(assembly), squares_of_changes(problem)
        self._variables, self._lower, self._upper, self._inverse, self._step = np.zeros(
            (5, variables)
        )
        self._row_lower, self._row_upper, vector = np.zeros((3, rows))
        self._held, self._violation = np.zeros(rows, dtype=np.bool_), np.zeros(1)
        self._left, self._touched, self._factorised, self._found = np.zeros((4, 1), dtype=np.bool_)
        place, count = np.zeros(rows, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self._keep_bounds = KernelCall(
            keep_bounds, self._variables, self._lower, self._upper, self._inverse, self._left
        )
        self._hold_violated = KernelCall(
            hold_violated, self._constraints.values, self._row_lower, self._row_upper, TOUCHED, self._held,
            place, count, vector, self._violation, self._touched,
        )  # fmt: skip
        self._correct = KernelCall(
            smallest_correction,
            self._constraints.starts, self._constraints.rows, self._constraints.entries, self._inverse, place, count, REGULARISATION,
            aligned_zeros((rows, BAND)), *np.zeros((2, rows), dtype=np.int64), vector, self._step,
            self._factorised, self._found,
        )  # fmt: skip
        compile_calls([self._keep_bounds, self._hold_violated, self._correct])

    def correct(self, problem: FullProblem, guess: Array) -> Correction:
        """Return the nearest variables to the guess that fulfil the problem's constraints, as far as the steps lead."""
        self._variables[:], self._inverse[:] = guess, self._squares
        self._lower[:], self._upper[:] = problem.lower, problem.upper
        self._row_lower[:], self._row_upper[:] = problem.row_lower, problem.row_upper
        self._held[:] = problem.row_lower == problem.row_upper
        violation = np.inf
        for steps in range(STEPS + 1):
            self._keep_bounds.run()
            self._constraints.evaluate(self._variables, problem.parameters)
            self._hold_violated.run()
            before, violation = violation, float(self._violation[0])
            if not violation > ENOUGH or violation > LOST or steps == STEPS:
                return Correction(self._variables.copy(), steps, violation)
            self._factorised[0] = violation < FAST * before < np.inf and not (
                self._left[0] or self._touched[0]
            )
            if not self._factorised[0]:
                self._constraints.differentiate()
            self._correct.run()
            if not self._found[0]:
                break
            self._variables += self._step
        return Correction(self._variables.copy(), steps, np.inf)


def squares_of_changes(problem: FullProblem) -> Array:
    """Return by variable the square of a change that counts as one, (n_variables,)."""
    assembly, n = problem.assembly, problem.coordinates.size
    changes = np.full(assembly.variables, INTERVAL)
    for k, knot in enumerate(assembly.knots):
        state, control = assembly.state_start[k], assembly.control_start[k]
        changes[state : state + n] = PLACE
        changes[state + n : state + 2 * n] = RATE
        if knot.controls:
            changes[control : control + n] = ACCELERATION
            flies = problem.phase_at(k).flies
            own = len(problem.coordinates.turning) if flies else problem.coordinates.forces
            changes[control + n : control + n + own] = RATE if flies else FORCE
    return np.asarray(changes * changes)
