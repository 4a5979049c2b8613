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
    factorise_positive(matrix)
    substitute(matrix, vector)


@kernel
def solve_rows(matrix: Array, rows: Array) -> None:
    """As ``solve_positive`` for several right-hand sides: each of the ``rows`` (m, n) is one."""
    factorise_positive(matrix)
    for row in range(rows.shape[0]):
        substitute(matrix, rows[row])


@kernel
def factorise_positive(matrix: Array) -> None:
    """The factors of a symmetric matrix LDL' in place: D on the diagonal, L' above it.

    Only the lower half is read; what is left there is of no use.
    """
    n = matrix.shape[0]
    for j in range(n):
        pivot = float(matrix[j, j])
        inverse_pivot = 1.0 / pivot if pivot > 1e-300 else 0.0
        for i in range(j + 1, n):
            factor = float(matrix[i, j]) * inverse_pivot
            if factor != 0.0:
                for k in range(j + 1, i + 1):
                    matrix[i, k] -= factor * float(matrix[k, j])
        for i in range(j + 1, n):
            matrix[j, i] = float(matrix[i, j]) * inverse_pivot


@kernel
def substitute(factors: Array, vector: Array) -> None:
    """Solve LDL'x = b in place, with the factors of ``factorise_positive``."""
    n = vector.shape[0]
    for j in range(n):
        value = float(vector[j])
        for i in range(j + 1, n):
            vector[i] -= float(factors[j, i]) * value
        pivot = float(factors[j, j])
        vector[j] = value * (1.0 / pivot if pivot > 1e-300 else 0.0)
    for j in range(n - 2, -1, -1):
        value = float(vector[j])
        for i in range(j + 1, n):
            value -= float(factors[j, i]) * float(vector[i])
        vector[j] = value
