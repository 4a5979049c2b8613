"""Functions of arrays, element by element: what formulas are made of.

They have the same bits in every tier and on every processor. Outside of a function's domain an element is not finite. The errors of
tangent, arc sine, arc tangent, hyperbolic sine and cosine and logarithm to base ten are below 4 ULP; a power whose exponent is no
whole number, or beyond 64, has one of up to 4 + 2 |b log a| ULP.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .arrays import Array1D
from .elementary import acos, atan2, cos, exp, expm1, hypot, log, parts_of, sin, sincos, tanh
from .kernel import kernel


@kernel
def _divided(a: float, b: float) -> float:
    if b == 0.0:
        return (
            math.nan
            if a == 0.0 or math.isnan(a)
            else math.copysign(math.inf, a) * math.copysign(1.0, b)
        )
    return a / b


@kernel
def _rest(a: float, b: float) -> float:
    return a % b if b != 0.0 and not math.isinf(a) else math.nan


@kernel
def _power(a: float, b: float) -> float:
    if abs(b) <= 64.0 and b == math.floor(b):
        result, square, left = 1.0, a, int(abs(b))
        while left > 0:
            if left % 2 == 1:
                result *= square
            left //= 2
            if left > 0:
                square *= square
        return result if b >= 0.0 else _divided(1.0, result)
    if b == 0.5:
        return math.sqrt(a) if a >= 0.0 else math.nan
    if a == 0.0:
        return 0.0 if b > 0.0 else math.inf
    if a < 0.0 and abs(b) < 9e15 and b == math.floor(b):
        value = exp(b * log(-a))
        return value if b % 2.0 == 0.0 else -value
    return exp(b * log(a))


@kernel
def _tangent(angle: float) -> float:
    sine, cosine = sincos(angle)
    return sine / cosine if cosine != 0.0 else math.nan


@kernel
def _arc_sine(x: float) -> float:
    return atan2(x, math.sqrt((1.0 - x) * (1.0 + x))) if abs(x) <= 1.0 else math.nan


@kernel
def _logarithm_10(x: float) -> float:
    """Exact for powers of ten, as in Sun's fdlibm."""
    if not x > 0.0 or math.isinf(x):
        return log(x)
    m, k = parts_of(x)
    return k * 0.30102999566361177 + (k * 3.694239077158931e-13 + 0.4342944819032518 * log(m))


@kernel
def _hyperbolic(x: float, sign: float) -> float:
    """(e^|x| + sign e^-|x|) / 2 of an |x| so great that e^|x| is as much as e^|x| - 1, or of a cosine."""
    half = exp(0.5 * abs(x))
    if abs(x) > 40.0:
        return 0.5 * half * half
    return 0.5 * (half * half + sign / (half * half))


@kernel
def _hyperbolic_sine(x: float) -> float:
    if abs(x) > 1.0:
        return math.copysign(_hyperbolic(x, -1.0), x)
    grown = expm1(x)
    return 0.5 * (grown + grown / (grown + 1.0))


@kernel
def add(a: Array1D, b: Array1D, out: Array1D) -> None:
    out[:] = a + b


@kernel
def subtract(a: Array1D, b: Array1D, out: Array1D) -> None:
    out[:] = a - b


@kernel
def multiply(a: Array1D, b: Array1D, out: Array1D) -> None:
    out[:] = a * b


@kernel
def divide(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _divided(a[i], b[i])


@kernel
def remainder(a: Array1D, b: Array1D, out: Array1D) -> None:
    """Compute the remainder with the sign of ``b``, as in Python."""
    for i in range(out.shape[0]):
        out[i] = _rest(a[i], b[i])


@kernel
def power(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _power(a[i], b[i])


@kernel
def positive(a: Array1D, out: Array1D) -> None:
    out[:] = a


@kernel
def negative(a: Array1D, out: Array1D) -> None:
    out[:] = -a


@kernel
def less(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = 1.0 if a[i] < b[i] else 0.0


@kernel
def less_equal(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = 1.0 if a[i] <= b[i] else 0.0


@kernel
def equal(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = 1.0 if a[i] == b[i] else 0.0


@kernel
def not_equal(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = 1.0 if a[i] != b[i] else 0.0


@kernel
def choose(condition: Array1D, a: Array1D, b: Array1D, out: Array1D) -> None:
    """Choose ``a`` where the condition is not zero, else ``b``."""
    for i in range(out.shape[0]):
        out[i] = a[i] if condition[i] != 0.0 else b[i]


@kernel
def absolute(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = abs(a[i])


@kernel
def sign(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = math.copysign(1.0, a[i]) if a[i] != 0.0 else 0.0


@kernel
def square_root(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = math.sqrt(a[i]) if a[i] >= 0.0 else math.nan


@kernel
def exponential(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = exp(a[i])


@kernel
def logarithm(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = log(a[i])


@kernel
def logarithm_10(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _logarithm_10(a[i])


@kernel
def sine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = sin(a[i])


@kernel
def cosine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = cos(a[i])


@kernel
def tangent(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _tangent(a[i])


@kernel
def arc_sine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _arc_sine(a[i])


@kernel
def arc_cosine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = acos(a[i])


@kernel
def arc_tangent(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = atan2(a[i], 1.0)


@kernel
def angle(y: Array1D, x: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = atan2(y[i], x[i])


@kernel
def hyperbolic_sine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _hyperbolic_sine(a[i])


@kernel
def hyperbolic_cosine(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = _hyperbolic(a[i], 1.0)


@kernel
def hyperbolic_tangent(a: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = tanh(a[i])


@kernel
def hypotenuse(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = hypot(a[i], b[i])


@kernel
def least(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = min(a[i], b[i])


@kernel
def greatest(a: Array1D, b: Array1D, out: Array1D) -> None:
    for i in range(out.shape[0]):
        out[i] = max(a[i], b[i])


@kernel
def round_down(a: Array1D, out: Array1D) -> None:
    np.floor(a, out)


@kernel
def round_up(a: Array1D, out: Array1D) -> None:
    np.ceil(a, out)


@kernel
def nearest(a: Array1D, out: Array1D) -> None:
    """Round to the nearest whole number, of two to the even one."""
    np.rint(a, out)


FUNCTIONS: Mapping[str, Any] = {
    "abs": absolute, "sign": sign, "sqrt": square_root, "exp": exponential, "log": logarithm,
    "log10": logarithm_10, "sin": sine, "cos": cosine, "tan": tangent, "asin": arc_sine,
    "acos": arc_cosine, "atan": arc_tangent, "sinh": hyperbolic_sine, "cosh": hyperbolic_cosine,
    "tanh": hyperbolic_tangent, "floor": round_down, "ceil": round_up, "round": nearest,
}  # fmt: skip
"""Functions of one array, by name."""
OF_TWO: Mapping[str, Any] = {"atan2": angle, "min": least, "max": greatest, "hypot": hypotenuse}
"""Functions of two arrays, by name."""
