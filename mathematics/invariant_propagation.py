"""The time update of a right-invariant extended Kalman filter: error transition and covariance.

The error (n,) of a state consists of the logarithm of estimate times inverse truth on SE_{2+N}(3)
(rotation, velocity, position and N contact points, all in the world), followed by estimate minus
truth of the gyroscope bias, the accelerometer bias and further constants. Without biases the error
obeys a linear equation that does not depend on the trajectory (Hartley et al. 2020, theorem 1): an
error of tilt lets gravity cause an error of velocity, and that an error of position::

    xi_R' = 0,   xi_v' = [g]x xi_R,   xi_p' = xi_v,   xi_d' = 0

A bias enters through the adjoint of the estimate. No function here allocates memory.
"""

from __future__ import annotations

import math

from .arrays import Array, Flags, Indices
from .kernel import kernel
from .linear import make_symmetric, multiply_sparse, transpose


@kernel
def error_transition(gravity: float, period: float, transition: Array) -> None:
    """The constant part of the transition matrix F (n, n): the exponential of the equation above.

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
    rotation: Array, vectors: Array, present: Flags, gravity: float, period: float, reach: Array
) -> None:
    """The effect of a constant IMU error on the state's error over one period: ``reach`` (n, 6).

    The columns of ``reach`` are for angular velocity [rad/s, body] and specific force [m/s^2,
    body]. The matrix is minus the adjoint of the estimate, integrated to second order.

    Args:
        rotation: the estimated orientation (3, 3), in the middle of the period.
        vectors: the estimated velocity, position and contact points (2 + N, 3), in the middle of
            the period, too.
        present: which contact points are in the state, (N,); the rows of the others are zero.
    """
    for j in range(3):
        x, y, z = float(rotation[0, j]), float(rotation[1, j]), float(rotation[2, j])
        reach[0, j], reach[1, j], reach[2, j] = -period * x, -period * y, -period * z
        for k in range(vectors.shape[0]):
            row = 3 * k + 3
            if k >= 2 and not present[k - 2]:
                reach[row, j] = reach[row + 1, j] = reach[row + 2, j] = 0.0
                continue
            a, b, c = float(vectors[k, 0]), float(vectors[k, 1]), float(vectors[k, 2])
            if k == 0:  # the tilt error that grows during the period acts for half of it on average
                c -= 0.5 * gravity * period
            elif k == 1:
                a += 0.5 * period * float(vectors[0, 0])
                b += 0.5 * period * float(vectors[0, 1])
                c += 0.5 * period * float(vectors[0, 2])
            reach[row, j] = -period * (b * z - c * y)
            reach[row + 1, j] = -period * (c * x - a * z)
            reach[row + 2, j] = -period * (a * y - b * x)
        reach[3, j + 3], reach[4, j + 3], reach[5, j + 3] = -period * x, -period * y, -period * z
        half = -0.5 * period * period
        reach[6, j + 3], reach[7, j + 3], reach[8, j + 3] = half * x, half * y, half * z


@kernel
def propagate_covariance(
    transition: Array, reach: Array, bias: int, noise: Array, covariance: Array,
    scaled: Array, product: Array,
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
            scaled[i, k] = float(reach[i, k]) * float(noise[k])
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(6):
                total += float(scaled[i, k]) * float(scaled[j, k])
            covariance[i, j] += total
    make_symmetric(covariance)


@kernel
def vector_deviation(covariance: Array, first: int, vector: Array) -> float:
    """The standard deviation of the length of a vector's error in the world.

    The error of a vector u is xi_u plus the effect of the rotation error: xi_u + xi_R x u.

    Args:
        first: the index of xi_u in the error.
        vector: u, (3,).
    """
    total = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b = float(vector[k]), -float(vector[j])  # (xi_R x u)_i = u_k xi_j - u_j xi_k
        total += float(covariance[first + i, first + i])
        total += 2.0 * (a * float(covariance[first + i, j]) + b * float(covariance[first + i, k]))
        total += a * a * float(covariance[j, j]) + b * b * float(covariance[k, k])
        total += 2.0 * a * b * float(covariance[j, k])
    return math.sqrt(total) if total > 0.0 else 0.0


@kernel
def sample_deviations(
    reading: Array, limit: float, noise: float, doubt: float, run: Indices, out: Array
) -> bool:
    """The standard deviations of a sample's axes, (3,); returns whether an axis is saturated.

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
        if abs(float(reading[axis])) >= 0.999 * limit:
            run[axis] += 1
            out[axis] = doubt * math.sqrt(2.0 * int(run[axis]) - 1.0)
            any_full = True
        else:
            run[axis] = 0
    return any_full
