"""A planner's problem as a Drake program, solved by SNOPT: the paper's solver on our problem.

The program has the same variables, constraints, bounds and cost, knot by knot, as its users write
them: Python callbacks that return values and exact derivatives, here from the planner's own
compiled functions, with the derivatives' sparsity declared. The clock runs inside the callbacks
too, so their share can be taken off.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....mathematics.arrays import Array
from ....planner.problem.assembly import Assembly, NonlinearProgram
from ....planner.problem.program_functions import program_functions
from ....planner.solving.solver import violation_of

OPTIONS: dict[str, float | int] = {
    "Major feasibility tolerance": 1e-6,
    "Major optimality tolerance": 1e-4,
    "Major iterations limit": 3000,
    "Iterations limit": 1_000_000,
}
"""The tolerances of the planner's own solver, and limits that do not stop it; nothing is tuned."""


@dataclass(frozen=True)
class SnoptResult:
    """SNOPT's solution and its cost; CPU times in seconds. ``info`` is its exit code: 1 optimal, 13
    no feasible point found, 34 out of time."""

    values: Array
    cost: float
    violation: float
    info: int
    cpu: float
    callback_cpu: float

    @property
    def solved(self) -> bool:
        """True if SNOPT says that it found an optimum, to its tolerances."""
        return self.info in (1, 2, 3)


class _OutOfTime(Exception):
    """SNOPT has used the time it was given."""


class _Callback:
    """A piece on a knot as a callback: rows, with minus the next state's in the gap, or the cost."""

    def __init__(self, owner: SnoptProgram, piece: Any, parameters: Array, rows: Any,
                 gap: int) -> None:  # fmt: skip
        self.owner, self.piece, self.parameters = owner, piece, parameters
        self.kept, self.size = rows, int(piece.value.size1_in(0))
        triplet = piece.jacobian.sparsity_out(1).get_triplet()
        self.row, self.column = (np.array(x, dtype=np.int64) for x in triplet)
        place = np.full(piece.rows, -1)
        place[rows] = np.arange(len(rows))
        self.used = np.flatnonzero(place[self.row] >= 0)
        self.at = (place[self.row[self.used]], self.column[self.used])
        self.next = (np.arange(gap), self.size + np.arange(gap))
        self.shape = (len(rows), self.size + gap)

    def pattern(self) -> list[tuple[int, int]]:
        """Return the entries of the Jacobian that are not zero."""
        found = set(zip(*(x.tolist() for x in self.at), strict=True))
        return sorted(found | set(zip(*(x.tolist() for x in self.next), strict=True)))

    def constraint(self, variables: Any) -> Any:
        """Return values, with derivatives where they are requested."""
        from pydrake.autodiffutils import ExtractValue, InitializeAutoDiff

        started = self.owner.on_time()
        differentiated = variables.dtype == object
        x = ExtractValue(variables).ravel() if differentiated else variables
        if differentiated:
            rows, jacobian = self.piece.jacobian(x[: self.size], self.parameters)
        else:
            rows = self.piece.value(x[: self.size], self.parameters)[1]
        value = rows.full().ravel()[self.kept]
        value[: len(self.next[0])] += x[self.size :]
        result: Any = value
        if differentiated:
            matrix = np.zeros(self.shape)
            matrix[self.at] = np.array(jacobian.nonzeros())[self.used]
            matrix[self.next] = 1.0
            result = InitializeAutoDiff(value, matrix).ravel()
        self.owner.callback_cpu += time.process_time() - started
        return result

    def cost(self, variables: Any) -> Any:
        """Return the piece's cost, with its gradient where it is requested."""
        from pydrake.autodiffutils import ExtractValue, InitializeAutoDiff

        started = self.owner.on_time()
        result: Any
        if variables.dtype == object:
            x = ExtractValue(variables).ravel()
            slope = self.piece.gradient(x, self.parameters).full()
            value = float(self.piece.value(x, self.parameters)[0])
            result = InitializeAutoDiff(np.array([value]), slope.reshape(1, -1))[0, 0]
        else:
            result = float(self.piece.value(variables, self.parameters)[0])
        self.owner.callback_cpu += time.process_time() - started
        return result


