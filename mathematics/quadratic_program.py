"""Quadratic programs through qpsolvers: one call, any installed solver, no exceptions."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from .arrays import Array


class QuadraticProgramSolver:
    """Minimises 1/2 x'Px + q'x subject to Gx <= h and Ax = b, from a cold start every time.

    A cold start makes the answer a function of the problem alone; with an active-set solver such
    as DAQP or quadprog it is also exact and the same in every process.

    Args:
        name: any solver that qpsolvers finds installed and that takes dense matrices.
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
        if name == "daqp" and find_spec("daqp") is not None:
            return
        from qpsolvers import available_solvers

        if name not in available_solvers:
            raise LookupError(
                f"no quadratic-program solver {name!r} is installed; "
                f"there is {', '.join(available_solvers)}"
            )

    def __init__(self, name: str, options: dict[str, float] | None = None) -> None:
        from qpsolvers import Problem, solve_problem

        self.check_name(name)
        self.name = name
        self._options = dict(options or {})
        self._problem: Any = Problem
        self._solve: Any = solve_problem

    def solve(self, p: Array, q: Array, g: Array, h: Array, a: Array, b: Array) -> Array | None:
        """The minimiser x (n,), or ``None`` if the solver found none or failed."""
        try:
            answer = self._solve(self._problem(p, q, g, h, a, b), self.name, **self._options)
        except Exception:  # noqa: BLE001
            # On an infeasible problem solvers raise errors of many types. The caller has a defined
            # fallback for all of them, so each means that there is no solution.
            return None
        x = answer.x
        if not answer.found or x is None or not np.isfinite(x).all():
            return None
        return np.asarray(x)
