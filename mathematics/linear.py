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
