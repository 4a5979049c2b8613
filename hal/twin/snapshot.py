"""The changing attributes of Python objects as one array of numbers, for a snapshot of a run."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array

Attributes = tuple[object, tuple[str, ...]]
"""An object, and the names of its attributes that change in a run.

An attribute is an array, a number, or a dictionary of numbers whose keys do not change.
"""


class ObjectSnapshot:
    """Saves the values of attributes to an array of float64, in their order, and restores them.

    Arrays are restored in place, so views of them stay valid. Whole numbers must be within 2^53. A
    member of an enumeration stays one.

    Attributes:
        size: how many numbers there are.
    """

    def __init__(self, parts: Sequence[Attributes]) -> None:
        self._places = [(owner, name) for owner, names in parts for name in names]
        self.size = sum(_values(getattr(owner, name)).size for owner, name in self._places)

    def save(self, out: Array) -> None:
        """Write all values to ``out``, (size,)."""
        start = 0
        for owner, name in self._places:
            values = _values(getattr(owner, name))
            out[start : start + values.size] = values.ravel()
            start += values.size

    def load(self, values: Array) -> None:
        """Set all values to those that ``save`` wrote."""
        start = 0
        for owner, name in self._places:
            current: Any = getattr(owner, name)
            size = _values(current).size
            saved = values[start : start + size]
            start += size
            if isinstance(current, np.ndarray):
                current[...] = saved.reshape(current.shape)
            elif isinstance(current, dict):
                current.update(zip(current, saved.tolist(), strict=True))
            elif isinstance(current, IntEnum):
                setattr(owner, name, type(current)(int(saved[0])))
            else:
                setattr(owner, name, type(current)(saved[0]))


def _values(value: Any) -> NDArray[Any]:
    return np.asarray(list(value.values()) if isinstance(value, dict) else value)
