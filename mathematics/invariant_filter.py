"""The right-invariant extended Kalman filter: time update, contact points in its state, measurement update.

The error e (n,) of a state consists of the logarithm of estimate times inverse truth on SE_{2+N}(3)
(rotation, velocity, position and N contact points, all in the world), followed by estimate minus
truth of gyroscope bias, accelerometer bias and encoder offsets, in this order. The vectors of the state
(2 + N, 3) are velocity, position and contact points. A point that is not in the state has zero covariance.

Without biases the error obeys a linear equation that does not depend on the trajectory (theorem 1): an
error of tilt lets gravity cause an error of velocity, and that an error of position::

    xi_R' = 0,   xi_v' = [g]x xi_R,   xi_p' = xi_v,   xi_d' = 0

A bias enters through the adjoint of the estimate. Leg kinematics measure the position of a point relative
to the base, R h(q - offset) in the world, with the Jacobian R J.

The measurement update takes three rows at a time. With the covariance P (n, n) and the residual
r = -H e + noise the estimate is corrected by K r. Rows that a measurement does not need are zero in H
and r and have a noise of one. No function here allocates memory.

Source: Hartley et al., Contact-aided invariant extended Kalman filtering for robot state estimation,
IJRR 2020.
"""

from __future__ import annotations

import math

