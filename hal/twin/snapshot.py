"""Keeps what changes in some objects as one array of numbers, for a snapshot of a run."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array

Part = tuple[object, tuple[str, ...]]
"""An object, and the names of its attributes that change: arrays, numbers, or dictionaries of
numbers whose keys do not change."""


class Frozen:
    """The values of these attributes, in their order, as float64.

    Whole numbers must be within 2^53. A member of an enumeration stays one.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        self._places = [(owner, name) for owner, names in parts for name in names]
        self.size = sum(_values(getattr(owner, name)).size for owner, name in self._places)

    def save(self, out: Array) -> None:
        """Write all values to ``out``, (size,)."""
        start = 0
        for owner, name in self._places:
            values = _values(getattr(owner, name))
            out[start : start + values.size] = values.ravel()
            start += values.size

    def load(self, kept: Array) -> None:
        """Set all values to those that ``save`` wrote."""
        start = 0
        for owner, name in self._places:
            present: Any = getattr(owner, name)
            size = _values(present).size
            values = kept[start : start + size]
            start += size
            if isinstance(present, np.ndarray):
                present[...] = values.reshape(present.shape)
            elif isinstance(present, dict):
                present.update(zip(present, values.tolist(), strict=True))
            elif isinstance(present, IntEnum):
                setattr(owner, name, type(present)(int(values[0])))
            else:
                setattr(owner, name, type(present)(values[0]))


def _values(value: Any) -> NDArray[Any]:
    return np.asarray(list(value.values()) if isinstance(value, dict) else value)
