"""Second-order filters: coefficients by the bilinear transform, and their steps.

A filter is the five coefficients b0, b1, b2, a1, a2 of

    y[n] = b0 u[n] + b1 u[n-1] + b2 u[n-2] - a1 y[n-1] - a2 y[n-2],

computed in the transposed direct form II with two numbers of memory for each element. The transform
is prewarped: at the cutoff or centre frequency the response is that of the continuous filter.
"""

from __future__ import annotations

import math

from .arrays import Array
from .kernel import kernel


@kernel
def first_order(cutoff: float, period: float, high: bool, out: Array) -> None:
    """Coefficients (5) of the low-pass 1 / (1 + s / w), or the high-pass (s / w) / (1 + s / w).

    ``cutoff`` is w / (2 pi) [Hz], below half of the sampling rate; there the gain is 1 / sqrt(2).
    """
    k = math.tan(math.pi * cutoff * period)
    scale = 1.0 / (1.0 + k)
    out[0] = scale if high else k * scale
    out[1] = -scale if high else k * scale
    out[2] = 0.0
    out[3] = (k - 1.0) * scale
    out[4] = 0.0


@kernel
def second_order(cutoff: float, damping: float, period: float, high: bool, out: Array) -> None:
    """Coefficients (5) of w^2 / (s^2 + 2 d w s + w^2), or of s^2 over the same.

    ``cutoff`` is w / (2 pi) [Hz], below half of the sampling rate; with a damping d of 1 / sqrt(2)
    it is a Butterworth filter.
    """
    k = math.tan(math.pi * cutoff * period)
    scale = 1.0 / (1.0 + 2.0 * damping * k + k * k)
    out[0] = scale if high else k * k * scale
    out[1] = -2.0 * scale if high else 2.0 * k * k * scale
    out[2] = scale if high else k * k * scale
    out[3] = 2.0 * (k * k - 1.0) * scale
    out[4] = (1.0 - 2.0 * damping * k + k * k) * scale


@kernel
def band_stop(centre: float, width: float, period: float, out: Array) -> None:
    """Coefficients (5) of (s^2 + w^2) / (s^2 + v s + w^2): nothing passes at the centre.

    ``centre`` is w / (2 pi) [Hz], below half of the sampling rate; ``width`` is v / (2 pi) [Hz].
    """
    k = math.tan(math.pi * centre * period)
    q = width / centre * k
    scale = 1.0 / (1.0 + q + k * k)
    out[0] = (1.0 + k * k) * scale
    out[1] = 2.0 * (k * k - 1.0) * scale
    out[2] = (1.0 + k * k) * scale
    out[3] = 2.0 * (k * k - 1.0) * scale
    out[4] = (1.0 - q + k * k) * scale


@kernel
def settle(coefficients: Array, u: Array, memory: Array) -> None:
    """Fill ``memory`` (n, 2) as if the input had always been ``u`` (n)."""
    b0, b1, b2 = float(coefficients[0]), float(coefficients[1]), float(coefficients[2])
    a1, a2 = float(coefficients[3]), float(coefficients[4])
    gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
    for i in range(u.shape[0]):
        x = float(u[i])
        y = gain * x
        later = b2 * x - a2 * y
        memory[i, 1] = later
        memory[i, 0] = b1 * x - a1 * y + later


@kernel
def advance(coefficients: Array, u: Array, memory: Array, out: Array) -> None:
    """Filter one sample ``u`` (n) into ``out`` (n) and advance ``memory`` (n, 2)."""
    b0, b1, b2 = float(coefficients[0]), float(coefficients[1]), float(coefficients[2])
    a1, a2 = float(coefficients[3]), float(coefficients[4])
    for i in range(u.shape[0]):
        x = float(u[i])
        y = b0 * x + float(memory[i, 0])
        memory[i, 0] = b1 * x - a1 * y + float(memory[i, 1])
        memory[i, 1] = b2 * x - a2 * y
        out[i] = y
