"""The whole-body controller's program with round friction cones, as Clarabel takes it."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.quadratic_program import ConeProgramSolver
from ...mathematics.whole_body_qp import PYRAMID_ROWS
from .whole_body_program import FullProgram


class RoundProgram(FullProgram):
    """``FullProgram`` with |f_t| <= mu f_z in the place of the pyramids' rows."""

    def _prepare(self, solver: str) -> None:
        self._cones = ConeProgramSolver()

    def solve(self, active: Indices) -> Array | None:
        """The accelerations and then the forces of the points ``active``; none if it fails."""
        program, count = self.assemble(active), len(active)
        kept = rows_without_pyramids(count, len(program.inequality.bound))
        return self._cones.solve(
            program.cost.hessian, program.cost.gradient,
            program.inequality.matrix[kept], program.inequality.bound[kept],
            program.equality.matrix, program.equality.bound,
            float(self._weights.friction[0]), count,
        )  # fmt: skip


def rows_without_pyramids(count: int, rows: int) -> Flags:
    """Which of the inequalities are no sides of pyramids: bounds of the forces and of the torques."""
    kept = np.ones(rows, np.bool_)
    for point in range(count):
        kept[PYRAMID_ROWS * point : PYRAMID_ROWS * point + 4] = False
    return kept
