"""Kernels that move the entries of a ring buffer, for the runtime's own blocks.

An entry is a row of bytes, so that machine code for one type serves signals of every dtype.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Indices
from ..kernel import kernel

Octets = NDArray[np.uint8]


@kernel
def read_entry(ring: Octets, oldest: Indices, out: Octets) -> None:
    """Copy the ``oldest`` of the entries of a field, (k, n), to ``out`` (1, n)."""
    row = int(oldest[()])
    for i in range(out.shape[1]):
        out[0, i] = ring[row, i]


@kernel
def write_entry(ring: Octets, oldest: Indices, values: Octets) -> None:
    """Put ``values`` (1, n) in the place of the ``oldest`` of the entries, (k, n)."""
    row = int(oldest[()])
    for i in range(values.shape[1]):
        ring[row, i] = values[0, i]


@kernel
def next_entry(oldest: Indices, length: int) -> None:
    """Go on to the next of ``length`` entries, which is the oldest now."""
    oldest[()] = (int(oldest[()]) + 1) % length
