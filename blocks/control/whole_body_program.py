"""The memory of the whole-body controller's quadratic program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.whole_body_qp import PYRAMID_ROWS, Constraints, Cost, TorqueScratch


@dataclass(frozen=True)
class WholeBodyProgram:
    """The matrices of the program with a certain number of points in stance.

    ``cones`` and ``limits`` are the two parts of ``inequality``: the friction pyramids of all
    points, then the torque limits.
    """

    cost: Cost
    equality: Constraints
    inequality: Constraints
    cones: Constraints
    limits: Constraints
    scratch: TorqueScratch

    @classmethod
    def of_size(cls, n_velocities: int, count: int, limit_rows: int) -> WholeBodyProgram:
        """Zero matrices for ``count`` points in stance and ``limit_rows`` rows of torque limits."""
        size, cone_rows = n_velocities + 3 * count, PYRAMID_ROWS * count
        n_joints = n_velocities - 6
        matrix = np.zeros((cone_rows + limit_rows, size))
        bound = np.zeros(cone_rows + limit_rows)
        return cls(
            Cost(np.zeros((size, size)), np.zeros(size)),
            Constraints(np.zeros((6, size)), np.zeros(6)),
            Constraints(matrix, bound),
            Constraints(matrix[:cone_rows], bound[:cone_rows]),
            Constraints(matrix[cone_rows:], bound[cone_rows:]),
            TorqueScratch(
                np.zeros((n_joints, size)), np.zeros((n_joints, size)), np.zeros(n_joints)
            ),
        )
