"""Quadratic and cone programs: one call, any installed solver, no exceptions.

DAQP and Clarabel are called directly; any other solver is called through qpsolvers, which imports SciPy
and every solver that is installed: about 0.4 s that no process pays that does without them. Programs with
round friction cones go to Clarabel, an interior-point method.

An answer counts only if it is optimal. A solver whose status says less has found none; and as some call a point
optimal that is not (ProxQP does not look at the duality gap), the optimality conditions are evaluated for every
solver that qpsolvers calls.
"""

from __future__ import annotations

import difflib
import warnings
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
NO_BOUND = 1e12
"""A bound that is larger than so many times the largest element of its row never binds, and is left out: interior-point
methods scale by it and lose the digits of all others."""
PACKAGES = {
    "clarabel": "clarabel",
    "daqp": "daqp",
    "osqp": "osqp",
    "piqp": "piqp",
    "proxqp": "proxsuite",
    "quadprog": "quadprog",
}
"""The solvers that are tested, and what pip calls them."""
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "osqp": {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 50_000},  # its own 1e-3 leaves 1 N
    "proxqp": {
        "eps_abs": 1e-9,
        "eps_rel": 0.0,
        "check_duality_gap": True,  # without, it takes points that are 0.3 N off
        "eps_duality_gap_abs": 1e-6,
        "eps_duality_gap_rel": 1e-9,
    },
}
"""Settings with which these solvers find the optimum and not a point near it, unless ``options`` say something else."""
FEASIBLE, STATIONARY, GAP = 1e-5, 1e-5, 1e-6
"""Errors that the optimality conditions may have: constraints in their units or as a share of the bounds, the gradient of the
Lagrangian as a share of its largest term, and the duality gap as a share of the cost, or absolute where that is below 1."""


class QuadraticProgramSolver:
    """Minimises 1/2 x'Px + q'x subject to Gx <= h and Ax = b, from a cold start every time.

    With Clarabel also subject to s_1 >= |(s_2, s_3)| for every three elements of s = Cx.

    A cold start makes the answer a function of the problem alone; with an active-set solver such
    as DAQP or quadprog it is also exact and the same in every process.

    Args:
        name: ``daqp``, ``clarabel``, or any solver that qpsolvers finds installed and that takes dense
            matrices; tested are those of ``PACKAGES``.
        options: passed to the solver, e.g. its tolerances.

    Raises:
        LookupError: the solver is not installed; the message says how to install it, or names those that are.
    """

    @staticmethod
    def check_name(name: str) -> None:
        """Raise ``LookupError`` if no such solver is installed; the message says how to install it, or names those
        that are.

        For the usual solvers this takes microseconds. For any other one qpsolvers is imported, which
        takes about 0.3 s.
        """
        if name in (DAQP, CLARABEL) and find_spec(name) is not None:
            return
        from qpsolvers import available_solvers

        if name not in available_solvers:
            raise LookupError(_missing(name, available_solvers))

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
        if len(h) and h.max() >= NO_BOUND:
            bounded = h < NO_BOUND * np.maximum(np.abs(g).max(1), 1e-300)
            g, h = g[bounded], h[bounded]
        try:
            x = self._solve(p, q, g, h, a, b, *cones)
        except Exception:  # noqa: BLE001
            # On an infeasible problem solvers raise errors of many types. The caller has a defined
            # fallback for all of them, so each means that there is no solution.
            return None
        if x is None or not np.isfinite(x).all():
            return None
        return np.asarray(x)


