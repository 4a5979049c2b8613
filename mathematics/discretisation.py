"""From continuous linear systems to discrete ones, exactly, for inputs held over a period.

Everything is computed in plain loops, so a graph computes the same bits on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arrays import Array
from .kernel import kernel
from .linear import multiply_matrices

_TERMS = 20
"""Terms of the exponential's series; for a norm of one half the rest is below 1e-26."""


@kernel
def matrix_exponential(matrix: Array, power: Array, scratch: Array, out: Array) -> None:
    """The exponential of a square matrix into ``out``, by scaling and squaring of its series.

    ``power`` and ``scratch`` are scratch arrays of the same shape (n, n).
    """
    n = matrix.shape[0]
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(float(matrix[i, j]))
        norm = max(norm, row)
    halvings = 0
    scale = 1.0
    while norm * scale > 0.5:
        scale *= 0.5
        halvings += 1
    for i in range(n):
        for j in range(n):
            out[i, j] = power[i, j] = 1.0 if i == j else 0.0
    for term in range(1, _TERMS + 1):
        multiply_matrices(power, matrix, scratch)
        for i in range(n):
            for j in range(n):
                power[i, j] = float(scratch[i, j]) * scale / term
                out[i, j] = float(out[i, j]) + float(power[i, j])
    for _ in range(halvings):
        multiply_matrices(out, out, scratch)
        for i in range(n):
            for j in range(n):
                out[i, j] = float(scratch[i, j])


def discretise(
    a: Sequence[Sequence[float]], b: Sequence[Sequence[float]], period: float
) -> tuple[Array, Array]:
    """The discrete A (n, n) and B (n, m) of dx/dt = a x + b u with u held over each period [s].

    Both at once from the exponential of [[a, b], [0, 0]] times the period.
    """
    n, m = len(a), len(b[0])
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[:n, n:] = a, b
    whole *= period
    result = np.empty_like(whole)
    matrix_exponential(whole, np.empty_like(whole), np.empty_like(whole), result)
    return result[:n, :n].copy(), result[:n, n:].copy()


def controllable_form(
    numerator: Sequence[float], denominator: Sequence[float]
) -> tuple[Array, Array, Array, float]:
    """A (n, n), B (n, 1), C (1, n) and D of a proper rational function in controllable form.

    Coefficients are those of falling powers; the denominator's first is not zero and it has at
    least two, and the numerator has no more than the denominator.
    """
    lead = denominator[0]
    below = [value / lead for value in denominator[1:]]
    above = [0.0] * (len(denominator) - len(numerator)) + [value / lead for value in numerator]
    n = len(below)
    a, b, c = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for i in range(n - 1):
        a[i, i + 1] = 1.0
    direct = above[0]
    for i in range(n):
        a[n - 1, i] = -below[n - 1 - i]
        c[0, i] = above[n - i] - direct * below[n - 1 - i]
    b[n - 1, 0] = 1.0
    return a, b, c, direct
