"""Products and inverses of arrays with the same bits on every processor, for what a run is made of.

``@`` and ``numpy.linalg`` call BLAS and LAPACK, whose routines are written for each processor and
round differently. Here are only element-wise operations and sums of NumPy, which IEEE 754 and the
order of the elements fix. Inside kernels ``linear`` and ``triangular`` do the same.
"""

from __future__ import annotations

import numpy as np

from .arrays import Array


def product(a: Array, b: Array) -> Array:
    """The product of matrices or stacks of matrices ``a`` (..., l, m), ``b`` (..., m, n).

    As in NumPy a vector may take the place of either: ``a`` (m,) or ``b`` (m,).
    """
    if b.ndim == 1:
        return np.asarray(np.add.reduce(a * b, axis=-1))
    if a.ndim == 1:
        return np.asarray(np.add.reduce(a[:, None] * b, axis=-2))
    return np.asarray(np.add.reduce(a[..., :, :, None] * b[..., None, :, :], axis=-2))


def inverse(matrix: Array) -> Array:
    """The inverse of a square matrix (n, n) by Gauss-Jordan elimination with row pivoting.

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
