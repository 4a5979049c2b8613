"""The whole-body program as other solvers get it: OSQP in the way of BRUCE's public walking code,
and DAQP through its own interface.

Both solve the very program that the controller's own method solves, from the same rows of tasks and
with the same limits. BRUCE's code (``Play/Walking/low_level.py`` of its public simulation) stacks
equalities and inequalities into one dense matrix, makes sparse matrices of it and of the Hessian in
every tick, and hands their numbers to a solver that was set up once, with OSQP's own tolerances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....blocks.control.whole_body_controller import WholeBodyController
from ....mathematics.arrays import Array, Indices
from ....mathematics.whole_body_qp import NOT_FOUND, SOLVED
from ....runtime.language.steps import PythonCall
from ....runtime.running.timing import block_times
from ..full_program import FullMatrices, FullProgram
from ..rows import Row, compare
from .controller import RecordedController
from .tsid import INSTALL, TORQUE_ERROR, TsidCheck

OSQP_TOLERANCE = 1e-3
"""Absolute and relative, as in BRUCE's code."""
_NOT_ZERO = 1e-300
"""Stands for a zero in a place where the solver expects a number."""
_EQUALITY = 5
"""DAQP's mark of an equality."""


class PeerProgram(FullProgram):
    """The full program and a peer that solves it."""

    def solve(self, active: Indices) -> Array | None:
        """Solve for the accelerations and then the forces of the points ``active``; return none if
        it fails."""
        return self.solve_assembled(self.assemble(active), len(active))

    def solve_assembled(self, program: FullMatrices, count: int) -> Array | None:
        """Solve a program with ``count`` points in stance whose matrices are ready."""
        raise NotImplementedError


def stacked(program: FullMatrices) -> tuple[Array, Array, Array]:
    """Return equalities and inequalities as lower <= matrix x <= upper."""
    equality, inequality = program.equality, program.inequality
    matrix = np.vstack((equality.matrix, inequality.matrix))
    upper = np.hstack((equality.bound, inequality.bound))
    lower = np.hstack((equality.bound, np.full(len(inequality.bound), -np.inf)))
    return matrix, lower, upper


class OsqpProgram(PeerProgram):
    """The program solved by OSQP, with one solver for every number of points in stance.

    OSQP expects the numbers of a sparse matrix in fixed places. So all states are shown to ``learn``
    before the first is solved.
    """

    def learn(self, active: Indices) -> None:
        """Note which numbers are not zero in the present state."""
        program = self.assemble(active)
        matrix, square = stacked(program)[0], np.triu(program.cost.hessian)
        known = vars(self).setdefault("patterns", {})
        places = known.setdefault(len(active), (matrix != 0.0, square != 0.0))
        places[0][...] |= matrix != 0.0
        places[1][...] |= square != 0.0

    def solve_assembled(self, program: FullMatrices, count: int) -> Array | None:
        """See ``PeerProgram``."""
        from scipy import sparse

        matrix, lower, upper = stacked(program)
        rows = sparse.csc_matrix(matrix)
        triangle = sparse.triu(sparse.csc_matrix(program.cost.hessian), format="csc")
        in_rows, in_triangle = vars(self)["patterns"][count]
        rows = _complete(rows, in_rows, matrix)
        triangle = _complete(triangle, in_triangle, program.cost.hessian)
        solvers = vars(self).setdefault("solvers", {})
        if count in solvers:
            solver = solvers[count]
            solver.update(q=program.cost.gradient, l=lower, u=upper, Px=triangle.data, Ax=rows.data)
        else:
            import osqp

            solver = solvers[count] = osqp.OSQP()
            solver.setup(
                P=triangle, q=program.cost.gradient, A=rows, l=lower, u=upper, verbose=False,
                eps_abs=OSQP_TOLERANCE, eps_rel=OSQP_TOLERANCE,
            )  # fmt: skip
        answer = solver.solve(raise_error=False)
        return np.asarray(answer.x) if answer.info.status.startswith("solved") else None


class DaqpProgram(PeerProgram):
    """The program solved by DAQP, which begins with the last tick's active constraints."""

    def solve_assembled(self, program: FullMatrices, count: int) -> Array | None:
        """See ``PeerProgram``."""
        matrix, lower, upper = stacked(program)
        cost, models = program.cost, vars(self).setdefault("models", {})
        if count in models:
            model = models[count]
            model.update(cost.hessian, cost.gradient, matrix, upper, lower)
        else:
            import daqp

            sense = np.zeros(len(upper), np.int32)
            sense[: len(program.equality.bound)] = _EQUALITY
            model = models[count] = daqp.Model()
            model.setup(cost.hessian, cost.gradient, matrix, upper, lower, sense)
        answer, _, flag, _ = model.solve()
        return np.asarray(answer) if flag > 0 else None


