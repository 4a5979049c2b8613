"""Chooses the values of a signal that must be written so that the same curve is drawn.

A value is left out if it has the same bits as the values of the tick before and of the tick after.
A reader takes the last value at or before a tick, and the line that a viewer draws is the same. A
signal that changes in every tick is written whole; a constant is two values.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class ChangedRows:
    """Chooses the values of one signal, batch by batch. The ticks must come in order."""

    def __init__(self) -> None:
        self._tick: NDArray[np.int64] | None = None
        self._value: NDArray[Any] | None = None
        self._left_out = False

    def pick(
        self, ticks: NDArray[np.int64], values: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """The ticks (m,) and values (m, k) to write of a batch: ``ticks`` (n,), ``values`` (n, k)."""
        changed = self._changes(values)
        needed = changed.copy()
        needed[:-1] |= changed[1:]
        last_tick, last_value = self._tick, self._value
        before = bool(changed[0]) and self._left_out
        self._tick, self._value = ticks[-1:].copy(), values[-1:].copy()
        self._left_out = not needed[-1]
        if not needed.all():
            ticks, values = ticks[needed], values[needed]
        if before:  # the end of a constant stretch, which nobody knew to be one
            assert last_tick is not None and last_value is not None
            return np.concatenate([last_tick, ticks]), np.concatenate([last_value, values])
        return ticks, values

    def rest(self) -> tuple[NDArray[np.int64], NDArray[Any]] | None:
        """The last tick and value, if they were left out. They are written when no more ticks come."""
        if not self._left_out or self._tick is None or self._value is None:
            return None
        self._left_out = False
        return self._tick, self._value

    def _changes(self, values: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether each of ``values`` (n, k) has other bits than the one before it, (n,)."""
        whole = f"i{values.itemsize}"  # as -0.0 equals 0.0, and no NaN itself
        bits = np.ascontiguousarray(values).view(whole)
        changed = np.ones(len(bits), np.bool_)
        changed[1:] = (bits[1:] != bits[:-1]).any(axis=1)
        if self._value is not None:
            changed[0] = bool((bits[0] != self._value.view(whole)[0]).any())
        return changed
