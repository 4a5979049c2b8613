"""The whole-body program in accelerations and forces, in NumPy, as a user of other solvers would write it.

The controller eliminates the accelerations. Peers in benchmarks get this one, and proofs that the own
method is right are made with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...blocks.control.whole_body_controller import WholeBodyController
from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.whole_body_qp import (
    NO_LIMITS,
    PYRAMID_ROWS,
    RigidBodyTerms,
    WholeBodyProgram,
    limit_torques,
)


class Cost(NamedTuple):
    """1/2 x' hessian x + gradient' x over x = [a; f]."""

    hessian: Array
    gradient: Array


class Constraints(NamedTuple):
    """Rows of ``matrix`` x = ``bound``, or of ``matrix`` x <= ``bound``."""

    matrix: Array
    bound: Array


class FullMatrices(NamedTuple):
    """The program's matrices. ``cones`` and ``limits`` are the two parts of ``inequality``: the friction
    pyramids of all points, then the torque limits."""

    cost: Cost
    equality: Constraints
    inequality: Constraints
    cones: Constraints
    limits: Constraints


class FullProgram:
    """The program of a controller's present state.

    There are matrices for every number of points in stance, each of its own size, because fixing
    forces to zero by bounds would leave the feasible set without an interior.
    """

    def __init__(self, block: WholeBodyController) -> None:
        self.data: WholeBodyProgram = block._program
        self._n = len(block.command.acceleration)
        self._limited = self.data.motors.kind != NO_LIMITS
        self.limit = KernelCall(limit_torques, self.data.joint_velocity, self.data.motors)
        """Computes the torques' limits, which ``assemble`` takes as they are."""
        rows = 2 * (self._n - 6) if self._limited else 0
        self.matrices = [
            self._of_size(count, rows) for count in range(len(block.command.force) + 1)
        ]

    def _of_size(self, count: int, limit_rows: int) -> FullMatrices:
        """Return zero matrices for ``count`` points in stance and ``limit_rows`` rows of torque
        limits."""
        size, cone_rows = self._n + 3 * count, PYRAMID_ROWS * count
        matrix, bound = np.zeros((cone_rows + limit_rows, size)), np.zeros(cone_rows + limit_rows)
        return FullMatrices(
            Cost(np.zeros((size, size)), np.zeros(size)),
            Constraints(np.zeros((6, size)), np.zeros(6)),
            Constraints(matrix, bound),
            Constraints(matrix[:cone_rows], bound[:cone_rows]),
            Constraints(matrix[cone_rows:], bound[cone_rows:]),
        )

    def assemble(self, active: Indices) -> FullMatrices:
        """Assemble the program for the points ``active`` in stance."""
        program, rows, model = self.matrices[len(active)], self.data.tasks, self.data.terms
        w, motors, n = self.data.weights, self.data.motors, self._n
        joints = n - 6
        weighted = rows.weights[:, None] * rows.jacobian
        program.cost.hessian[:n, :n] = rows.jacobian.T @ weighted
        program.cost.gradient[:n] = -(rows.desired @ weighted)
        diagonal = program.cost.hessian.reshape(-1)[:: program.cost.hessian.shape[0] + 1]
        diagonal[:n] += w.acceleration[0]
        diagonal[n:] = w.force[0]
        transposed = -model.jacobian[active].reshape(-1, n).T
        program.equality.matrix[:, :n] = model.mass_matrix[:6]
        program.equality.matrix[:, n:] = transposed[:6]
        program.equality.bound[:] = -model.nonlinear[:6]
        mu = w.friction[0]
        pyramid = np.array(
            [[1, 0, -mu], [-1, 0, -mu], [0, 1, -mu], [0, -1, -mu], [0, 0, 1], [0, 0, -1]]
        )
        bounds = np.array([0.0, 0.0, 0.0, 0.0, w.force_max[0], -w.force_min[0]])
        for j in range(len(active)):
            first = PYRAMID_ROWS * j
            program.cones.matrix[first : first + 6, n + 3 * j : n + 3 * j + 3] = pyramid
            program.cones.bound[first : first + 6] = bounds
        if self._limited:
            turn, limits = motors.to_torque, program.limits
            limits.matrix[:joints, :n] = turn @ model.mass_matrix[6:]
            limits.matrix[:joints, n:] = turn @ transposed[6:]
            limits.matrix[joints:] = -limits.matrix[:joints]
            offset = turn @ model.nonlinear[6:]
            limits.bound[:joints] = motors.upper - offset
            limits.bound[joints:] = offset - motors.lower
        return program

    def torque(self, x: Array, active: Indices) -> Array:
        """Compute the joint torques of x = [a; f]."""
        n = self._n
        return joint_torque(self.data.terms, x[:n], x[n:].reshape(-1, 3), active)


def joint_torque(
    terms: RigidBodyTerms, acceleration: Array, force: Array, active: Indices
) -> Array:
    """Compute tau = M_j a + h_j - sum J_j' f (paper, opt_torque), (n_joints,) [N m], for forces of
    ``active`` points."""
    torque: Array = terms.mass_matrix[6:] @ acceleration + terms.nonlinear[6:]
    for point, each in zip(active, force, strict=True):
        torque -= each @ terms.jacobian[point, :, 6:]
    return torque


def rows_without_pyramids(count: int, rows: int) -> Flags:
    """Mark the inequalities that are no sides of pyramids: bounds of the forces and of the torques."""
    kept = np.ones(rows, np.bool_)
    for point in range(count):
        kept[PYRAMID_ROWS * point : PYRAMID_ROWS * point + 4] = False
    return kept
