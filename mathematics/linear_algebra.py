"""Small dense linear algebra with the same bits on every processor.

Kernels use plain loops, in place and without allocation: products, the Cholesky factor and triangular
systems, least squares. Matrices are stored by rows, and inner loops run along memory. ``product`` and
``inverse`` are for tables that are made before a run.

``@`` and ``numpy.linalg`` call BLAS and LAPACK, whose routines are written for each processor and
round differently. Here are only loops, element-wise operations and sums of NumPy, which IEEE 754 and the
order of the elements fix.
"""

from __future__ import annotations

import math

import numpy as np

from .arrays import Array, Array1D, Array2D
from .kernel import kernel


@kernel
def multiply_vector(matrix: Array2D, vector: Array1D, out: Array1D) -> None:
    """``matrix`` (m, n) times ``vector`` (n) into ``out`` (m), which is another array."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] = total


@kernel
def add_product(matrix: Array2D, vector: Array1D, out: Array1D) -> None:
    """Add ``matrix`` (m, n) times ``vector`` (n) to ``out`` (m), which is another array."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] = out[i] + total


@kernel
def multiply_matrices(a: Array2D, b: Array2D, out: Array2D) -> None:
    """Multiply ``a`` (l, m) by ``b`` (m, n) into ``out`` (l, n), which is another array."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@kernel
def weighted_sum(weights: Array1D, rows: Array2D, out: Array1D) -> None:
    """Sum ``rows`` (n, m) times their ``weights`` (n) into ``out`` (m), leaving out those that have none."""
    for j in range(out.shape[0]):
        out[j] = 0.0
    for i in range(weights.shape[0]):
        if weights[i] != 0.0:
            add_multiple(out, weights[i], rows[i])


@kernel
def add_multiple(target: Array1D, factor: float, values: Array1D) -> None:
    """Add a multiple of an array to another one."""
    for j in range(target.shape[0]):
        target[j] = target[j] + factor * values[j]


@kernel
def pairwise_sum(values: Array1D) -> float:
    """Return the sum in the order in which NumPy adds up to 128 numbers along memory: in eight columns, and then those."""
    count = values.shape[0]
    whole = count - count % 8
    total = 0.0
    if whole > 0:
        a, b, c, d = values[0], values[1], values[2], values[3]
        e, f, g, h = values[4], values[5], values[6], values[7]
        for k in range(8, whole, 8):
            a, b, c, d = a + values[k], b + values[k + 1], c + values[k + 2], d + values[k + 3]
            e, f, g, h = e + values[k + 4], f + values[k + 5], g + values[k + 6], h + values[k + 7]
        total = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for k in range(whole, count):
        total += values[k]
    return total


@kernel
def multiply_sparse(a: Array2D, b: Array2D, out: Array2D) -> None:
    """Multiply as ``multiply_matrices``, leaving out the zeros of an ``a`` that has many."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
        for k in range(a.shape[1]):
            factor = a[i, k]
            if factor != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += factor * b[k, j]


@kernel
def multiply_transposed(a: Array2D, b: Array2D, out: Array2D) -> None:
    """Multiply ``a`` (l, m) by the transpose of ``b`` (n, m), which has many zeros, into ``out``
    (l, n)."""
    for j in range(b.shape[0]):
        for i in range(a.shape[0]):
            out[i, j] = 0.0
        for k in range(b.shape[1]):
            factor = b[j, k]
            if factor != 0.0:
                for i in range(a.shape[0]):
                    out[i, j] += a[i, k] * factor


@kernel
def transpose(matrix: Array2D) -> None:
    """Transpose a square matrix in place."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            above = matrix[j, i]
            matrix[j, i] = matrix[i, j]
            matrix[i, j] = above


@kernel
def make_symmetric(matrix: Array2D) -> None:
    """Make a square matrix the mean of itself and its transpose, symmetric to the last bit."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            mean = 0.5 * (matrix[i, j] + matrix[j, i])
            matrix[i, j] = matrix[j, i] = mean


@kernel
def factorise(matrix: Array2D, smallest: float) -> bool:
    """Compute the Cholesky factor U of a matrix U'U, in place; only the upper half is read and
    written.

    Returns whether all pivots are larger than ``smallest``.
    """
    n = matrix.shape[0]
    for j in range(n):
        pivot = matrix[j, j]
        if not smallest < pivot < math.inf:
            return False
        root = math.sqrt(pivot)
        for i in range(j, n):
            matrix[j, i] = matrix[j, i] / root
        for i in range(j + 1, n):
            value = matrix[j, i]
            if value != 0.0:
                for k in range(i, n):
                    matrix[i, k] = matrix[i, k] - value * matrix[j, k]
    return True


@kernel
def solve_transposed(factor: Array2D, vector: Array1D) -> None:
    """Solve U'x = b in place, with U (n, n) upper triangular."""
    n = vector.shape[0]
    for j in range(n):
        value = vector[j] / factor[j, j]
        vector[j] = value
        for i in range(j + 1, n):
            vector[i] = vector[i] - value * factor[j, i]


@kernel
def solve_upper(factor: Array2D, vector: Array1D) -> None:
    """Solve U x = b in place, with U (n, n) upper triangular."""
    n = vector.shape[0]
    for j in range(n - 1, -1, -1):
        value = vector[j]
        for i in range(j + 1, n):
            value -= factor[j, i] * vector[i]
        vector[j] = value / factor[j, j]


