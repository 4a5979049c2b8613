"""Chooses the values of a signal from which a viewer draws the same curve with fewer of them.

A viewer joins neighbouring values by straight lines. So values that lie on the line between those
around them, but for less than one can see, are left out. Every value that is written is exact; a
peak is the value farthest from any line, so it is among them. Where a signal does not change, the
first and the last of the equal values are written: the force on a foot in flight is drawn as the
zero that it is.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .changed_rows import ChangedRows


class ThinnedRows:
    """Chooses the values of one signal, batch by batch. The ticks must come in order.

    Args:
        tolerance: how far a value that is left out may be from the line that is drawn instead, as a
            share of the range of all elements of the signal so far.
    """

    def __init__(self, tolerance: float) -> None:
        self._changed, self._tolerance = ChangedRows(), tolerance
        self._least, self._most = np.inf, -np.inf

    def pick(
        self, ticks: NDArray[np.int64], values: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """The ticks (m,) and values (m, k) to write of a batch: ``ticks`` (n,), ``values`` (n, k)."""
        ticks, values = self._changed.pick(ticks, values)
        numbers = values.astype(np.float64)
        if len(ticks) < 3 or not numbers.size or not np.isfinite(numbers).all():
            return ticks, values
        self._least = min(self._least, float(numbers.min()))
        self._most = max(self._most, float(numbers.max()))
        needed = on_lines(ticks, numbers, self._tolerance * (self._most - self._least))
        return ticks[needed], values[needed]

    def rest(self) -> tuple[NDArray[np.int64], NDArray[Any]] | None:
        """The last tick and value, if they were left out. They are written when no more ticks come."""
        return self._changed.rest()


def on_lines(
    ticks: NDArray[np.int64], values: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    """Which of ``values`` (n, k) at ``ticks`` (n,) must be joined by lines, (n,), so that no other
    value is farther than ``tolerance`` from them (Ramer, Douglas and Peucker, vertical distance).

    The first and the last are among them, and both ends of each stretch of equal values.
    """
    needed = np.zeros(len(ticks), np.bool_)
    needed[[0, -1]] = True
    equal = (values[1:] == values[:-1]).all(axis=1)
    needed[1:] |= equal
    needed[:-1] |= equal
    ends = np.flatnonzero(needed).tolist()
    open_stretches = [(a, b) for a, b in pairwise(ends) if b - a > 1]
    while open_stretches:
        a, b = open_stretches.pop()
        share = (ticks[a + 1 : b] - ticks[a]) / (ticks[b] - ticks[a])
        line = values[a] + share[:, None] * (values[b] - values[a])
        away = np.abs(values[a + 1 : b] - line).max(axis=1)
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = a + 1 + farthest
            needed[middle] = True
            open_stretches += [(c, d) for c, d in ((a, middle), (middle, b)) if d - c > 1]
    return needed
