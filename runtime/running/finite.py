"""One check of all floats of the bus, a tick: cheap while all is well, exact when it is not."""

from __future__ import annotations

from math import isfinite

import numpy as np

from ..language.errors import AloftError
from .memory import Region

_PIECE = 8192
"""Elements a product is taken of at once: below what makes a BLAS library start threads."""
_TINY = 1e-150
"""So small that no sum overflows, so large that no usual product is subnormal and thus slow."""


class NotFiniteError(AloftError):
    """A signal holds NaN or infinity; ``place`` says which, ``value`` what."""

    def __init__(self, place: str, value: float) -> None:
        super().__init__(f"{place} is {value}")
        self.place = place
        self.value = value


class FiniteCheck:
    """Checks that every float of a region is finite.

    The product with a vector of tiny numbers is finite unless an element is not, whatever the size
    of the others, and takes one call. (Zeros would do but for NumPy's warning on infinity.)
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
        self._value = self._product.reshape(1).data  # read through this, no array is made

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