from .arrays import (
    Array1D,
    Array2D,
    Flags1D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from .kernel import kernel
from .linear_algebra import (
    make_symmetric,
    multiply_matrices,
    multiply_sparse,
    multiply_transposed,
    multiply_vector,
    transpose,
)


@kernel
def error_transition(gravity: float, period: float, transition: Array2D) -> None:
    """Compute the constant part of the transition matrix F (n, n): the exponential of the equation
    above.

    ``gravity`` is in m/s^2, ``period`` in s.
    """
    for i in range(transition.shape[0]):
        for k in range(transition.shape[1]):
            transition[i, k] = 1.0 if i == k else 0.0
    # [g]x of (0, 0, -gravity)
    transition[3, 1], transition[4, 0] = gravity * period, -gravity * period
    transition[6, 1] = 0.5 * gravity * period * period
    transition[7, 0] = -0.5 * gravity * period * period
    for i in range(3):
        transition[6 + i, 3 + i] = period


@kernel
def input_jacobian(
    rotation: Matrix3,
    vectors: Rows3,
    present: Flags1D,
    gravity: float,
    period: float,
    reach: Array2D,
) -> None:
    """Compute the effect of a constant IMU error on the state's error over one period: ``reach``
    (n, 6).

    The columns of ``reach`` are for angular velocity [rad/s, body] and specific force [m/s^2,
    body]. The matrix is minus the adjoint of the estimate, integrated to second order.

    Args:
        rotation: the estimated orientation (3, 3), in the middle of the period.
        vectors: the estimated velocity, position and contact points (2 + N, 3), in the middle of
            the period, too.
        present: which contact points are in the state, (N,); the rows of the others are zero.
    """
    for j in range(3):
        x, y, z = rotation[0, j], rotation[1, j], rotation[2, j]
        reach[0, j], reach[1, j], reach[2, j] = -period * x, -period * y, -period * z
        for k in range(vectors.shape[0]):
            row = 3 * k + 3
            if k >= 2 and not present[k - 2]:
                reach[row, j] = reach[row + 1, j] = reach[row + 2, j] = 0.0
                continue
            a, b, c = vectors[k, 0], vectors[k, 1], vectors[k, 2]
            if k == 0:  # the tilt error that grows during the period acts for half of it on average
                c -= 0.5 * gravity * period
            elif k == 1:
                a += 0.5 * period * vectors[0, 0]
                b += 0.5 * period * vectors[0, 1]
                c += 0.5 * period * vectors[0, 2]
            reach[row, j] = -period * (b * z - c * y)
            reach[row + 1, j] = -period * (c * x - a * z)
            reach[row + 2, j] = -period * (a * y - b * x)
        reach[3, j + 3], reach[4, j + 3], reach[5, j + 3] = -period * x, -period * y, -period * z
        half = -0.5 * period * period
        reach[6, j + 3], reach[7, j + 3], reach[8, j + 3] = half * x, half * y, half * z


@kernel
def propagate_covariance(
    transition: Array2D, reach: Array2D, bias: int, noise: Array1D, covariance: Array2D,
    scaled: Array2D, product: Array2D,
) -> None:  # fmt: skip
    """Propagate the covariance P (n, n) over one period: F P F' + W W'.

    W is ``reach`` with its columns scaled by the noise of the IMU's samples. P must be symmetric to the
    last bit, and is so afterwards.

    Args:
        transition: F; ``reach`` is written into its columns of the biases.
        reach: from ``input_jacobian``, (n, 6).
        bias: the index of the first of the six bias columns.
        noise: standard deviations of angular velocity and specific force, (6,).
        scaled, product: scratch, (n, 6) and (n, n).
    """
    n = covariance.shape[0]
    for i in range(bias):
        for k in range(6):
            transition[i, bias + k] = reach[i, k]
    multiply_sparse(transition, covariance, product)
    transpose(product)
    multiply_sparse(transition, product, covariance)
    for i in range(n):
        for k in range(6):
            scaled[i, k] = reach[i, k] * noise[k]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(6):
                total += scaled[i, k] * scaled[j, k]
            covariance[i, j] += total
    make_symmetric(covariance)


@kernel
def vector_deviation(covariance: Array2D, first: int, vector: Vector3) -> float:
    """Return the standard deviation of the length of a vector's error in the world.

    The error of a vector u is xi_u plus the effect of the rotation error: xi_u + xi_R x u.

    Args:
        first: the index of xi_u in the error.
        vector: u, (3,).
    """
    total = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b = vector[k], -vector[j]  # (xi_R x u)_i = u_k xi_j - u_j xi_k
        total += covariance[first + i, first + i]
        total += 2.0 * (a * covariance[first + i, j] + b * covariance[first + i, k])
        total += a * a * covariance[j, j] + b * b * covariance[k, k]
        total += 2.0 * a * b * covariance[j, k]
    return math.sqrt(total) if total > 0.0 else 0.0


@kernel
def sample_deviations(
    reading: Vector3, limit: float, noise: float, doubt: float, run: Indices1D, out: Vector3
) -> bool:
    """Compute the standard deviations of a sample's axes, (3,); return whether an axis is
    saturated.

    The error of a saturated axis is nearly the same in consecutive samples. So over n samples it
    grows in proportion to n, not to the square root of n as independent noise does.

    Args:
        reading: a sample, (3,).
        limit: the end of the sensor's range, in the unit of the sample.
        noise, doubt: standard deviations of an axis inside its range, and of a saturated axis.
        run: for how many samples in a row each axis has been saturated, (3,); it is updated.
        out: becomes the standard deviations, (3,).
    """
    any_full = False
    for axis in range(3):
        out[axis] = noise
        if abs(reading[axis]) >= 0.999 * limit:
            run[axis] += 1
            out[axis] = doubt * math.sqrt(2.0 * run[axis] - 1.0)
            any_full = True
        else:
            run[axis] = 0
    return any_full


@kernel
def remove_contact(point: int, covariance: Array2D) -> None:
    """Remove a contact point from the state: set its covariances to zero."""
    first = 9 + 3 * point
    for i in range(first, first + 3):
        for k in range(covariance.shape[0]):
            covariance[i, k] = covariance[k, i] = 0.0


@kernel
def position_jacobian(world_jacobian: Array2D, offsets: int, jacobian: Array2D) -> None:
    """Compute the measurement Jacobian H (3, n) of a point's position by leg kinematics.

    The columns of the point itself are left to ``measurement_jacobian``.

    Args:
        world_jacobian: R J, (3, n_joints).
        offsets: the index of the first encoder offset in the error.
        jacobian: becomes H.
    """
    for i in range(3):
        for k in range(offsets):
            jacobian[i, k] = 0.0
        jacobian[i, 6 + i] = -1.0
        for k in range(world_jacobian.shape[1]):
            jacobian[i, offsets + k] = world_jacobian[i, k]


@kernel
def add_contact(
    point: int,
    jacobian: Array2D,
    noise: Matrix3,
    covariance: Array2D,
    rows: Array2D,
    corner: Matrix3,
) -> None:
    """Add a contact point to the covariance, at the position measured by leg kinematics.

    Args:
        jacobian: H from ``position_jacobian``; the error of the new point is -H e plus noise.
        noise: covariance of the measured position [m^2], (3, 3).
        rows, corner: scratch, (3, n) and (3, 3).
    """
    first = 9 + 3 * point
    multiply_sparse(jacobian, covariance, rows)
    multiply_transposed(rows, jacobian, corner)
    for i in range(3):
        for k in range(covariance.shape[0]):
            rows[i, k] = -rows[i, k]
        for k in range(3):
            mean = 0.5 * (corner[i, k] + corner[k, i])  # symmetric to the last bit
            rows[i, first + k] = mean + noise[i, k]
    for i in range(3):
        for k in range(covariance.shape[0]):
            covariance[first + i, k] = rows[i, k]
    for i in range(3):
        covariance[:, first + i] = rows[i]


@kernel
def innovation(point: int, world_point: Vector3, vectors: Rows3, residual: Vector3) -> None:
    """Compute the innovation (3,) [m] of a point: its measured position minus its estimated one.

    Args:
        world_point: the measurement, from the base to the point, R h [m, world], (3,).
        residual: becomes the innovation.
    """
    residual[:] = vectors[1] + world_point - vectors[2 + point]


@kernel
def measurement_jacobian(point: int, jacobian: Array2D) -> None:
    """Fill in the point's own columns of the measurement Jacobian from ``position_jacobian``."""
    first = 9 + 3 * point
    for i in range(3):
        for k in range(3):
            jacobian[i, first + k] = 1.0 if i == k else 0.0


@kernel
def height_row(
    row: int, point: int, reference: int, height: float, vectors: Array2D,
    jacobian: Array2D, residual: Array1D,
) -> None:  # fmt: skip
    """One row of H and r for the measured height of a point, over another point or the world.

    An error of the rotation also rotates the point's position, so the row depends on the estimate.

    Args:
        reference: the index of the other point; negative for the height over the world's origin.
        height: the measured height [m].
    """
    jacobian[row, :] = 0.0
    x, y = vectors[2 + point, 0], vectors[2 + point, 1]
    z = vectors[2 + point, 2]
    jacobian[row, 9 + 3 * point + 2] = 1.0
    if reference >= 0:
        x -= vectors[2 + reference, 0]
        y -= vectors[2 + reference, 1]
        z -= vectors[2 + reference, 2]
        jacobian[row, 9 + 3 * reference + 2] = -1.0
    jacobian[row, 0], jacobian[row, 1] = y, -x
    residual[row] = height - z


@kernel
def world_definition_jacobian(levers: Array2D, vectors: Rows3, jacobian: Array2D) -> None:
    """Compute the measurement Jacobian H (3, n) of the world frame's definition by the feet.

    The first two rows put the world's origin at the mean x and y of the points, the third puts its
    x axis in the heading of the feet. The third row is zero if all levers are zero, because such
    points have no heading.

    Args:
        levers: horizontal positions relative to a centre, which rotate with the heading of the
            feet [m], (N, 2).
    """
    n, total = levers.shape[0], 0.0
    for row in range(3):
        jacobian[row, :] = 0.0
    for point in range(n):
        ahead, aside = levers[point, 0], levers[point, 1]
        total += ahead * ahead + aside * aside
    for point in range(n):
        column = 9 + 3 * point
        x, y = vectors[2 + point, 0], vectors[2 + point, 1]
        # The error of a point's position is xi_d plus the effect of the rotation error about z.
        jacobian[0, column] = 1.0 / n
        jacobian[0, 2] -= y / n
        jacobian[1, column + 1] = 1.0 / n
        jacobian[1, 2] += x / n
        if total > 0.0:
            ahead, aside = levers[point, 0] / total, levers[point, 1] / total
            jacobian[2, column] = -aside
            jacobian[2, column + 1] = ahead
            jacobian[2, 2] += x * ahead + y * aside


@kernel
def add_contact_noise(
    feet: Indices1D, present: Flags1D, own: float, shared: float, period: float, covariance: Array2D
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


@kernel
def invert(matrix: Array2D, out: Array2D) -> None:
    """Compute the inverse of a symmetric matrix (3, 3); zero where it has none."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    scale = 1.0 / determinant if abs(determinant) > 1e-300 else 0.0
    out[0, 0], out[0, 1], out[0, 2] = scale * aa, scale * bb, scale * cc
    out[1, 0], out[1, 1], out[1, 2] = scale * bb, scale * (a * f - c * c), scale * (b * c - a * e)
    out[2, 0], out[2, 1], out[2, 2] = scale * cc, scale * (b * c - a * e), scale * (a * d - b * b)


@kernel
def squared_distance(
    covariance: Array2D, jacobian: Array2D, noise: Matrix3, residual: Vector3,
    cross_covariance: Rows3, inverse: Matrix3, spare: Matrix3,
) -> float:  # fmt: skip
    """Return the squared Mahalanobis distance r' S^-1 r of a residual, with S = H P H' + N.

    If the model holds it is chi-squared distributed with three degrees of freedom.

    Args:
        jacobian: H, (3, n).
        noise: N, (3, 3).
        residual: r, (3,).
        cross_covariance, inverse: become P H' (n, 3) and S^-1 (3, 3), for ``update_covariance``.
        spare: scratch (3, 3).
    """
    multiply_transposed(covariance, jacobian, cross_covariance)
    multiply_sparse(jacobian, cross_covariance, spare)
    for i in range(3):
        spare[i, :] += noise[i]
    invert(spare, inverse)
    total = 0.0
    for i in range(3):
        for k in range(3):
            total += residual[i] * inverse[i, k] * residual[k]
    return total


@kernel
def update_covariance(
    covariance: Array2D, jacobian: Array2D, noise: Array2D, residual: Array1D,
    cross_covariance: Array2D, inverse: Array2D, gain: Array2D, correction: Array1D,
) -> None:  # fmt: skip
    """Update the covariance in Joseph's form, (I - K H) P (I - K H)' + K N K', after ``squared_distance``.

    In this form the result stays positive whatever the rounding errors of K. It is made symmetric
    to the last bit.

    Args:
        cross_covariance, inverse: from ``squared_distance``; the first is overwritten.
        gain: becomes K, (n, 3).
        correction: becomes K r, (n,).
    """
    multiply_matrices(cross_covariance, inverse, gain)
    multiply_vector(gain, residual, correction)
    add_outer(-1.0, gain, cross_covariance, covariance)  # (I - K H) P
    multiply_transposed(covariance, jacobian, cross_covariance)
    add_outer(-1.0, cross_covariance, gain, covariance)
    multiply_matrices(gain, noise, cross_covariance)
    add_outer(1.0, cross_covariance, gain, covariance)
    make_symmetric(covariance)


@kernel
def add_outer(sign: float, a: Array2D, b: Array2D, out: Array2D) -> None:
    """Add ``sign`` times ``a`` (n, 3) times the transpose of ``b`` (n, 3) to ``out`` (n, n)."""
    for i in range(out.shape[0]):
        x, y, z = sign * a[i, 0], sign * a[i, 1], sign * a[i, 2]
        out[i, :] += x * b[:, 0] + y * b[:, 1] + z * b[:, 2]
