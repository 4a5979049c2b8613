"""Checks once a tick that every float of the bus is finite.

The usual check is one cheap product; only if it fails is the element searched.
"""

from __future__ import annotations

import re
import warnings
from math import isfinite

import numpy as np

from ..language.errors import AloftError
from .memory import Region

_PIECE = 8192
"""Elements in one product: fewer than make a BLAS library start threads."""
_TINY = 1e-150
"""The factor of every element: so small that no sum of finite products overflows, yet so large that
usual products are not subnormal, which would be slow."""


warnings.filterwarnings(  # the check finds it itself; setting NumPy's state in each tick would take longer
    "ignore", "invalid value encountered in dot", RuntimeWarning, re.escape(__name__)
)


class NotFiniteError(AloftError):
    """A signal holds NaN or infinity, ``value``, at ``place``."""

    def __init__(self, place: str, value: float) -> None:
        super().__init__(f"{place} is {value}")
        self.place = place
        self.value = value


class FiniteCheck:
    """Checks that every float of a region is finite.

    The scalar product of the region with a vector of tiny numbers is finite exactly if all elements
    are, and takes one call. (A vector of zeros would do, but NumPy warns of zero times infinity.)
    """

    def __init__(self, region: Region) -> None:
        self._region = region
        floats = region.sections["float64"]
        tiny = np.full(min(_PIECE, floats.size), _TINY)
        self._pieces = [
            (floats[i : i + _PIECE], tiny[: floats[i : i + _PIECE].size])
            for i in range(0, floats.size, _PIECE)
        ]
        self._product = np.zeros(())
        self._value = self._product.reshape(1).data  # reading through this allocates no array

    def check(self) -> None:
        """Raise ``NotFiniteError`` for the first element that is not finite."""
        for floats, tiny in self._pieces:
            np.dot(floats, tiny, self._product)
            if not isfinite(self._value[0]):
                self._report()

    def _report(self) -> None:
        floats = self._region.sections["float64"]
        index = int(np.flatnonzero(~np.isfinite(floats))[0])
        place = self._region.layout.locate("float64", index)
        raise NotFiniteError(place, float(floats[index]))
