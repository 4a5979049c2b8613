"""Contact points in the state of an invariant filter: adding, removing and measuring them.

The error (n,) consists of rotation, velocity, position, N contact points, gyroscope bias,
accelerometer bias and encoder offsets, in this order. The vectors of the state (2 + N, 3) are
velocity, position and contact points. A point that is not in the state has zero covariance. Leg
kinematics measure the position of a point relative to the base, R h(q - offset) in the world, with
the Jacobian R J. Residuals are r = -H e + noise, as in ``kalman_update``. No function here
allocates memory. Source: Hartley et al., Contact-aided invariant extended Kalman filtering for
robot state estimation, IJRR 2020.
"""

from __future__ import annotations

from .arrays import Array, Flags, Indices
from .kernel import kernel
from .linear import multiply_sparse, multiply_transposed


@kernel
def remove_contact(point: int, covariance: Array) -> None:
    """Remove a contact point from the state: set its covariances to zero."""
    first = 9 + 3 * point
    for i in range(first, first + 3):
        for k in range(covariance.shape[0]):
            covariance[i, k] = covariance[k, i] = 0.0


@kernel
def place_jacobian(world_jacobian: Array, offsets: int, sensitivity: Array) -> None:
    """The measurement Jacobian H (3, n) of a point's position by leg kinematics.

    The columns of the point itself are left to ``measurement_jacobian``.

    Args:
        world_jacobian: R J, (3, n_joints).
        offsets: the index of the first encoder offset in the error.
        sensitivity: becomes H.
    """
    for i in range(3):
        for k in range(offsets):
            sensitivity[i, k] = 0.0
        sensitivity[i, 6 + i] = -1.0
        for k in range(world_jacobian.shape[1]):
            sensitivity[i, offsets + k] = world_jacobian[i, k]


@kernel
def add_contact(
    point: int, sensitivity: Array, noise: Array, covariance: Array, rows: Array, corner: Array
) -> None:
    """Add a contact point to the covariance, at the position measured by leg kinematics.

    Args:
        sensitivity: H from ``place_jacobian``; the error of the new point is -H e plus noise.
        noise: covariance of the measured position [m^2], (3, 3).
        rows, corner: scratch, (3, n) and (3, 3).
    """
    first = 9 + 3 * point
    multiply_sparse(sensitivity, covariance, rows)
    multiply_transposed(rows, sensitivity, corner)
    for i in range(3):
        for k in range(covariance.shape[0]):
            rows[i, k] = -float(rows[i, k])
        for k in range(3):
            mean = 0.5 * (float(corner[i, k]) + float(corner[k, i]))  # symmetric to the last bit
            rows[i, first + k] = mean + float(noise[i, k])
    for i in range(3):
        for k in range(covariance.shape[0]):
            covariance[first + i, k] = rows[i, k]
    for i in range(3):
        for k in range(covariance.shape[0]):
            covariance[k, first + i] = rows[i, k]


@kernel
def innovation(point: int, world_point: Array, vectors: Array, residual: Array) -> None:
    """The innovation (3,) [m] of a point: its measured position minus its estimated one.

    Args:
        world_point: the measurement, from the base to the point, R h [m, world], (3,).
        residual: becomes the innovation.
    """
    for i in range(3):
        seen = float(vectors[1, i]) + float(world_point[i])
        residual[i] = seen - float(vectors[2 + point, i])


@kernel
def measurement_jacobian(point: int, sensitivity: Array) -> None:
    """Fill in the point's own columns of the measurement Jacobian from ``place_jacobian``."""
    first = 9 + 3 * point
    for i in range(3):
        for k in range(3):
            sensitivity[i, first + k] = 1.0 if i == k else 0.0


@kernel
def height_row(
    row: int, point: int, reference: int, height: float, vectors: Array,
    sensitivity: Array, residual: Array,
) -> None:  # fmt: skip
    """One row of H and r for the measured height of a point, over another point or the world.

    An error of the rotation also rotates the point's position, so the row depends on the estimate.

    Args:
        reference: the index of the other point; negative for the height over the world's origin.
        height: the measured height [m].
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
    """The measurement Jacobian H (3, n) of the world frame's definition by the feet.

    The first two rows put the world's origin at the mean x and y of the points, the third puts its
    x axis in the heading of the feet. The third row is zero if all levers are zero, because such
    points have no heading.

    Args:
        levers: horizontal positions relative to a centre, which rotate with the heading of the
            feet [m], (N, 2).
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
        # The error of a point's position is xi_d plus the effect of the rotation error about z.
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
    """Add the process noise of standing points: each moves a little, and each foot as a whole.

    Args:
        feet: the foot of every point, (N,).
        present: which points are in the state, (N,).
        own, shared: standard deviations per axis after one second [m], of a single point and of the
            common motion of a foot's points.
        period: [s].
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
