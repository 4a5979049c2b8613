"""Quadratic and cone programs: one call, any installed solver, no exceptions.

DAQP and Clarabel are called directly; any other solver is called through qpsolvers, which imports SciPy
and every solver that is installed: about 0.4 s that no process pays that does without them. Programs with
round friction cones go to Clarabel, an interior-point method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np

from .arrays import Array

Solve = Callable[..., Array | None]

DAQP, CLARABEL = "daqp", "clarabel"
EQUALITY = 5
"""DAQP's mark of a row that is an equality."""
UNBOUNDED = -1e30


class QuadraticProgramSolver:
    """Minimises 1/2 x'Px + q'x subject to Gx <= h and Ax = b, from a cold start every time.

    With Clarabel also subject to s_1 >= |(s_2, s_3)| for every three elements of s = Cx.

    A cold start makes the answer a function of the problem alone; with an active-set solver such
    as DAQP or quadprog it is also exact and the same in every process.

    Args:
        name: ``daqp``, ``clarabel``, or any solver that qpsolvers finds installed and that takes dense
            matrices.
        options: passed to the solver, e.g. its tolerances.

    Raises:
        LookupError: the solver is not installed; the message names those that are.
    """

    @staticmethod
    def check_name(name: str) -> None:
        """Raise ``LookupError`` if no such solver is installed; the message names those that are.

        For the usual solvers this takes microseconds. For any other one qpsolvers is imported, which
        takes about 0.3 s.
        """
        if name in (DAQP, CLARABEL) and find_spec(name) is not None:
            return
        from qpsolvers import available_solvers

        if name not in available_solvers:
            raise LookupError(
                f"no quadratic-program solver {name!r} is installed; "
                f"there is {', '.join(available_solvers)}"
            )

    def __init__(self, name: str, options: dict[str, float] | None = None) -> None:
        self.check_name(name)
        self.name = name
        given = dict(options or {})
        self._solve: Solve
        if name == CLARABEL:
            self._solve = Clarabel(**given).solve
        elif name == DAQP:
            self._solve = _daqp(given)
        else:
            self._solve = _any_solver(name, given)

    def solve(
        self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array, c: Array | None = None
    ) -> Array | None:
        """Solve the program and return the minimiser x (n,), or ``None`` if the solver found none
        or failed.

        Args:
            c: the rows C of cones, (3 k, n); only for Clarabel.

        Raises:
            ValueError: there are cones, and the solver is another one.
        """
        if c is not None and self.name != CLARABEL:
            raise ValueError(f"{self.name} has no cones; {CLARABEL} has")
        cones = () if c is None else (c,)
        try:
            x = self._solve(p, q, g, h, a, b, *cones)
        except Exception:  # noqa: BLE001
            # On an infeasible problem solvers raise errors of many types. The caller has a defined
            # fallback for all of them, so each means that there is no solution.
            return None
        if x is None or not np.isfinite(x).all():
            return None
        return np.asarray(x)


def _daqp(options: Mapping[str, float]) -> Solve:
    """DAQP's own function. With equalities in the last rows it calls some programs infeasible that are not."""
    import daqp

    def solve(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        upper = np.concatenate([b, h])
        lower = np.concatenate([b, np.full(len(h), UNBOUNDED)])
        kinds = np.zeros(len(upper), np.intc)
        kinds[: len(b)] = EQUALITY
        x, _, flag, _ = daqp.solve(p, q, np.concatenate([a, g]), upper, lower, kinds, **options)
        return x if flag > 0 else None

    return solve


def _any_solver(name: str, options: Mapping[str, float]) -> Solve:
    """Make a solver that qpsolvers calls."""
    from qpsolvers import Problem, solve_problem

    def solve(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        answer = solve_problem(Problem(p, q, g, h, a, b), name, **options)
        return answer.x if answer.found else None

    return solve


TOLERANCE = 1e-9
"""Tolerance of Clarabel's gap and residuals. Much below 1e-9 it sometimes ends early, with worse
answers."""
INFEASIBILITY = 1e-12
"""Tolerance of Clarabel's proof that there is no solution. At its own 1e-8 it finds proofs for
programs that have one."""
SOLVED = ("Solved", "AlmostSolved", "InsufficientProgress")
"""States in which its answer is as good as rounding allows at that tolerance."""


class Clarabel:
    """Clarabel, set up anew in every call, so the answer depends on the problem alone.

    Args:
        tolerance: of the gap and the residuals.
    """

    def __init__(self, tolerance: float = TOLERANCE) -> None:
        import clarabel
        from scipy import sparse

        self._clarabel: Any = clarabel
        self._sparse: Any = sparse
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
            setattr(self._settings, name, tolerance)
        for name in ("tol_infeas_abs", "tol_infeas_rel"):
            setattr(self._settings, name, INFEASIBILITY)
        self._settings.max_threads = 1

    def answer(self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array, c: Array) -> Any:
        """Solve the program and return Clarabel's whole answer: its ``status``, the minimiser
        ``x``, slacks ``s`` and multipliers ``z`` of the equations, then of the inequalities, then
        of the cones."""
        matrix = self._sparse.csc_matrix(np.vstack((a, g, -c)))
        bound = np.hstack((b, h, np.zeros(len(c))))
        kinds = [
            self._clarabel.ZeroConeT(len(b)),
            self._clarabel.NonnegativeConeT(len(h)),
            *(self._clarabel.SecondOrderConeT(3) for _ in range(len(c) // 3)),
        ]
        square = self._sparse.triu(self._sparse.csc_matrix(p), format="csc")
        return self._clarabel.DefaultSolver(square, q, matrix, bound, kinds, self._settings).solve()

    def solve(
        self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array, c: Array | None = None
    ) -> Array | None:
        """Solve the program and return the minimiser x (n,), or ``None`` if the solver found
        none."""
        answer = self.answer(p, q, g, h, a, b, np.zeros((0, len(q))) if c is None else c)
        return np.asarray(answer.x) if str(answer.status) in SOLVED else None


def cone_rows(count: int, n: int, first: int, friction: float) -> Array:
    """Rows C of ``QuadraticProgramSolver`` for |f_t| <= mu f_z of ``count`` forces from column ``first`` on."""
    rows = np.zeros((3 * count, n))
    for point in range(count):
        column = first + 3 * point
        rows[3 * point, column + 2] = friction
        rows[3 * point + 1, column] = rows[3 * point + 2, column + 1] = 1.0
    return rows
