"""The Cholesky factor of a small matrix and triangular systems, in place and without allocation.

Matrices are stored by rows, and inner loops run along memory.
"""

from __future__ import annotations

import math

from .arrays import Array
from .kernel import kernel


@kernel
def factorise(matrix: Array, smallest: float) -> bool:
    """The Cholesky factor U of a matrix U'U, in place; only the upper half is read and written.

    Returns whether all pivots are larger than ``smallest``.
    """
    n = matrix.shape[0]
    for j in range(n):
        pivot = float(matrix[j, j])
        if not smallest < pivot < math.inf:
            return False
        root = math.sqrt(pivot)
        for i in range(j, n):
            matrix[j, i] = float(matrix[j, i]) / root
        for i in range(j + 1, n):
            value = float(matrix[j, i])
            if value != 0.0:
                for k in range(i, n):
                    matrix[i, k] = float(matrix[i, k]) - value * float(matrix[j, k])
    return True


@kernel
def solve_transposed(factor: Array, vector: Array) -> None:
    """Solve U'x = b in place, with U (n, n) upper triangular."""
    n = vector.shape[0]
    for j in range(n):
        value = float(vector[j]) / float(factor[j, j])
        vector[j] = value
        for i in range(j + 1, n):
            vector[i] = float(vector[i]) - value * float(factor[j, i])


@kernel
def solve_upper(factor: Array, vector: Array) -> None:
    """Solve U x = b in place, with U (n, n) upper triangular."""
    n = vector.shape[0]
    for j in range(n - 1, -1, -1):
        value = float(vector[j])
        for i in range(j + 1, n):
            value -= float(factor[j, i]) * float(vector[i])
        vector[j] = value / float(factor[j, j])


@kernel
def solve_rows_transposed(factor: Array, columns: int, rows: Array) -> None:
    """Solve R'X = B in place for the first ``columns`` of the rows of B."""
    n = factor.shape[0]
    for j in range(n):
        pivot = float(factor[j, j])
        for k in range(columns):
            rows[j, k] = float(rows[j, k]) / pivot
        for i in range(j + 1, n):
            value = float(factor[j, i])
            for k in range(columns):
                rows[i, k] = float(rows[i, k]) - value * float(rows[j, k])
