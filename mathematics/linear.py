"""Products with small matrices in plain loops: the same bits on every machine, unlike BLAS."""

from __future__ import annotations

from .arrays import Array
from .kernel import kernel


@kernel
def multiply_vector(matrix: Array, vector: Array, out: Array) -> None:
    """``matrix`` (m, n) times ``vector`` (n) into ``out`` (m), which is another array."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += float(matrix[i, j]) * float(vector[j])
        out[i] = total


@kernel
def add_product(matrix: Array, vector: Array, out: Array) -> None:
    """Add ``matrix`` (m, n) times ``vector`` (n) to ``out`` (m), which is another array."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += float(matrix[i, j]) * float(vector[j])
        out[i] = float(out[i]) + total


@kernel
def multiply_matrices(a: Array, b: Array, out: Array) -> None:
    """``a`` (l, m) times ``b`` (m, n) into ``out`` (l, n), which is another array."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += float(a[i, k]) * float(b[k, j])
            out[i, j] = total


@kernel
def multiply_sparse(a: Array, b: Array, out: Array) -> None:
    """The same for an ``a`` with many zeros, which are left out."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
        for k in range(a.shape[1]):
            factor = float(a[i, k])
            if factor != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += factor * float(b[k, j])


@kernel
def multiply_transposed(a: Array, b: Array, out: Array) -> None:
    """``a`` (l, m) times the transpose of ``b`` (n, m), which has many zeros, into ``out`` (l, n)."""
    for j in range(b.shape[0]):
        for i in range(a.shape[0]):
            out[i, j] = 0.0
        for k in range(b.shape[1]):
            factor = float(b[j, k])
            if factor != 0.0:
                for i in range(a.shape[0]):
                    out[i, j] += float(a[i, k]) * factor


@kernel
def transpose(matrix: Array) -> None:
    """Transpose a square matrix in place."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            above = float(matrix[j, i])
            matrix[j, i] = matrix[i, j]
            matrix[i, j] = above


@kernel
def make_symmetric(matrix: Array) -> None:
    """Make a square matrix the mean of itself and its transpose, symmetric to the last bit."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            mean = 0.5 * (float(matrix[i, j]) + float(matrix[j, i]))
            matrix[i, j] = matrix[j, i] = mean
