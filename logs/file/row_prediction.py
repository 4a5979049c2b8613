"""Chooses from what each column of some rows is predicted, so that little is left to be kept.

A column is one word of eight bytes in every row. It is taken as a whole number that grows with the
float in it (``ordered``), so the difference of two floats that are nearly equal is a small number.
A column is predicted from its own last values, by differences of order 1 to 3 over time, or from
another column: the difference between both, of order 0 to 2 over time. Much on a bus is nearly or
exactly equal to something else, or to its negative: a measured and a true angle, a command and what
the safety monitor passes on, the upper and the lower half of a mass matrix.

Which predictions are good is estimated in a few short stretches. A poor choice costs bytes; what is
read back is exact with any.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int64]

MOST_ORDER = 3
STRETCHES, STRETCH = 6, 8
"""How many stretches are looked at, and the ticks of each."""
LEAST_GAIN = 1.0
"""Bits a value that another column must save, or else a column is predicted from itself."""


@dataclass(frozen=True)
class Prediction:
    """How each of ``n`` columns is predicted.

    Attributes:
        order: of the differences over time, (n,), 0 to 3.
        source: the column from which it is predicted, (n,); its own number if from none.
        negative: whether the source's negative is meant, (n,).
        bits: about how many bits a value are left, in halves, (n,): alike columns lie together.
    """

    order: NDArray[np.uint8]
    source: NDArray[np.int32]
    negative: NDArray[np.bool_]
    bits: NDArray[np.uint8]


def ordered(words: NDArray[np.int64]) -> Words:
    """The bits of floats as whole numbers that grow with the floats; its own inverse.

    The number of -x is minus one minus that of x.
    """
    result: Words = words ^ ((words >> 63) & np.int64(0x7FFFFFFFFFFFFFFF))
    return result


def predict(columns: Words) -> Prediction:
    """A good prediction of ``columns`` (n, ticks), which are ``ordered``."""
    count, ticks = columns.shape
    starts = np.unique(np.linspace(0, max(0, ticks - STRETCH), STRETCHES).astype(np.int64))
    places = np.minimum(starts[:, None] + np.arange(STRETCH), ticks - 1)
    sample = columns[:, places]
    costs = np.stack([_bits(sample, order) for order in range(1, MOST_ORDER + 1)])
    order, best = costs.argmin(axis=0) + 1, costs.min(axis=0)
    source, negative = np.arange(count, dtype=np.int32), np.zeros(count, np.bool_)
    if count > 1:
        _attach(list(_pairs(sample)), sample, order, best, source, negative)
    bits = np.minimum(np.round(2.0 * best), 255.0)
    return Prediction(order.astype(np.uint8), source, negative, bits.astype(np.uint8))


def _bits(sample: Words, order: int) -> NDArray[np.float64]:
    """The mean number of bits, (n,), of differences of an order of ``sample`` (n, stretches, ticks).

    As many values are looked at for any order.
    """
    left = sample[:, :, MOST_ORDER - order :]
    for _ in range(order):
        left = left[:, :, 1:] - left[:, :, :-1]
    mean: NDArray[np.float64] = np.frexp(np.abs(left.astype(np.float64)))[1].mean(axis=(1, 2))
    return mean


def _pairs(
    sample: Words,
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]]:
    """Pairs of columns that may be alike, and whether one is like the other's negative.

    Columns of nearly equal values, or of nearly equal changes, lie side by side when sorted by them.
    """
    with np.errstate(all="ignore"):
        values = ordered(sample).view(np.float64)
        half = len(values[0]) // 2
        keys = (
            values[:, half, 3],
            values[:, -1, 5],
            values[:, half, 4] - values[:, half, 3],
            values[:, -1, 7] - values[:, -1, 2],
        )
        for key in keys:
            by_size = np.argsort(np.abs(key), kind="stable")
            one, other = by_size[1:], by_size[:-1]
            yield one, other, np.signbit(key[one]) != np.signbit(key[other])


def _attach(
    pairs: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]],
    sample: Words,
    order: NDArray[np.int64],
    best: NDArray[np.float64],
    source: NDArray[np.int32],
    negative: NDArray[np.bool_],
) -> None:
    """Give columns a source where that saves most; changes the last four. There are no circles."""
    one, other, opposite = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    near = sample[other]
    left = sample[one] - np.where(opposite[:, None, None], ~near, near)
    costs = np.stack([_bits(left, k) for k in range(MOST_ORDER)])
    orders, cost = costs.argmin(axis=0), costs.min(axis=0)
    gain = np.maximum(best[one], best[other]) - cost
    tree = list(range(len(order)))

    def root(column: int) -> int:
        while tree[column] != column:
            tree[column] = column = tree[tree[column]]
        return column

    for k in np.argsort(-gain, kind="stable").tolist():
        if gain[k] < LEAST_GAIN:
            return
        a, b = int(one[k]), int(other[k])
        if best[a] < best[b]:
            a, b = b, a  # the dearer one is predicted from the cheaper one
        if source[a] != a and source[b] == b and best[b] - cost[k] >= LEAST_GAIN:
            a, b = b, a
        if source[a] == a and best[a] - cost[k] >= LEAST_GAIN and root(a) != root(b):
            tree[root(a)] = root(b)
            source[a], negative[a] = b, opposite[k]
            order[a], best[a] = orders[k], cost[k]
