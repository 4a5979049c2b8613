"""The forces on a foot from the torques of its leg, which the blocks that feel the ground share."""

from __future__ import annotations

from ...mathematics.arrays import Array1D, Array2D, Array3D, Indices1D
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import solve_positive

_DAMPING = 1e-6
"""Added to the squared lever arms [m^2] of the joints, so that a straight leg has a finite inverse."""


@kernel
def solve_leg(
    foot: int,
    jacobian: Array3D,
    needed: Array1D,
    leg: Indices1D,
    foot_of_point: Indices1D,
    first: int,
    normal: Array2D,
    solution: Array1D,
) -> None:
    """Solve (J' J + damping) y = n for the joints of a leg. The forces of least norm on its points are J y.

    Args:
        jacobian: of all contact points, (n_contacts, 3, n_velocities).
        needed: torques that the ground gives the joints, J' f, (n_joints,) [N m].
        leg: joints of the foot's leg, then -1.
        first: where the joints begin in the generalised velocity.
        normal: scratch (n_leg_joints, n_leg_joints).
        solution: y (n_leg_joints,).
    """
    normal[:] = 0.0
    solution[:] = 0.0
    for i in range(leg.shape[0]):
        normal[i, i] = _DAMPING
        if leg[i] >= 0:
            solution[i] = needed[leg[i]]
    for point in range(foot_of_point.shape[0]):
        if foot_of_point[point] != foot:
            continue
        for axis in range(3):
            row = jacobian[point, axis]
            for i in range(leg.shape[0]):
                for j in range(leg.shape[0]):
                    if leg[i] >= 0 and leg[j] >= 0:
                        normal[i, j] += row[first + leg[i]] * row[first + leg[j]]
    solve_positive(normal, solution)


@kernel
def force_along(row: Array1D, leg: Indices1D, solution: Array1D, first: int) -> float:
    """One component of the force on a point: its ``row`` of J (n_velocities,) times y."""
    force = 0.0
    for i in range(leg.shape[0]):
        if leg[i] >= 0:
            force += row[first + leg[i]] * solution[i]
    return force
