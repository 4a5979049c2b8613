"""Quadratic programs: one call, any installed solver, no exceptions.

DAQP is called directly; any other solver is called through qpsolvers, which imports SciPy and every
solver that is installed: about 0.4 s that no process pays that does without them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec

import numpy as np

from .arrays import Array

Solve = Callable[[Array, Array, Array, Array, Array, Array], Array | None]

DAQP = "daqp"
EQUALITY = 5
"""DAQP's mark of a row that is an equality."""
UNBOUNDED = -1e30


class QuadraticProgramSolver:
    """Minimises 1/2 x'Px + q'x subject to Gx <= h and Ax = b, from a cold start every time.

    A cold start makes the answer a function of the problem alone; with an active-set solver such
    as DAQP or quadprog it is also exact and the same in every process.

    Args:
        name: ``daqp``, or any solver that qpsolvers finds installed and that takes dense matrices.
        options: passed to the solver, e.g. its tolerances.

    Raises:
        LookupError: the solver is not installed; the message names those that are.
    """

    @staticmethod
    def check_name(name: str) -> None:
        """Raise ``LookupError`` if no such solver is installed; the message names those that are.

        For the usual solver this takes microseconds. For any other one qpsolvers is imported, which
        takes about 0.3 s.
        """
        if name == DAQP and find_spec("daqp") is not None:
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
        make = _daqp if name == DAQP else _any_solver
        self._solve: Solve = make(name, dict(options or {}))

    def solve(self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        """The minimiser x (n,), or ``None`` if the solver found none or failed."""
        try:
            x = self._solve(p, q, g, h, a, b)
        except Exception:  # noqa: BLE001
            # On an infeasible problem solvers raise errors of many types. The caller has a defined
            # fallback for all of them, so each means that there is no solution.
            return None
        if x is None or not np.isfinite(x).all():
            return None
        return np.asarray(x)


def _daqp(_: str, options: Mapping[str, float]) -> Solve:
    """DAQP's own function."""
    import daqp

    def solve(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        upper = np.concatenate([h, b])
        kinds = np.zeros(len(upper), np.intc)
        kinds[len(h) :] = EQUALITY
        x, _, flag, _ = daqp.solve(
            p, q, np.concatenate([g, a]), upper, np.full(len(upper), UNBOUNDED), kinds, **options
        )
        return x if flag > 0 else None

    return solve


def _any_solver(name: str, options: Mapping[str, float]) -> Solve:
    """A solver that qpsolvers calls."""
    from qpsolvers import Problem, solve_problem

    def solve(p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        answer = solve_problem(Problem(p, q, g, h, a, b), name, **options)
        return answer.x if answer.found else None

    return solve
