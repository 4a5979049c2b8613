"""Programs with round friction cones through Clarabel, an interior-point method."""

from __future__ import annotations

from typing import Any

import numpy as np

from .arrays import Array

TOLERANCE = 1e-9
"""Of Clarabel's gap and residuals. The cost hardly depends on forces that do not move the base: at 1e-8 they are
tenths of a newton wrong; much below 1e-9 Clarabel sometimes ends early, with worse ones."""
SOLVED = ("Solved", "AlmostSolved", "InsufficientProgress")
"""What it may say where its answer is as good as rounding allows at that tolerance."""


class ConeProgramSolver:
    """Minimises 1/2 x'Px + q'x subject to Ax = b, Gx <= h and |f_t| <= mu f_z for the forces f at the end of x.

    Every call sets the solver up anew, so the answer depends on the problem alone.

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
        self._settings.max_threads = 1

    def answer(
        self,
        p: Array,
        q: Array,
        g: Array,
        h: Array,
        a: Array,
        b: Array,
        friction: float,
        count: int,
    ) -> Any:
        """All that Clarabel says of the program: its ``status``, the minimiser ``x``, slacks ``s`` and
        multipliers ``z`` of the equations, then of the inequalities, then of the cones.

        Args:
            friction: mu.
            count: the number of forces, three elements each, at the end of x.
        """
        n = len(q)
        cones = np.zeros((3 * count, n))
        for point in range(count):
            column = n - 3 * (count - point)
            cones[3 * point, column + 2] = -friction
            cones[3 * point + 1, column] = cones[3 * point + 2, column + 1] = -1.0
        matrix = self._sparse.csc_matrix(np.vstack((a, g, cones)))
        bound = np.hstack((b, h, np.zeros(3 * count)))
        kinds = [
            self._clarabel.ZeroConeT(len(b)),
            self._clarabel.NonnegativeConeT(len(h)),
            *(self._clarabel.SecondOrderConeT(3) for _ in range(count)),
        ]
        square = self._sparse.triu(self._sparse.csc_matrix(p), format="csc")
        return self._clarabel.DefaultSolver(square, q, matrix, bound, kinds, self._settings).solve()

    def solve(
        self,
        p: Array,
        q: Array,
        g: Array,
        h: Array,
        a: Array,
        b: Array,
        friction: float,
        count: int,
    ) -> Array | None:
        """The minimiser x (n,), or ``None`` if the solver found none; arguments as for ``answer``."""
        answer = self.answer(p, q, g, h, a, b, friction, count)
        if str(answer.status) not in SOLVED:
            return None
        x = np.asarray(answer.x)
        return x if np.isfinite(x).all() else None
