"""The tail of a recording of a version before 0.2 that was cut off: ``jump.rrd.tail`` beside it.

These versions wrote thousands of ticks at once, and until then kept the newest ticks in this file:
for each tick its number as int64, then the bytes of the bus.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_MISSING = 1_000_000
"""Ticks that may have been dropped between two ticks; a larger step is a damaged number."""


def tail_of(path: Path) -> Path:
    """The file beside the recording at ``path``."""
    return path.with_name(f"{path.name}.tail")


def record_type(bus_size: int) -> np.dtype[Any]:
    """One tick: ``tick``, and ``row``, the bytes of the bus after it."""
    return np.dtype([("tick", "<i8"), ("row", "u1", (bus_size,))])


def read_tail(
    path: Path, bus_size: int, after: int = -1
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Ticks (n,) and rows (n, bytes) in the tail of the recording at ``path``; without one, none.

    The tail ends where a tick's number cannot follow the one before it. ``after`` is the last tick
    of the recording itself, some of which may be in the tail once more.
    """
    kind = record_type(bus_size)
    try:
        data = tail_of(path).read_bytes()
    except FileNotFoundError:
        data = b""
    records = np.frombuffer(data, kind, len(data) // kind.itemsize)
    ticks = records["tick"].astype(np.int64)
    steps = np.diff(ticks)
    believed = len(ticks)
    if len(ticks) and not 0 <= ticks[0] <= after + MOST_MISSING:
        believed = 0
    elif (wrong := np.flatnonzero((steps <= 0) | (steps > MOST_MISSING))).size:
        believed = int(wrong[0]) + 1
    return ticks[:believed], records["row"][:believed]