def _missing(name: str, installed: list[str]) -> str:
    if name in PACKAGES:
        return (
            f"the quadratic-program solver {name!r} is not installed: pip install {PACKAGES[name]}"
        )
    nearest = difflib.get_close_matches(name, [*installed, *PACKAGES], n=1)
    hint = f"did you mean {nearest[0]}? " if nearest else ""
    return (
        f"no quadratic-program solver {name!r} is installed; {hint}there is {', '.join(installed)}"
    )


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
    from qpsolvers import Problem, dense_solvers, solve_problem

    settings = {**SETTINGS.get(name, {}), **options}
    as_taken = (lambda matrix: matrix) if name in dense_solvers else _sparse

    def solve(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        if not all(np.isfinite(each).all() for each in (p, q, g, h, a, b)):
            return None  # ProxQP would iterate on what is no number for half a minute
        matrices = [as_taken(matrix) for matrix in (p, g, a)]
        problem = Problem(matrices[0], q, matrices[1], h, matrices[2], b)
        with (
            warnings.catch_warnings()
        ):  # about a status that is not optimal; then there is no answer
            warnings.simplefilter("ignore")
            answer = solve_problem(problem, name, **settings)
        if not answer.found or answer.x is None or not is_optimal(p, q, g, h, a, b, answer):
            return None
        return np.asarray(answer.x)

    return solve


def is_optimal(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array, answer: Any) -> bool:
    """Return whether the optimality conditions hold for ``answer.x``, with its multipliers ``y`` of the equations and
    ``z`` of the inequalities. An answer without multipliers cannot show that it is optimal.
    """
    x = answer.x
    y = np.zeros(0) if not len(b) else answer.y
    z = np.zeros(0) if not len(h) else answer.z
    if y is None or z is None or len(y) != len(b) or len(z) != len(h):
        return False
    excess = max((g @ x - h).max(initial=0.0), np.abs(a @ x - b).max(initial=0.0))
    size = max(1.0, np.abs(h).max(initial=0.0), np.abs(b).max(initial=0.0))
    terms = (p @ x, q, g.T @ z, a.T @ y)
    largest = max(np.abs(term).max(initial=0.0) for term in terms)
    gradient = np.abs(terms[0] + terms[1] + terms[2] + terms[3]).max(initial=0.0)
    gap = abs(x @ terms[0] + q @ x + h @ z + b @ y)
    cost = max(1.0, abs(x @ terms[0]), abs(q @ x))
    least = -STATIONARY * max(
        1.0, np.abs(z).max(initial=0.0)
    )  # multipliers of inequalities are not negative
    return bool(
        excess <= FEASIBLE * size
        and gradient <= STATIONARY * max(largest, 1e-12)
        and gap <= GAP * cost
        and z.min(initial=0.0) >= least
    )


TOLERANCE = 1e-9
"""Tolerance of Clarabel's gap and residuals. Much below 1e-9 it sometimes ends early, with worse
answers."""
INFEASIBILITY = 1e-12
"""Tolerance of Clarabel's proof that there is no solution. At its own 1e-8 it finds proofs for
programs that have one."""
SOLVED = "Solved"
"""The only state whose answer counts; after ``AlmostSolved`` and ``InsufficientProgress`` it may be far off."""


class Clarabel:
    """Clarabel, set up anew in every call, so the answer depends on the problem alone.

    Its data structures are not kept for the next program. That would save a fifth of the time, most of which are its ten
    iterations; but Clarabel goes on scaling by the first program's numbers, so that the same program has another answer
    (in the sixth digit) after another one, and a run that is continued from a snapshot other bytes.

    Args:
        tolerance: of the gap and the residuals.
    """

    def __init__(self, tolerance: float = TOLERANCE) -> None:
        import clarabel

        self._clarabel: Any = clarabel
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
        bound = np.hstack((b, h, np.zeros(len(c))))
        kinds = [
            self._clarabel.ZeroConeT(len(b)),
            self._clarabel.NonnegativeConeT(len(h)),
            *(self._clarabel.SecondOrderConeT(3) for _ in range(len(c) // 3)),
        ]
        square, matrix = _sparse(np.triu(p)), _sparse(np.vstack((a, g, -c)))
        return self._clarabel.DefaultSolver(square, q, matrix, bound, kinds, self._settings).solve()

    def solve(
        self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array, c: Array | None = None
    ) -> Array | None:
        """Solve the program and return the minimiser x (n,), or ``None`` if the solver found
        none."""
        answer = self.answer(p, q, g, h, a, b, np.zeros((0, len(q))) if c is None else c)
        return np.asarray(answer.x) if str(answer.status) == SOLVED else None


def _sparse(matrix: Array) -> Any:
    """Return the matrix in compressed sparse columns; SciPy's own conversion takes four times as long."""
    from scipy import sparse

    columns = matrix.T
    of_column, of_row = np.nonzero(columns)
    starts = np.searchsorted(of_column, np.arange(len(columns) + 1))
    values = columns[of_column, of_row]
    return sparse.csc_matrix((values, of_row, starts), shape=matrix.shape)


def cone_rows(count: int, n: int, first: int, friction: float) -> Array:
    """Rows C of ``QuadraticProgramSolver`` for |f_t| <= mu f_z of ``count`` forces from column ``first`` on."""
    rows = np.zeros((3 * count, n))
    for point in range(count):
        column = first + 3 * point
        rows[3 * point, column + 2] = friction
        rows[3 * point + 1, column] = rows[3 * point + 2, column + 1] = 1.0
    return rows
