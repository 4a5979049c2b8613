"""The measurement update of a Kalman filter, three rows at a time, as pure functions.

The error e of the estimate has the covariance P (n, n). A measurement has the residual
r = -H e + noise, and the estimate is corrected by K r. Rows that a measurement does not need are
zero in H and r and have a noise of one. No function here allocates memory.
"""

from __future__ import annotations

from .arrays import Array
from .kernel import kernel
from .linear import (
    make_symmetric,
    multiply_matrices,
    multiply_sparse,
    multiply_transposed,
    multiply_vector,
)


@kernel
def invert(matrix: Array, out: Array) -> None:
    """The inverse of a symmetric matrix (3, 3); zero where it has none."""
    a, b, c = float(matrix[0, 0]), float(matrix[0, 1]), float(matrix[0, 2])
    d, e, f = float(matrix[1, 1]), float(matrix[1, 2]), float(matrix[2, 2])
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    scale = 1.0 / determinant if abs(determinant) > 1e-300 else 0.0
    out[0, 0], out[0, 1], out[0, 2] = scale * aa, scale * bb, scale * cc
    out[1, 0], out[1, 1], out[1, 2] = scale * bb, scale * (a * f - c * c), scale * (b * c - a * e)
    out[2, 0], out[2, 1], out[2, 2] = scale * cc, scale * (b * c - a * e), scale * (a * d - b * b)


@kernel
def weigh(
    covariance: Array, sensitivity: Array, noise: Array, residual: Array,
    seen: Array, inverse: Array, spare: Array,
) -> float:  # fmt: skip
    """The squared Mahalanobis distance r' S^-1 r of a residual, with S = H P H' + N.

    If the model holds it is chi-squared distributed with three degrees of freedom.

    Args:
        sensitivity: H, (3, n).
        noise: N, (3, 3).
        residual: r, (3,).
        seen, inverse: become P H' (n, 3) and S^-1 (3, 3), for ``correct``.
        spare: scratch (3, 3).
    """
    multiply_transposed(covariance, sensitivity, seen)
    multiply_sparse(sensitivity, seen, spare)
    for i in range(3):
        for k in range(3):
            spare[i, k] += noise[i, k]
    invert(spare, inverse)
    total = 0.0
    for i in range(3):
        for k in range(3):
            total += float(residual[i]) * float(inverse[i, k]) * float(residual[k])
    return total


@kernel
def correct(
    covariance: Array, sensitivity: Array, noise: Array, residual: Array,
    seen: Array, inverse: Array, gain: Array, correction: Array,
) -> None:  # fmt: skip
    """Update the covariance in Joseph's form, (I - K H) P (I - K H)' + K N K', after ``weigh``.

    In this form the result stays positive whatever the rounding errors of K. It is made symmetric
    to the last bit.

    Args:
        seen, inverse: from ``weigh``; the first is overwritten.
        gain: becomes K, (n, 3).
        correction: becomes K r, (n,).
    """
    multiply_matrices(seen, inverse, gain)
    multiply_vector(gain, residual, correction)
    add_outer(-1.0, gain, seen, covariance)  # (I - K H) P
    multiply_transposed(covariance, sensitivity, seen)
    add_outer(-1.0, seen, gain, covariance)
    multiply_matrices(gain, noise, seen)
    add_outer(1.0, seen, gain, covariance)
    make_symmetric(covariance)


@kernel
def add_outer(sign: float, a: Array, b: Array, out: Array) -> None:
    """Add ``sign`` times ``a`` (n, 3) times the transpose of ``b`` (n, 3) to ``out`` (n, n)."""
    for i in range(out.shape[0]):
        x, y, z = sign * float(a[i, 0]), sign * float(a[i, 1]), sign * float(a[i, 2])
        for j in range(out.shape[1]):
            out[i, j] += x * float(b[j, 0]) + y * float(b[j, 1]) + z * float(b[j, 2])
