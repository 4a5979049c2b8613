"""Linear systems in discrete time: exact discretisation, second-order filters, transfer functions.

A continuous system is discretised exactly for inputs held over a period. A second-order filter is the five
coefficients b0, b1, b2, a1, a2 of

    y[n] = b0 u[n] + b1 u[n-1] + b2 u[n-2] - a1 y[n-1] - a2 y[n-2],

found by the bilinear transform and computed in the transposed direct form II with two numbers of memory
for each element. The transform is prewarped: at the cutoff or centre frequency the response is that of the
continuous filter. Everything is computed in plain loops, so a graph computes the same bits on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .arrays import Array, Array1D, Array2D
from .elementary import sincos
from .kernel import kernel
from .linear_algebra import multiply_matrices

_TERMS = 20
"""Terms of the exponential's series; for a norm of one half the rest is below 1e-26."""


@kernel
def matrix_exponential(matrix: Array2D, power: Array2D, scratch: Array2D, out: Array2D) -> None:
    """Compute the exponential of a square matrix into ``out``, by scaling and squaring of its
    series.

    ``power`` and ``scratch`` are scratch arrays of the same shape (n, n).
    """
    n = matrix.shape[0]
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(matrix[i, j])
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
                power[i, j] = scratch[i, j] * scale / term
                out[i, j] = out[i, j] + power[i, j]
    for _ in range(halvings):
        multiply_matrices(out, out, scratch)
        for i in range(n):
            for j in range(n):
                out[i, j] = scratch[i, j]


def discretise(
    a: Sequence[Sequence[float]], b: Sequence[Sequence[float]], period: float
) -> tuple[Array, Array]:
    """Return the discrete A (n, n) and B (n, m) of dx/dt = a x + b u with u held over each period
    [s].

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
    """Return A (n, n), B (n, 1), C (1, n) and D of a proper rational function in controllable form.

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


@kernel
def _prewarped(frequency: float, period: float) -> float:
    """tan(pi f T), by which the bilinear transform keeps the frequency f [Hz] (prewarping)."""
    sine, cosine = sincos(math.pi * frequency * period)
    return sine / cosine


@kernel
def first_order(cutoff: float, period: float, high: bool, out: Array1D) -> None:
    """Coefficients (5) of the low-pass 1 / (1 + s / w), or the high-pass (s / w) / (1 + s / w).

    ``cutoff`` is w / (2 pi) [Hz], below half of the sampling rate; there the gain is 1 / sqrt(2).
    """
    k = _prewarped(cutoff, period)
    scale = 1.0 / (1.0 + k)
    out[0] = scale if high else k * scale
    out[1] = -scale if high else k * scale
    out[2] = 0.0
    out[3] = (k - 1.0) * scale
    out[4] = 0.0


@kernel
def second_order(cutoff: float, damping: float, period: float, high: bool, out: Array1D) -> None:
    """Coefficients (5) of w^2 / (s^2 + 2 d w s + w^2), or of s^2 over the same.

    ``cutoff`` is w / (2 pi) [Hz], below half of the sampling rate; with a damping d of 1 / sqrt(2)
    it is a Butterworth filter.
    """
    k = _prewarped(cutoff, period)
    scale = 1.0 / (1.0 + 2.0 * damping * k + k * k)
    out[0] = scale if high else k * k * scale
    out[1] = -2.0 * scale if high else 2.0 * k * k * scale
    out[2] = scale if high else k * k * scale
    out[3] = 2.0 * (k * k - 1.0) * scale
    out[4] = (1.0 - 2.0 * damping * k + k * k) * scale


@kernel
def band_stop(centre: float, width: float, period: float, out: Array1D) -> None:
    """Coefficients (5) of (s^2 + w^2) / (s^2 + v s + w^2): nothing passes at the centre.

    ``centre`` is w / (2 pi) [Hz], below half of the sampling rate; ``width`` is v / (2 pi) [Hz].
    """
    k = _prewarped(centre, period)
    q = width / centre * k
    scale = 1.0 / (1.0 + q + k * k)
    out[0] = (1.0 + k * k) * scale
    out[1] = 2.0 * (k * k - 1.0) * scale
    out[2] = (1.0 + k * k) * scale
    out[3] = 2.0 * (k * k - 1.0) * scale
    out[4] = (1.0 - q + k * k) * scale


@kernel
def settle(coefficients: Array1D, u: Array1D, memory: Array2D) -> None:
    """Fill ``memory`` (n, 2) as if the input had always been ``u`` (n)."""
    b0, b1, b2 = coefficients[0], coefficients[1], coefficients[2]
    a1, a2 = coefficients[3], coefficients[4]
    gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
    for i in range(u.shape[0]):
        x = u[i]
        y = gain * x
        later = b2 * x - a2 * y
        memory[i, 1] = later
        memory[i, 0] = b1 * x - a1 * y + later


@kernel
def advance(coefficients: Array1D, u: Array1D, memory: Array2D, out: Array1D) -> None:
    """Filter one sample ``u`` (n) into ``out`` (n) and advance ``memory`` (n, 2)."""
    b0, b1, b2 = coefficients[0], coefficients[1], coefficients[2]
    a1, a2 = coefficients[3], coefficients[4]
    for i in range(u.shape[0]):
        x = u[i]
        y = b0 * x + memory[i, 0]
        memory[i, 0] = b1 * x - a1 * y + memory[i, 1]
        memory[i, 1] = b2 * x - a2 * y
        out[i] = y


@kernel
def advance_transfer_function(
    a: Array2D, b: Array1D, c: Array1D, d: float, u: Array1D, states: Array2D, scratch: Array1D,
    out: Array1D,
) -> None:  # fmt: skip
    """Write c x + d u into ``out`` (n), and let every row x of ``states`` (n, k) become A x + b u.

    ``a`` is (k, k), ``b`` and ``c`` are (k), ``scratch`` is (k).
    """
    for element in range(u.shape[0]):
        value = u[element]
        total = d * value
        for i in range(c.shape[0]):
            total += c[i] * states[element, i]
        for i in range(c.shape[0]):
            sum_of_row = b[i] * value
            for j in range(c.shape[0]):
                sum_of_row += a[i, j] * states[element, j]
            scratch[i] = sum_of_row
        for i in range(c.shape[0]):
            states[element, i] = scratch[i]
        out[element] = total