class OsqpController(WholeBodyController):
    """The whole-body controller with OSQP in the place of its own method.

    While ``learning`` is true, the own method does the work."""

    learning = True

    def setup(self) -> None:
        super().setup()
        self._osqp, own = OsqpProgram(self), (self._reduce, self._solve)

        def solve_or_learn() -> None:
            if self.learning:
                self._osqp.limit.run()
                self._osqp.learn(np.flatnonzero(self.phase.stance))
                for call in own:
                    call.run()
            else:
                self._solve_by_osqp()

        self._solve = PythonCall(solve_or_learn, ())
        self._arrange()
        self.kernel_calls = tuple(call for call in self.kernel_calls if call is not self._reduce)

    def _solve_by_osqp(self) -> None:
        """Write OSQP's solution of the present program."""
        command, active = self.command, np.flatnonzero(self.phase.stance)
        self._osqp.limit.run()
        x, n = self._osqp.solve(active), len(command.acceleration)
        self._code[0] = NOT_FOUND if x is None else SOLVED
        if x is not None:
            command.acceleration[...] = x[:n]
            command.force.fill(0.0)
            command.force[active] = x[n:].reshape(-1, 3)
            command.torque[...] = self._osqp.torque(x, active)


def _complete(matrix: Any, places: NDArray[np.bool_], dense: Array) -> Any:
    """Return the sparse matrix with a number in every one of ``places``, which it lacks where a
    number of ``dense`` happens to be zero."""
    from scipy import sparse

    if matrix.nnz == np.count_nonzero(places):
        return matrix
    return sparse.csc_matrix(
        np.where(places & (dense == 0.0), _NOT_ZERO, np.where(places, dense, 0))
    )


PLAIN = "controller, plain Python"
COMPILED = "controller, kernels one by one"
FUSED = "controller, fused"
OSQP = "controller, kernels one by one, whole-body program by OSQP"
TSID = "controller, kernels one by one, whole-body controller in TSID"
BARE = "controller, no times, checks or record"
HAND = "hand-written loop of the same bodies"
QP, QP_OSQP, QP_DAQP = "whole-body program", "the same by OSQP", "the same by DAQP"
WHOLE_BODY = "state to torque"
WHOLE_BODY_OSQP = "state to torque, OSQP"
WHOLE_BODY_TSID = "state to torque, TSID"
STATE_TO_TORQUE = ("dynamics", "wbc")
"""The blocks from the estimated state to torques."""

Times = dict[str, NDArray[np.float64]]


def block_rows(controller: RecordedController, prefix: str) -> list[Row]:
    """Return the median time of every block, in the order in which they run."""
    programs = controller.ticker.programs
    for program in programs:
        program.fold()
    order = controller.bound.graph.order
    return [Row(f"{prefix}{p}", block_times(programs, p).p50_us, "us/tick") for p in order]


def controller_rows(times: Times, of_first: Times, missing: str) -> list[Row]:
    rows = [
        compare(PLAIN, of_first, COMPILED),
        Row(COMPILED, float(np.median(times[COMPILED])), "us/tick"),
        compare(FUSED, times, COMPILED),
        Row(HAND, float(np.median(times[HAND])), "us/tick"),
        compare(BARE, times, HAND, floor=1.05, goal=1.02, note="the scheduler's share"),
    ]
    if missing:
        return [*rows, Row(OSQP, None, "us/tick", COMPILED, note=missing)]
    limits = {COMPILED: (1 / 8, 1 / 12), FUSED: (1 / 20, 1 / 30)}
    return [
        *rows,
        Row(OSQP, float(np.median(times[OSQP])), "us/tick"),
        *(
            compare(
                f"{name}, beside OSQP",
                {**times, f"{name}, beside OSQP": times[name]},
                OSQP,
                floor=floor,
                goal=goal,
            )
            for name, (floor, goal) in limits.items()
        ),
    ]


