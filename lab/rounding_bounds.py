"""Numbers that carry how far rounding may take them: the judge's arithmetic for ``judge_kernels``.

An array of values goes with one of bounds. What is computed of exact numbers by one operation of IEEE 754 is the same
everywhere, so its bound is zero; a sum of n terms may be summed in any order, so its bound is n eps of the sum of the
terms' magnitudes, unless no order rounds; an elementary function may be 2 ULP off; and each operation carries the
bounds of what it takes. Where a bound reaches over a threshold (a comparison, a whole number, a branch cut), rounding
decides, and ``AtThreshold`` is raised.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

EPS = 2.0**-52
ULPS = 2.0
"""How many units in the last place an elementary function may be off."""
_GRID, _EXACT = 2.0**20, 2.0**53
"""Sums of multiples of 1 / ``_GRID`` whose magnitudes add up to less than ``_EXACT`` of these are exact."""


class AtThreshold(Exception):
    """Rounding decides which way a kernel goes."""


class Bounded:
    """Values, and by how much others may differ from them; both are NumPy's arrays of one shape."""

    __array_ufunc__ = None  # NumPy's arrays leave operations with it to it

    def __init__(self, value: Any, bound: Any = 0.0) -> None:
        self.value = np.asarray(value)
        self.bound = (
            np.broadcast_to(np.asarray(bound, float), self.value.shape)
            if np.ndim(bound) == 0
            else bound
        )

    # As an array

    @property
    def shape(self) -> tuple[int, ...]:
        return self.value.shape

    @property
    def T(self) -> Bounded:
        return Bounded(self.value.T, self.bound.T)

    def copy(self) -> Bounded:
        return Bounded(self.value.copy(), np.array(self.bound))

    def __len__(self) -> int:
        return len(self.value)

    def __iter__(self) -> Any:
        return (self[k] for k in range(len(self.value)))

    def __getitem__(self, place: Any) -> Bounded:
        return Bounded(self.value[place], self.bound[place])

    def __setitem__(self, place: Any, value: Any) -> None:
        other = bounded(value)
        self.value[place], self.bound[place] = other.value, other.bound

    # Exact operations

    def __add__(self, other: Any) -> Bounded:
        other = bounded(other)
        return rounded(self.value + other.value, self.bound + other.bound)

    def __sub__(self, other: Any) -> Bounded:
        other = bounded(other)
        return rounded(self.value - other.value, self.bound + other.bound)

    def __mul__(self, other: Any) -> Bounded:
        other = bounded(other)
        return rounded(self.value * other.value, _of_product(self, other))

    def __truediv__(self, other: Any) -> Bounded:
        other = bounded(other)
        least = np.abs(other.value) - other.bound
        if np.any((least <= 0.0) & (other.bound > 0.0)):
            raise AtThreshold("a divisor may be zero")
        value = self.value / other.value
        return rounded(value, _ratio(self.bound + np.abs(value) * other.bound, least))

    def __mod__(self, other: Any) -> Bounded:
        other = bounded(other)
        self._expect_same(np.floor_divide, other)
        return rounded(self.value % other.value, self.bound + 0.0 * other.bound)

    def __floordiv__(self, other: Any) -> Bounded:
        other = bounded(other)
        self._expect_same(np.floor_divide, other)
        return Bounded(self.value // other.value)

    def _expect_same(self, function: Any, other: Bounded) -> None:
        """Raise ``AtThreshold`` where a function has several values within the bound."""
        if np.any(other.bound > 0.0) or np.any(
            function(self.value - self.bound, other.value)
            != function(self.value + self.bound, other.value)
        ):
            raise AtThreshold(f"{function.__name__} has several values")

    def __pow__(self, other: Any) -> Bounded:
        if other == 2:
            return self * self
        return elementary(lambda x: x**other)(self)

    def __neg__(self) -> Bounded:
        return Bounded(-self.value, self.bound)

    def __abs__(self) -> Bounded:
        return Bounded(np.abs(self.value), self.bound)

    def __radd__(self, other: Any) -> Bounded:
        return bounded(other) + self

    def __rsub__(self, other: Any) -> Bounded:
        return bounded(other) - self

    def __rmul__(self, other: Any) -> Bounded:
        return bounded(other) * self

    def __rtruediv__(self, other: Any) -> Bounded:
        return bounded(other) / self

    def __rmod__(self, other: Any) -> Bounded:
        return bounded(other) % self

    def __rfloordiv__(self, other: Any) -> Bounded:
        return bounded(other) // self

    # Decisions

    def _decided(self, other: Any, compare: Any) -> Any:
        other = bounded(other)
        reach = self.bound + other.bound
        if np.any((np.abs(self.value - other.value) <= reach) & (reach > 0.0)):
            raise AtThreshold("two numbers are as near to each other as rounding reaches")
        return compare(self.value, other.value)

    def __lt__(self, other: Any) -> Any:
        return self._decided(other, np.less)

    def __le__(self, other: Any) -> Any:
        return self._decided(other, np.less_equal)

    def __gt__(self, other: Any) -> Any:
        return self._decided(other, np.greater)

    def __ge__(self, other: Any) -> Any:
        return self._decided(other, np.greater_equal)

    def __eq__(self, other: object) -> Any:
        return self._decided(other, np.equal)

    def __ne__(self, other: object) -> Any:
        return self._decided(other, np.not_equal)

    __hash__ = None  # type: ignore[assignment]

    def whole(self) -> int:
        if np.trunc(self.value - self.bound) != np.trunc(self.value + self.bound):
            raise AtThreshold("a number may be cut to several whole numbers")
        return int(self.value)

    # Reductions

    def __matmul__(self, other: Any) -> Bounded:
        return _product(self, bounded(other))

    def __rmatmul__(self, other: Any) -> Bounded:
        return _product(bounded(other), self)

    def sum(self) -> Bounded:
        terms = np.abs(self.value)
        bound = terms.size * EPS * terms.sum() + self.bound.sum()
        return Bounded(np.sum(self.value), 0.0 if _is_exact(self) else bound)

    def max(self, axis: int | None = None) -> Bounded:
        if axis is not None:
            return _of_rows(Bounded.max, self, axis)
        return Bounded(np.max(self.value), np.max(self.bound))

    def min(self) -> Bounded:
        return Bounded(np.min(self.value), np.max(self.bound))


def bounded(value: Any) -> Bounded:
    """Return a number or an array as one that carries its bound, which is zero if it had none."""
    if isinstance(value, list):
        return _array(value)
    return value if isinstance(value, Bounded) else Bounded(value)


def rounded(value: Any, bound: Any) -> Bounded:
    """Return a result that has been rounded once: of operands with bounds that may fall on another side."""
    bound = np.broadcast_to(bound, np.shape(value))
    return Bounded(value, np.where(bound > 0.0, bound + EPS * np.abs(value), 0.0))


def _of_product(a: Bounded, b: Bounded) -> Any:
    return np.abs(a.value) * b.bound + np.abs(b.value) * a.bound + a.bound * b.bound


def _ratio(above: Any, below: Any) -> Any:
    return np.where(above > 0.0, above / np.where(below > 0.0, below, 1.0), 0.0)


def _is_exact(*factors: Bounded) -> bool:
    """Return whether sums of the products of some numbers are exact in any order."""
    grid = _GRID ** (1.0 / len(factors))
    whole = all(
        not np.any(each.bound) and np.all(each.value * grid == np.floor(each.value * grid))
        for each in factors
    )
    sizes = [np.abs(each.value).sum() for each in factors]
    return bool(whole and math.prod(sizes) * _GRID < _EXACT)


def _product(a: Bounded, b: Bounded) -> Bounded:
    value = a.value @ b.value
    if _is_exact(a, b):
        return Bounded(value)
    n = a.value.shape[-1]
    upper = (np.abs(a.value) + a.bound) @ (np.abs(b.value) + b.bound)
    magnitude = np.abs(a.value) @ np.abs(b.value)
    return Bounded(value, n * EPS * magnitude + (1.0 + n * EPS) * (upper - magnitude))


def elementary(
    function: Callable[..., Any], steep: Callable[..., Any] | None = None
) -> Callable[..., Bounded]:
    """Return a function of numbers with its bound: ``ULPS``, and how much it changes within those of its arguments,
    which ``steep`` gives, or its values at both ends of a monotonous piece."""

    def applied(*given: Any) -> Bounded:
        arguments = [bounded(each) for each in given]
        values = [each.value for each in arguments]
        value = function(*values)
        if steep is not None:
            spread = steep(*arguments)
        else:
            (x,) = arguments
            ends = [function(x.value + sign * x.bound) for sign in (-1.0, 1.0)]
            spread = np.fmax(np.abs(ends[0] - value), np.abs(ends[1] - value))
        return Bounded(value, ULPS * np.spacing(np.abs(value)) + spread)

    return applied


def _step(function: Callable[..., Any]) -> Callable[..., Bounded]:
    """Return a function with jumps, such as ``floor``, which is exact between them."""

    def applied(x: Any) -> Bounded:
        x = bounded(x)
        if np.any(function(x.value - x.bound) != function(x.value + x.bound)):
            raise AtThreshold(f"{function.__name__} has several values")
        return Bounded(function(x.value))

    return applied


def _arctan2_steepness(y: Bounded, x: Bounded) -> Any:
    if np.any((np.abs(y.value) <= y.bound) & (y.bound > 0.0) & (x.value - x.bound <= 0.0)):
        raise AtThreshold("an angle may be on both sides of the cut")
    spread = y.bound + x.bound
    radius = np.hypot(
        np.maximum(np.abs(y.value) - y.bound, 0.0), np.maximum(np.abs(x.value) - x.bound, 0.0)
    )
    return _ratio(spread, radius)


def _sqrt(x: Any) -> Bounded:
    x = bounded(x)
    value = np.sqrt(x.value)  # correctly rounded, so exact numbers have one root
    low, high = np.sqrt(np.maximum(x.value - x.bound, 0.0)), np.sqrt(x.value + x.bound)
    return rounded(value, np.fmax(value - low, high - value))


def _chosen(choose: Any) -> Callable[..., Bounded]:
    """Return the smaller or larger of two, element by element."""

    def applied(a: Any, b: Any) -> Bounded:
        a, b = bounded(a), bounded(b)
        value = choose(a.value, b.value)
        near = np.abs(a.value - b.value) <= a.bound + b.bound
        bound = np.where(
            near, np.maximum(a.bound, b.bound), np.where(value == a.value, a.bound, b.bound)
        )
        return Bounded(value, bound)

    return applied


def _where(flags: Any, a: Any, b: Any) -> Bounded:
    a, b = bounded(a), bounded(b)
    return Bounded(np.where(flags, a.value, b.value), np.where(flags, a.bound, b.bound))


def _extreme(find: Any, sign: float) -> Callable[[Any], Any]:
    def applied(x: Any) -> Any:
        x = bounded(x)
        k = int(find(x.value))
        first = x[k]
        gap = sign * (first.value - x.value)
        reach = first.bound + x.bound
        if np.any((np.delete(gap, k) <= np.delete(reach, k)) & (np.delete(reach, k) > 0.0)):
            raise AtThreshold("two elements are as near to each other as rounding reaches")
        return k

    return applied


def _product_of(x: Any) -> Bounded:
    made = bounded(1.0)
    for each in bounded(x):
        made = made * each
    return (
        made
        if len(bounded(x)) <= 2
        else Bounded(made.value, made.bound + len(bounded(x)) * EPS * np.abs(made.value))
    )


def _norm(x: Any) -> Bounded:
    x = bounded(x)
    root = _sqrt((x * x).sum())
    return Bounded(root.value, root.bound + x.value.size * EPS * root.value)


def _cross(a: Any, b: Any) -> Bounded:
    a, b = bounded(a), bounded(b)
    rows = [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return _array(rows)


def _array(rows: Sequence[Any]) -> Bounded:
    each = [bounded(one) for one in rows]
    return Bounded(
        np.array([one.value for one in each], float), np.array([one.bound for one in each], float)
    )


def _filled(make: Any) -> Callable[..., Bounded]:
    def made(*given: Any) -> Bounded:
        if len(given) == 2:
            of = bounded(given[1])
            return Bounded(make(given[0], float(of.value)), np.full(given[0], float(of.bound)))
        value = make(*given)
        return Bounded(value, np.zeros(value.shape))

    return made


def _of_rows(function: Callable[[Any], Any], x: Bounded, axis: int) -> Bounded:
    return _array([function(row) for row in (x.T if axis == 0 else x)])


def _summed(x: Any, axis: int | None = None) -> Any:
    if axis is not None:
        return _of_rows(_summed, x, axis)
    return x.sum() if isinstance(x, Bounded) else np.sum(x)  # of whole numbers or flags


def _mean(x: Any, axis: int | None = None) -> Bounded:
    if axis is not None:
        return _of_rows(_mean, x, axis)
    return bounded(x).sum() / float(bounded(x).value.size)


def _clip(x: Any, low: Any, high: Any) -> Bounded:
    return _chosen(np.minimum)(_chosen(np.maximum)(x, low), high)


NUMPY = types.SimpleNamespace(
    minimum=_chosen(np.minimum), maximum=_chosen(np.maximum), clip=_clip, where=_where, abs=abs, sqrt=_sqrt,
    sin=elementary(np.sin, lambda x: x.bound), tanh=elementary(np.tanh), floor=_step(np.floor), round=_step(np.rint), sign=_step(np.sign),
    arctan2=elementary(np.arctan2, _arctan2_steepness), sum=_summed, mean=_mean, prod=_product_of,
    max=lambda x: x.max(), min=lambda x: x.min(), argmax=_extreme(np.argmax, 1.0), argmin=_extreme(np.argmin, -1.0),
    mod=lambda a, b: bounded(a) % b, deg2rad=lambda x: bounded(x) * (math.pi / 180.0), pi=math.pi,
    any=np.any, all=np.all, dot=lambda a, b: bounded(a) @ b, cross=_cross,
    outer=lambda a, b: bounded(a)[:, None] * bounded(b)[None, :],
    zeros=_filled(np.zeros), ones=_filled(np.ones), full=_filled(np.full), eye=_filled(np.eye), array=_array,
    linalg=types.SimpleNamespace(norm=_norm),
)  # fmt: skip
"""What the kernels of the grammar take from NumPy."""


def _of_one_or_more(choose: Any, of_two: Any) -> Callable[..., Any]:
    def applied(*given: Any) -> Any:
        if any(isinstance(each, Bounded) for each in given):
            made = given[0]
            for each in given[1:]:
                made = of_two(made, each)
            return made
        return choose(*given)

    return applied


FUNCTIONS: dict[str, Any] = {
    "np": NUMPY, "cross": _cross, "sum": lambda x: bounded(x).sum(),
    "min": _of_one_or_more(min, _chosen(np.minimum)), "max": _of_one_or_more(max, _chosen(np.maximum)),
    "float": lambda x: x if isinstance(x, Bounded) else float(x),
    "int": lambda x: x.whole() if isinstance(x, Bounded) else int(x),
}  # fmt: skip


def with_bounds(values: Any) -> Any:
    """Return arguments with bounds, of zero; whole numbers, flags and Python's numbers stay as they are."""
    if isinstance(values, np.ndarray):
        return Bounded(values, np.zeros(values.shape)) if values.dtype.kind == "f" else values
    if isinstance(values, tuple):
        return type(values)(*map(with_bounds, values))
    return [with_bounds(each) for each in values] if isinstance(values, list) else values


def bounds_in(values: Any) -> list[NDArray[np.float64]]:
    """Return the bounds of all arrays of arguments; those of whole numbers and flags are zero."""
    if isinstance(values, Bounded):
        return [values.bound]
    if isinstance(values, np.ndarray):
        return [np.zeros(values.shape)]
    if isinstance(values, list | tuple):
        return [found for each in values for found in bounds_in(each)]
    return []


def values_in(values: Any) -> list[NDArray[Any]]:
    """Return the arrays of arguments, without their bounds."""
    if isinstance(values, Bounded):
        return [values.value]
    if isinstance(values, np.ndarray):
        return [values]
    if isinstance(values, list | tuple):
        return [found for each in values for found in values_in(each)]
    return []