class SnoptProgram:
    """The Drake program of a problem.

    Raises ``ImportError`` where Drake is not installed.
    """

    def __init__(self, problem: NonlinearProgram) -> None:
        from pydrake.solvers import MathematicalProgram

        self.is_out_of_time = False
        self.problem, self.callback_cpu, self.until = problem, 0.0, np.inf
        self.program: Any = MathematicalProgram()
        assembly = problem.assembly
        self.x = self.program.NewContinuousVariables(assembly.variables, "x")
        lower, upper = problem.lower.copy(), problem.upper.copy()
        for k, knot in enumerate(assembly.knots):
            rows, at = assembly.fixed_rows(k), assembly.state_start[k] + np.array(knot.fixed, int)
            lower[at], upper[at] = problem.row_lower[rows], problem.row_upper[rows]
            self._bound_lengths(k, lower, upper)
            for name in knot.pieces:
                self._add(assembly, name, k)
            if knot.hold is not None:  # a control that is the next knot's last state
                held = self.x[assembly.control_start[k] + knot.hold]
                into = self.x[assembly.state_start[k + 1] + assembly.nx[k + 1] - 1]
                self.program.AddLinearEqualityConstraint(
                    np.array([[1.0, -1.0]]), np.zeros(1), np.array([held, into])
                )
        self.program.AddBoundingBoxConstraint(lower, upper, self.x)

    def _bound_lengths(self, k: int, lower: Array, upper: Array) -> None:
        """Bound the control that chooses an interval length also on the states it becomes.

        They follow from the rest; without them SNOPT tries negative lengths and ends infeasible.
        """
        assembly = self.problem.assembly
        hold = assembly.knots[k].hold
        if hold is None:
            return
        chosen = assembly.control_start[k] + hold
        for after in range(k + 1, len(assembly.knots)):
            if assembly.nx[after] != assembly.nx[k + 1]:
                break
            length = assembly.state_start[after] + assembly.nx[after] - 1
            lower[length], upper[length] = lower[chosen], upper[chosen]

    def _add(self, assembly: Assembly, name: str, k: int) -> None:
        problem, knot, piece = self.problem, assembly.knots[k], assembly.pieces[name]
        take, kept = knot.pieces[name]
        first, _ = assembly.rows_of(name, k)
        start = assembly.parameter_start[name, k]
        parameters = problem.parameters[start : start + piece.value.size1_in(1)]
        variables, rows = assembly.state_start[k] + take, first + np.arange(len(kept))
        # Rows that do not change (no derivative; in the sagittal plane some do not) are no
        # constraints, and Drake's SNOPT calls a program with such rows infeasible.
        changing = set(piece.jacobian.sparsity_out(1).get_triplet()[0])
        moving = np.array([row in changing for row in kept], dtype=bool)
        kept, rows = kept[moving], rows[moving]
        gap = 0
        if knot.gap == name:
            gap = assembly.nx[k + 1] - (knot.hold is not None)
            rows = np.concatenate([assembly.gap_start[k] + np.arange(gap), rows])
            kept = np.concatenate([np.arange(gap), kept])
        callback = _Callback(self, piece, parameters, kept, gap)
        after = assembly.state_start[k + 1] + np.arange(gap) if gap else np.array([], int)
        binding = self.program.AddConstraint(
            callback.constraint, problem.row_lower[rows], problem.row_upper[rows],
            self.x[np.concatenate([variables, after])],
        )  # fmt: skip
        binding.evaluator().SetGradientSparsityPattern(callback.pattern())
        if piece.gradient.sparsity_out(0).nnz() and knot.gap == name:
            self.program.AddCost(callback.cost, self.x[variables])

    def on_time(self) -> float:
        """Return the CPU time now [s]. Raises ``_OutOfTime`` where the limit is past."""
        now = time.process_time()
        if now > self.until:
            self.is_out_of_time = True
            raise _OutOfTime
        return now

    def solve(self, guess: Array, *, time_limit: float = 300.0) -> SnoptResult:
        """Run SNOPT from the guess, with ``OPTIONS``, for at most so many CPU seconds.

        Its own time limit is not obeyed through Drake, so a callback ends it.
        """
        from pydrake.solvers import SnoptSolver, SolverOptions

        options, solver = SolverOptions(), SnoptSolver()
        for key, value in OPTIONS.items():
            options.SetOption(solver.solver_id(), key, value)
        self.callback_cpu = 0.0
        started = time.process_time()
        self.until, self.is_out_of_time = started + time_limit, False
        try:
            result = solver.Solve(self.program, guess, options)
        except (_OutOfTime, RuntimeError):  # Drake wraps what a callback raises
            if not self.is_out_of_time:
                raise
            cpu = time.process_time() - started
            return SnoptResult(guess, np.nan, np.inf, 34, cpu, self.callback_cpu)
        cpu = time.process_time() - started
        values = np.array(result.GetSolution(self.x))
        functions = program_functions(self.problem.assembly)
        violation, _ = violation_of(self.problem, values, functions["nlp_g"])
        cost = float(result.get_optimal_cost())
        info = int(result.get_solver_details().info)
        return SnoptResult(values, cost, violation, info, cpu, self.callback_cpu)
