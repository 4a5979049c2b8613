"""NumPy's functions for one number each: what equations apply to every element.

They have the same bits in every tier and on every processor, and like NumPy's they answer NaN outside of
their domain, where Python's ``math`` raises an error.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import elementary
from ..kernel import kernel


def room(shape: tuple[int, ...], dtype: str) -> NDArray[Any]:
    """Make an array of zeros; in compiled code it stands on the stack of the kernel."""
    return np.zeros(shape, dtype)


def demand(size: int, wanted: int) -> None:
    """Raise an error where a slice has another length than what it is combined with."""
    if size != wanted:
        raise IndexError(f"a slice of {size} elements stands where {wanted} are needed")


@kernel
def maximum(a: float, b: float) -> float:
    return a if a >= b or math.isnan(a) else b


@kernel
def minimum(a: float, b: float) -> float:
    return a if a <= b or math.isnan(a) else b


@kernel
def clip(x: float, low: float, high: float) -> float:
    return minimum(maximum(x, low), high)


@kernel
def sign(x: float) -> float:
    return 1.0 if x > 0.0 else -1.0 if x < 0.0 else 0.0 if x == 0.0 else x


@kernel
def sqrt(x: float) -> float:
    return math.sqrt(x) if x >= 0.0 else math.nan


@kernel
def sin(x: float) -> float:
    return elementary.sin(x)


@kernel
def cos(x: float) -> float:
    return elementary.cos(x)


@kernel
def tan(x: float) -> float:
    sine, cosine = elementary.sincos(x)
    return sine / cosine if cosine != 0.0 else math.nan


@kernel
def exp(x: float) -> float:
    return elementary.exp(x)


@kernel
def expm1(x: float) -> float:
    return elementary.expm1(x)


@kernel
def log(x: float) -> float:
    return elementary.log(x)


@kernel
def tanh(x: float) -> float:
    return elementary.tanh(x)


@kernel
def arccos(x: float) -> float:
    return elementary.acos(x) if abs(x) <= 1.0 else math.nan


@kernel
def arcsin(x: float) -> float:
    return elementary.atan2(x, math.sqrt((1.0 - x) * (1.0 + x))) if abs(x) <= 1.0 else math.nan


@kernel
def arctan(x: float) -> float:
    return elementary.atan2(x, 1.0)


@kernel
def arctan2(y: float, x: float) -> float:
    return elementary.atan2(y, x)


@kernel
def hypot(x: float, y: float) -> float:
    return elementary.hypot(x, y)


@kernel
def floor(x: float) -> float:
    if not abs(x) < 4503599627370496.0:
        return x
    return math.copysign(float(math.floor(x)), x) if x != 0.0 else x


@kernel
def ceil(x: float) -> float:
    if not abs(x) < 4503599627370496.0:
        return x
    return math.copysign(float(math.ceil(x)), x)


@kernel
def trunc(x: float) -> float:
    if not abs(x) < 4503599627370496.0:
        return x
    return math.copysign(float(math.trunc(x)), x)


@kernel
def rint(x: float) -> float:
    if not abs(x) < 4503599627370496.0:
        return x
    return math.copysign(float(round(x)), x)


@kernel
def isnan(x: float) -> bool:
    return math.isnan(x)


@kernel
def isfinite(x: float) -> bool:
    return x - x == 0.0


@kernel
def isinf(x: float) -> bool:
    return abs(x) == math.inf