def program_rows(times: Times, missing: str) -> list[Row]:
    """Return the rows of the way from model terms to accelerations, forces and torques."""
    if QP not in times:
        return []
    rows = [compare(f"{QP}, beside DAQP", {**times, f"{QP}, beside DAQP": times[QP]}, QP_DAQP,
                    floor=1 / 1.8, goal=1 / 2.5, note="DAQP without its assembly, from its own answer")]  # fmt: skip
    rows.append(Row(QP_DAQP, float(np.median(times[QP_DAQP])), "us/tick"))
    if missing:
        return [*rows, Row(QP_OSQP, None, "us/tick", QP, note=missing)]
    name = f"{QP}, beside OSQP"
    return [
        *rows,
        compare(
            name,
            {**times, name: times[QP]},
            QP_OSQP,
            floor=1 / 25,
            goal=1 / 40,
            note="OSQP at 1e-3 as in BRUCE's code, without its assembly, from its own answer",
        ),
        Row(QP_OSQP, float(np.median(times[QP_OSQP])), "us/tick"),
    ]


def state_to_torque_rows(
    own: RecordedController, osqp: RecordedController | None, missing: str
) -> list[Row]:
    """Return the rows of the dynamics and the whole-body controller, tasks included."""
    value = _sum_of(own)
    if osqp is None:
        return [Row(WHOLE_BODY, value, "us/tick", WHOLE_BODY_OSQP, note=missing)]
    other = _sum_of(osqp)
    return [
        Row(
            WHOLE_BODY,
            value,
            "us/tick",
            WHOLE_BODY_OSQP,
            value / other,
            1 / 55,
            floor=1 / 30,
            note="dynamics compiled in both",
        ),
        Row(WHOLE_BODY_OSQP, other, "us/tick"),
    ]


def _sum_of(controller: RecordedController, paths: Sequence[str] = STATE_TO_TORQUE) -> float:
    programs = controller.ticker.programs
    for program in programs:
        program.fold()
    return sum(block_times(programs, path).p50_us for path in paths)


def tsid_rows(
    times: Times,
    fused: RecordedController,
    tsid: RecordedController | None,
    check: TsidCheck | None,
) -> list[Row]:
    """Measure beside TSID, which computes the terms of the dynamics by itself."""
    value = _sum_of(fused)
    if tsid is None or check is None:
        note = f"not installed; {INSTALL}; aloft bench tick --tsid FOLDER"
        return [Row(WHOLE_BODY_TSID, None, "us/tick", WHOLE_BODY, note=note)]
    other = _sum_of(tsid, ("wbc",))
    agreed = (
        f"torques agree to {max(check.errors):.1g} N m (limit {TORQUE_ERROR:g}) in the "
        f"{len(check.errors)} states that were compared"
    )
    limits = {COMPILED: (1 / 1.5, 1 / 2), FUSED: (1 / 4, 1 / 5)}
    return [
        Row(f"{WHOLE_BODY}, beside TSID", value, "us/tick", WHOLE_BODY_TSID, value / other, 1 / 6,
            floor=1 / 4, note="TSID with its own dynamics; fused"),
        Row(WHOLE_BODY_TSID, other, "us/tick", note=agreed),
        Row(TSID, float(np.median(times[TSID])), "us/tick"),
        *(
            compare(f"{name}, beside TSID", {**times, f"{name}, beside TSID": times[name]}, TSID,
                    floor=floor, goal=goal)
            for name, (floor, goal) in limits.items()
        ),
    ]  # fmt: skip


def earlier_rows(times: Times, before: Sequence[Mapping[str, float]], commit: str) -> list[Row]:
    """Measure beside the controller of an earlier commit, which ran once for every round; its tick
    is the sum of its blocks' medians, so without its scheduler and its recording."""
    if not before:
        return [Row("controller of an earlier commit", None, "us/tick", COMPILED,
                    note="not measured; aloft bench tick --since COMMIT, in a clone")]  # fmt: skip
    name = f"controller as of {commit}, its blocks only"
    sums = np.array([sum(one.values()) for one in before])
    rows = [
        Row(f"old block {path}", float(np.median([one[path] for one in before])), "us/tick")
        for path in before[0]
    ]
    rows.append(Row(name, float(np.median(sums)), "us/tick"))
    for own, floor, goal in ((COMPILED, 1 / 12, 1 / 20), (FUSED, 1 / 30, 1 / 45)):
        ticks = np.median(times[own].reshape(len(sums), -1), axis=1)
        rows.append(
            compare(f"{own}, beside {commit}", {f"{own}, beside {commit}": ticks, name: sums}, name,
                    floor=floor, goal=goal)
        )  # fmt: skip
    return rows
