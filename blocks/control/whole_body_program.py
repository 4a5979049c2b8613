"""The memory of the whole-body controller's quadratic program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.quadratic_program import ConeProgramSolver, QuadraticProgramSolver
from ...mathematics.whole_body_qp import (
    PYRAMID_ROWS,
    Constraints,
    Cost,
    CostScratch,
    RigidBodyTerms,
    TaskRows,
    TorqueLimits,
    TorqueScratch,
    assemble_cost,
    base_dynamics,
    friction_pyramids,
    torque_limits,
)
from ...mathematics.whole_body_solution import ProgramWeights


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


class FullProgram:
    """The program in accelerations and forces, as any solver of qpsolvers takes it.

    There is a program for every number of points in stance, each of its own size, because fixing
    forces to zero by bounds would leave the feasible set without an interior.

    Args:
        solver: the solver's name.
        rows: the tasks' rows, which the tasks write.
        model: the rigid-body terms.
        limited: whether torques are limited.
        n_contacts: the number of contact points.
    """

    def __init__(
        self,
        solver: str,
        rows: TaskRows,
        model: RigidBodyTerms,
        motors: TorqueLimits,
        weights: ProgramWeights,
        *,
        limited: bool,
        n_contacts: int,
    ) -> None:
        n = rows.jacobian.shape[1]
        total = rows.jacobian.shape[0]
        self._prepare(solver)
        self._rows, self._model, self._motors, self._weights = rows, model, motors, weights
        self._limited, self._n = limited, n
        self._scratch = CostScratch(np.zeros((total, n)), np.zeros((n, n)), np.zeros(n))
        limit_rows = 2 * (n - 6) if limited else 0
        self.programs = [
            WholeBodyProgram.of_size(n, count, limit_rows) for count in range(n_contacts + 1)
        ]

    def _prepare(self, solver: str) -> None:
        """Make what solves the program."""
        self._solver = QuadraticProgramSolver(solver)

    def assemble(self, active: Indices) -> WholeBodyProgram:
        """The program for the points ``active`` in stance; the torques' bounds are up to date."""
        program, w, count = self.programs[len(active)], self._weights, len(active)
        assemble_cost(
            self._rows, float(w.acceleration[0]), float(w.force[0]), self._scratch, program.cost
        )
        base_dynamics(self._model, active, program.equality)
        friction_pyramids(
            count, self._n, float(w.friction[0]), float(w.force_min[0]), float(w.force_max[0]),
            program.cones,
        )  # fmt: skip
        if self._limited:
            torque_limits(self._model, active, self._motors, program.scratch, program.limits)
        return program

    def solve(self, active: Indices) -> Array | None:
        """The accelerations and then the forces of the points ``active``; none if it fails."""
        program = self.assemble(active)
        return self._solver.solve(
            program.cost.hessian, program.cost.gradient,
            program.inequality.matrix, program.inequality.bound,
            program.equality.matrix, program.equality.bound,
        )  # fmt: skip


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
