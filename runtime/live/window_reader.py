"""The side of a window that reads: in another process, at any time."""

from __future__ import annotations

import mmap
import os
import time
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ..running.timing import STAMPED_TICKS
from .window import CHANGES, HEAD, OVERRUNS, SAID, SEQUENCE, SKIPPED, STATE, TEXT, TICK, Shape

TRIES = 50
"""How often a window that is being written is read again, each a millisecond later."""


@dataclass(frozen=True)
class Look:
    """What a window showed at one moment.

    Attributes:
        tick: the last tick that is shown.
        state: one of ``STARTING``, ``RUNNING`` and ``ENDED``.
        overruns: how many ticks began too late.
        skipped: how many periods were left out.
        changes: how many changes of parameters there were.
        late: for each block, how many deadlines passed while it ran.
        said: why the run has ended.
        bus: the bytes of the bus.
        stamps: for each program, the stamps [ns] of its last ticks, (ticks, calls + 1).
    """

    tick: int
    state: int
    overruns: int
    skipped: int
    changes: int
    late: dict[str, int]
    said: str
    bus: NDArray[np.uint8]
    stamps: list[NDArray[np.int64]]


class WindowReader:
    """Reads a window; it takes the descriptor over."""

    def __init__(self, descriptor: int, shape: Shape) -> None:
        self.shape = shape
        try:
            self._map = mmap.mmap(descriptor, shape.size, access=mmap.ACCESS_READ)
        finally:
            os.close(descriptor)
        self._fence = Lock()

    def look(self) -> Look | None:
        """What the window shows now; ``None`` where its writer was stopped while it wrote."""
        copy = self.copy()
        return None if copy is None else look_of(copy, self.shape)

    def copy(self) -> bytes | None:
        """The window's bytes as they are now; ``None`` as for ``look``."""
        for _ in range(TRIES):
            before = self._sequence()
            with self._fence:
                pass
            copy = self._map[:]
            with self._fence:
                pass
            if before % 2 == 0 and self._sequence() == before:
                return copy
            time.sleep(1e-3)
        return None

    def close(self) -> None:
        """Let the memory go."""
        self._map.close()

    def _sequence(self) -> int:
        return int.from_bytes(self._map[8 * SEQUENCE : 8 * SEQUENCE + 8], "little", signed=True)


def look_of(copy: bytes, shape: Shape) -> Look:
    """What the bytes of a window say, which must be as many as its shape has."""
    words = np.frombuffer(copy, np.int64, shape.text_start // 8)
    length = min(int(words[SAID]), TEXT)
    said = copy[shape.text_start : shape.text_start + length].decode(errors="replace")
    return Look(
        tick=int(words[TICK]),
        state=int(words[STATE]),
        overruns=int(words[OVERRUNS]),
        skipped=int(words[SKIPPED]),
        changes=int(words[CHANGES]),
        late=dict(zip(shape.blocks, words[HEAD : shape.cursors].tolist(), strict=True)),
        said=said,
        bus=np.frombuffer(copy, np.uint8, shape.bus, shape.bus_start),
        stamps=[_stamps(copy, shape, words, number) for number in range(len(shape.programs))],
    )


def _stamps(copy: bytes, shape: Shape, words: NDArray[np.int64], number: int) -> NDArray[np.int64]:
    """The rows of a program that hold stamps, the oldest first, each in the order of time."""
    ticks, newest = words[shape.cursors + 2 * number :][:2].tolist()
    first, last = shape.stamps(number)
    rows = np.frombuffer(copy[first:last], np.int64).reshape(STAMPED_TICKS, -1)
    rows = rows[:, shape.orders[number]]
    return np.concatenate([rows[newest:], rows[:newest]]) if ticks else rows[:newest]
