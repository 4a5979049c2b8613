"""The whole-body program as other solvers get it: OSQP in the way of BRUCE's public walking code,
and DAQP through its own interface.

Both solve the very program that the controller's own method solves, from the same rows of tasks and
with the same limits. BRUCE's code (``Play/Walking/low_level.py`` of its public simulation) stacks
equalities and inequalities into one dense matrix, makes sparse matrices of it and of the Hessian in
every tick, and hands their numbers to a solver that was set up once, with OSQP's own tolerances.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...blocks.control.whole_body_controller import WholeBodyController
from ...blocks.control.whole_body_program import FullProgram, WholeBodyProgram
from ...mathematics.arrays import Array, Indices
from ...mathematics.whole_body_qp import (
    FrictionCone,
    friction_pyramids,
)

OSQP_TOLERANCE = 1e-3
"""Absolute and relative, as in BRUCE's code."""
_NOT_ZERO = 1e-300
"""Stands for a zero in a place where the solver expects a number."""
_EQUALITY = 5
"""DAQP's mark of an equality."""


class PeerProgram(FullProgram):
    """The program with its matrices assembled by NumPy, as a user of these solvers would do it."""

    def __init__(self, block: WholeBodyController) -> None:
        self._limited = block.params.limits != "none"
        super().__init__(
            "daqp", block._rows, block._model, block._motors, block._weights,
            limited=self._limited, n_contacts=len(block.robot.contacts),
        )  # fmt: skip

    def assemble(self, active: Indices) -> WholeBodyProgram:
        """The program for the points ``active`` in stance."""
        program, rows, model, w = self.programs[len(active)], self._rows, self._model, self._weights
        n, joints = self._n, self._n - 6
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
        cone = FrictionCone(float(w.friction[0]), float(w.force_min[0]), float(w.force_max[0]))
        friction_pyramids(len(active), n, cone, program.cones)
        if self._limited:
            turn, limits = self._motors.to_torque, program.limits
            limits.matrix[:joints, :n] = turn @ model.mass_matrix[6:]
            limits.matrix[:joints, n:] = turn @ transposed[6:]
            limits.matrix[joints:] = -limits.matrix[:joints]
            offset = turn @ model.nonlinear[6:]
            limits.bound[:joints] = self._motors.bounds.upper - offset
            limits.bound[joints:] = offset - self._motors.bounds.lower
        return program

    def solve(self, active: Indices) -> Array | None:
        """The accelerations and then the forces of the points ``active``; none if it fails."""
        return self.solve_assembled(self.assemble(active), len(active))

    def solve_assembled(self, program: WholeBodyProgram, count: int) -> Array | None:
        """The same, for a program with ``count`` points in stance whose matrices are ready."""
        raise NotImplementedError


def stacked(program: WholeBodyProgram) -> tuple[Array, Array, Array]:
    """Equalities and inequalities as lower <= matrix x <= upper."""
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

    def solve_assembled(self, program: WholeBodyProgram, count: int) -> Array | None:
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

    def solve_assembled(self, program: WholeBodyProgram, count: int) -> Array | None:
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

    While ``learning`` is true, the whole program's usual solver does the work."""

    learning = True

    def setup(self) -> None:
        super().setup()
        usual = self._other
        self._own = False
        self._arrange()
        program = OsqpProgram(self)
        solve = program.solve

        def solve_or_learn(active: Indices) -> Array | None:
            if self.learning:
                program.learn(active)
                return usual.solve(active)
            return solve(active)

        program.solve = solve_or_learn  # type: ignore[method-assign]  # a recorder in its place
        self._other = program


def _complete(matrix: Any, places: NDArray[np.bool_], dense: Array) -> Any:
    """The sparse matrix with a number in every one of ``places``, which it lacks where a number of
    ``dense`` happens to be zero."""
    from scipy import sparse

    if matrix.nnz == np.count_nonzero(places):
        return matrix
    return sparse.csc_matrix(
        np.where(places & (dense == 0.0), _NOT_ZERO, np.where(places, dense, 0))
    )
