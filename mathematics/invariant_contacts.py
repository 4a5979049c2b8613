"""Contact points in the state of an invariant filter: how they come, go and are measured.

The error's order is rotation, velocity, position, N contact points, gyroscope's bias,
accelerometer's bias, encoders' offsets; vectors of the state are velocity, position, contact
points (2 + N, 3). A point that is not in the state has no covariance. Leg kinematics say where a
point is from the base: R h(q - offset), with Jacobian R J in the world. Residuals are -H times the
error plus noise, as ``kalman_update`` wants them. Nothing here allocates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernel import kernel

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]


@kernel
def remove_contact(point: int, covariance: Array) -> None:
    """Take a contact point out of the state."""
    first = 9 + 3 * point
    covariance[first : first + 3, :] = 0.0
    covariance[:, first : first + 3] = 0.0


@kernel
def place_jacobian(world_jacobian: Array, offsets: int, sensitivity: Array) -> None:
    """H (3, n) of where a point is by leg kinematics, but for the point's own columns.

    Args:
        world_jacobian: R J, (3, n_joints).
        offsets: the index of the first encoder offset in the error.
    """
    for i in range(3):
        for k in range(offsets):
            sensitivity[i, k] = 0.0
        sensitivity[i, 6 + i] = -1.0
    sensitivity[:, offsets : offsets + world_jacobian.shape[1]] = world_jacobian


@kernel
def add_contact(
    point: int, sensitivity: Array, noise: Array, covariance: Array, rows: Array, corner: Array
) -> None:
    """Put a contact point into the state, where leg kinematics see it now.

    Args:
        sensitivity: from ``place_jacobian``; minus it times the error is the point's error.
        noise: of the place that is seen [m^2], (3, 3).
        rows, corner: scratch, (3, n) and (3, 3).
    """
    first = 9 + 3 * point
    np.dot(sensitivity, covariance, rows)
    np.dot(rows, sensitivity.T, corner)
    np.add(corner, noise, corner)
    for i in range(3):
        for k in range(covariance.shape[0]):
            rows[i, k] = -float(rows[i, k])
        for k in range(3):
            rows[i, first + k] = corner[i, k]
    covariance[first : first + 3, :] = rows
    covariance[:, first : first + 3] = rows.T


@kernel
def innovation(point: int, world_point: Array, vectors: Array, residual: Array) -> None:
    """The residual of a point in the state: where the legs see it, less where it is.

    Args:
        world_point: from the base to the point, R h [m, world], (3,).
    """
    for i in range(3):
        seen = float(vectors[1, i]) + float(world_point[i])
        residual[i] = seen - float(vectors[2 + point, i])


@kernel
def measurement_jacobian(point: int, sensitivity: Array) -> None:
    """Complete H from ``place_jacobian`` by the point's own columns."""
    first = 9 + 3 * point
    for i in range(3):
        for k in range(3):
            sensitivity[i, first + k] = 1.0 if i == k else 0.0


@kernel
def height_row(
    row: int, point: int, reference: int, height: float, vectors: Array,
    sensitivity: Array, residual: Array,
) -> None:  # fmt: skip
    """A row of H and r that says how high a point is: over another one, or over the world's zero.

    The place of a point turns with the error of rotation, so its row depends on the estimate.

    Args:
        reference: the other point; none if below zero.
        height: of the point, or of its height over the other one [m].
    """
    for k in range(sensitivity.shape[1]):
        sensitivity[row, k] = 0.0
    x, y = float(vectors[2 + point, 0]), float(vectors[2 + point, 1])
    z = float(vectors[2 + point, 2])
    sensitivity[row, 9 + 3 * point + 2] = 1.0
    if reference >= 0:
        x -= float(vectors[2 + reference, 0])
        y -= float(vectors[2 + reference, 1])
        z -= float(vectors[2 + reference, 2])
        sensitivity[row, 9 + 3 * reference + 2] = -1.0
    sensitivity[row, 0], sensitivity[row, 1] = y, -x
    residual[row] = height - z


@kernel
def world_definition_jacobian(levers: Array, vectors: Array, sensitivity: Array) -> None:
    """H (3, n) of where the world is by the feet: its origin in the points' middle, x and y, and
    its x axis where the feet point.

    The third row is zero where the levers are: such points show no heading.

    Args:
        levers: places about a middle that turn with the feet's heading [m], (N, 2).
    """
    n, total = levers.shape[0], 0.0
    for row in range(3):
        for k in range(sensitivity.shape[1]):
            sensitivity[row, k] = 0.0
    for point in range(n):
        ahead, aside = float(levers[point, 0]), float(levers[point, 1])
        total += ahead * ahead + aside * aside
    for point in range(n):
        column = 9 + 3 * point
        x, y = float(vectors[2 + point, 0]), float(vectors[2 + point, 1])
        # The error of a place is xi_d and what the error of rotation about z makes of it.
        sensitivity[0, column] = 1.0 / n
        sensitivity[0, 2] -= y / n
        sensitivity[1, column + 1] = 1.0 / n
        sensitivity[1, 2] += x / n
        if total > 0.0:
            ahead, aside = float(levers[point, 0]) / total, float(levers[point, 1]) / total
            sensitivity[2, column] = -aside
            sensitivity[2, column + 1] = ahead
            sensitivity[2, 2] += x * ahead + y * aside


@kernel
def add_contact_noise(
    feet: Indices, present: Flags, own: float, shared: float, period: float, covariance: Array
) -> None:
    """What stands moves a little in a period: the points of a foot together, each by itself.

    Args:
        feet: the foot of every point, (N,).
        own, shared: standard deviations after a second, per axis [m].
    """
    for point in range(feet.shape[0]):
        for other in range(feet.shape[0]):
            if not present[point] or not present[other] or feet[point] != feet[other]:
                continue
            variance = shared * shared * period
            if point == other:
                variance += own * own * period
            for k in range(3):
                covariance[9 + 3 * point + k, 9 + 3 * other + k] += variance
