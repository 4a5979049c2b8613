"""Checks once a tick that every float of the bus is finite that may have changed in it.

The usual check is a kernel in a chain, or one cheap product; only if it fails is the element searched.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Iterator
from math import isfinite

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ..language.errors import AloftError
from ..language.layout import Layout
from .region import Region

_PIECE = 8192
"""Elements in one product: fewer than make a BLAS library start threads."""
_WORTH_A_CALL = 1024
"""Elements that take as long as another call; fewer that have not changed are checked with their neighbours."""
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


@kernel
def find_not_finite(values: Array, found: Indices) -> None:
    """Set ``found`` to one where a value is not finite."""
    wrong = 0
    # The difference of such a value from itself is not zero, but no number. A sum of all could overflow.
    for k in range(values.size):
        wrong |= int(values[k] - values[k] != 0.0)
    if wrong:
        found[0] = 1


class FiniteCheck:
    """Checks that every float of a region is finite.

    The scalar product of the region with a vector of tiny numbers is finite exactly if all elements
    are, and takes one call. (A vector of zeros would do, but NumPy warns of zero times infinity.)

    Attributes:
        calls: look for such a value in a chain of compiled kernels, in place of ``check``.
        found: (1,), not zero where they have found one; ``check`` says which.
    """

    def __init__(self, region: Region, unchanged: Collection[str] = ()) -> None:
        """Check all of a region but what lies together of blocks that write nothing in these ticks.

        Args:
            unchanged: their paths.
        """
        self._region = region
        floats = region.sections["float64"]
        tiny = np.full(min(_PIECE, floats.size), _TINY)
        ranges = list(_ranges(region.layout, frozenset(unchanged)))
        self._pieces = [
            (floats[i : min(i + _PIECE, stop)], tiny[: min(_PIECE, stop - i)])
            for start, stop in ranges
            for i in range(start, stop, _PIECE)
        ]
        self.found = np.zeros(1, np.int64)
        self.calls = tuple(
            KernelCall(find_not_finite, floats[start:stop], self.found) for start, stop in ranges
        )
        self._product = np.zeros(())
        self._value = self._product.reshape(1).data  # reading through this allocates no array

    @property
    def compiled(self) -> bool:
        """Whether a chain can make the ``calls``."""
        return bool(self.calls) and all(call.compiled is not None for call in self.calls)

    def check(self) -> None:
        """Raise ``NotFiniteError`` for the first element that is not finite."""
        self.found[0] = 0
        for floats, tiny in self._pieces:
            np.dot(floats, tiny, self._product)
            if not isfinite(self._value[0]):
                self._report()

    def _report(self) -> None:
        floats = self._region.sections["float64"]
        index = int(np.flatnonzero(~np.isfinite(floats))[0])
        place = self._region.layout.locate("float64", index)
        raise NotFiniteError(place, float(floats[index]))


def _ranges(layout: Layout, unchanged: Collection[str]) -> Iterator[tuple[int, int]]:
    """Yield the first element and the one after the last of what is checked of the section of floats."""
    start = end = 0
    for name, slot in layout.slots.items() if unchanged else ():
        if slot.section == "float64" and name.rsplit(".", 2)[0] not in unchanged:
            if slot.start - end >= _WORTH_A_CALL:
                if start < end:
                    yield start, end
                start = slot.start
            end = slot.start + slot.size
    whole = layout.lengths["float64"]
    if not unchanged or whole - end < _WORTH_A_CALL:
        end = whole
    if start < end:
        yield start, end