@kernel
def solve_each_transposed(factor: Array2D, rows: Array2D) -> None:
    """Solve U'x = b in place for every row b, as ``solve_transposed`` does, but together: a third of the time."""
    n = factor.shape[0]
    for j in range(n):
        for row in range(rows.shape[0]):
            value = rows[row, j] / factor[j, j]
            rows[row, j] = value
            for i in range(j + 1, n):
                rows[row, i] = rows[row, i] - value * factor[j, i]


@kernel
def solve_each_upper(factor: Array2D, rows: Array2D) -> None:
    """Solve U x = b in place for every row b, as ``solve_upper`` does, but together: half of the time."""
    n = factor.shape[0]
    for j in range(n - 1, -1, -1):
        for row in range(rows.shape[0]):
            value = rows[row, j]
            for i in range(j + 1, n):
                value -= factor[j, i] * rows[row, i]
            rows[row, j] = value / factor[j, j]


@kernel
def solve_rows_transposed(factor: Array2D, columns: int, rows: Array2D) -> None:
    """Solve R'X = B in place for the first ``columns`` of the rows of B."""
    n = factor.shape[0]
    for j in range(n):
        pivot = factor[j, j]
        for k in range(columns):
            rows[j, k] = rows[j, k] / pivot
        for i in range(j + 1, n):
            value = factor[j, i]
            for k in range(columns):
                rows[i, k] = rows[i, k] - value * rows[j, k]


@kernel
def solve_damped(rows: Array2D, damping: float, normal: Array2D, vector: Array1D) -> None:
    """Solve (A'A + damping^2 I) x = A'b in place: ``vector`` is A'b and becomes x.

    Args:
        rows: A, (m, n), contiguous.
        damping: greater than zero, in A's unit; it keeps x finite where A is rank deficient.
        normal: scratch (n, n).
    """
    for i in range(normal.shape[0]):
        for j in range(i + 1):
            total = 0.0
            for k in range(rows.shape[0]):
                total += rows[k, i] * rows[k, j]
            normal[i, j] = normal[j, i] = total
        normal[i, i] += damping * damping
    solve_positive(normal, vector)


@kernel
def solve_positive(matrix: Array2D, vector: Array1D) -> None:
    """Solve a symmetric positive definite system in place: ``vector`` becomes the solution.

    The method is an LDL' factorisation, which overwrites ``matrix``. A pivot that is not positive
    because of rounding is skipped.
    """
    factorise_positive(matrix)
    substitute(matrix, vector)


@kernel
def solve_rows(matrix: Array2D, rows: Array2D) -> None:
    """Solve as ``solve_positive`` for several right-hand sides: each of the ``rows`` (m, n) is
    one."""
    factorise_positive(matrix)
    for row in range(rows.shape[0]):
        substitute(matrix, rows[row])


@kernel
def factorise_positive(matrix: Array2D) -> None:
    """Factorise a symmetric matrix LDL' in place: D on the diagonal, L' above it.

    Only the lower half is read; what is left there is of no use.
    """
    n = matrix.shape[0]
    for j in range(n):
        pivot = matrix[j, j]
        inverse_pivot = 1.0 / pivot if pivot > 1e-300 else 0.0
        for i in range(j + 1, n):
            factor = matrix[i, j] * inverse_pivot
            if factor != 0.0:
                for k in range(j + 1, i + 1):
                    matrix[i, k] -= factor * matrix[k, j]
        for i in range(j + 1, n):
            matrix[j, i] = matrix[i, j] * inverse_pivot


@kernel
def substitute(factors: Array2D, vector: Array1D) -> None:
    """Solve LDL'x = b in place, with the factors of ``factorise_positive``."""
    n = vector.shape[0]
    for j in range(n):
        value = vector[j]
        for i in range(j + 1, n):
            vector[i] -= factors[j, i] * value
        pivot = factors[j, j]
        vector[j] = value * (1.0 / pivot if pivot > 1e-300 else 0.0)
    for j in range(n - 2, -1, -1):
        value = vector[j]
        for i in range(j + 1, n):
            value -= factors[j, i] * vector[i]
        vector[j] = value


def product(a: Array, b: Array) -> Array:
    """Return the product of matrices or stacks of matrices ``a`` (..., l, m), ``b`` (..., m, n).

    As in NumPy a vector may take the place of either: ``a`` (m,) or ``b`` (m,).
    """
    if b.ndim == 1:
        return np.asarray(np.add.reduce(a * b, axis=-1))
    if a.ndim == 1:
        return np.asarray(np.add.reduce(a[:, None] * b, axis=-2))
    return np.asarray(np.add.reduce(a[..., :, :, None] * b[..., None, :, :], axis=-2))


def inverse(matrix: Array) -> Array:
    """Return the inverse of a square matrix (n, n) by Gauss-Jordan elimination with row pivoting.

    Raises:
        ValueError: the matrix has none.
    """
    n = len(matrix)
    rows = np.concatenate([np.array(matrix, dtype=np.float64), np.eye(n)], axis=1)
    for k in range(n):
        best = k + int(np.abs(rows[k:, k]).argmax())
        if rows[best, k] == 0.0:
            raise ValueError("the matrix is singular, so it has no inverse")
        rows[[k, best]] = rows[[best, k]]
        rows[k] /= rows[k, k]
        factors = rows[:, k].copy()
        factors[k] = 0.0
        rows -= factors[:, None] * rows[k]
    return np.ascontiguousarray(rows[:, n:])
