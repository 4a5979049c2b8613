"""Small dense least squares as pure functions that allocate nothing."""

from __future__ import annotations

from .arrays import Array
from .kernel import kernel


@kernel
def solve_damped(rows: Array, damping: float, normal: Array, vector: Array) -> None:
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
                total += float(rows[k, i]) * float(rows[k, j])
            normal[i, j] = normal[j, i] = total
        normal[i, i] += damping * damping
    solve_positive(normal, vector)


@kernel
def solve_positive(matrix: Array, vector: Array) -> None:
    """Solve a symmetric positive definite system in place: ``vector`` becomes the solution.

    The method is an LDL' factorisation, which overwrites ``matrix``. A pivot that is not positive
    because of rounding is skipped.
    """
    n = vector.shape[0]
    for j in range(n):
        pivot = float(matrix[j, j])
        inverse_pivot = 1.0 / pivot if pivot > 1e-300 else 0.0
        for i in range(j + 1, n):
            factor = float(matrix[i, j]) * inverse_pivot
            for k in range(j + 1, i + 1):
                matrix[i, k] -= factor * float(matrix[k, j])
            vector[i] -= factor * float(vector[j])
        vector[j] *= inverse_pivot
        for i in range(j + 1, n):
            matrix[j, i] = float(matrix[i, j]) * inverse_pivot
    for j in range(n - 2, -1, -1):
        value = float(vector[j])
        for i in range(j + 1, n):
            value -= float(matrix[j, i]) * float(vector[i])
        vector[j] = value


@kernel
def solve_positive_columns(matrix: Array, columns: Array) -> None:
    """Solve a symmetric positive definite system for several right-hand sides, in place.

    Args:
        matrix: (n, n), of which the lower half is read; it is overwritten.
        columns: the right-hand sides (n, m), which become the solutions. Where a pivot is not
            positive because of rounding the solution is zero.
    """
    n, m = columns.shape
    for j in range(n):
        pivot = float(matrix[j, j])
        inverse_pivot = 1.0 / pivot if pivot > 1e-300 else 0.0
        for i in range(j + 1, n):
            factor = float(matrix[i, j]) * inverse_pivot
            for k in range(j + 1, i + 1):
                matrix[i, k] -= factor * float(matrix[k, j])
            for k in range(m):
                columns[i, k] -= factor * float(columns[j, k])
        for k in range(m):
            columns[j, k] *= inverse_pivot
        for i in range(j + 1, n):
            matrix[j, i] = float(matrix[i, j]) * inverse_pivot
    for j in range(n - 2, -1, -1):
        for i in range(j + 1, n):
            factor = float(matrix[j, i])
            for k in range(m):
                columns[j, k] -= factor * float(columns[i, k])
