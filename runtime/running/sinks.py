"""The sinks of every run: the run hash, and the whole bus in memory."""

from __future__ import annotations

from bisect import bisect_left
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.layout import Layout
from .memory import BoundGraph
from .sink import Note, Sink


class RunHash(Sink):
    """The run hash: BLAKE2b over the bytes of the bus after every tick.

    Two runs have the same hash exactly if all their signals have the same bytes in every tick.
    """

    def __init__(self) -> None:
        self._hash = blake2b(digest_size=16)

    def open(self, bound: BoundGraph) -> None:
        """Start from nothing."""
        self._hash = blake2b(digest_size=16)
        self._bus = bound.memory.bus.buffer.data

    def record(self, tick: int) -> None:
        """Add one tick."""
        self._hash.update(self._bus)

    def kept(self) -> RunHash:
        """Return a copy of the hash so far, for ``go_on_from``."""
        copy = RunHash()
        copy._hash = self._hash.copy()
        return copy

    def go_on_from(self, kept: RunHash) -> None:
        """Go back to what ``kept`` has given."""
        self._hash = kept._hash.copy()

    def hexdigest(self) -> str:
        """Return the hash so far, 32 hexadecimal digits."""
        return self._hash.hexdigest()


class MemoryLog(Sink):
    """Every tick of the bus in memory."""

    CHUNK = 1024
    """Ticks by which the memory grows whenever their number is not known or has been exceeded."""

    def __init__(self) -> None:
        self._expected: int | None = None
        self._chunks: list[NDArray[np.uint8]] = []
        self._used = 0
        self.ticks: list[int] = []
        self.notes: list[Note] = []
        self.layout: Layout | None = None

    def expect(self, ticks: int | None) -> None:
        """Set, before ``open``, the number of ticks to allocate for; recording more is no error."""
        self._expected = ticks

    def open(self, bound: BoundGraph) -> None:
        """Allocate memory for the ticks and forget those of an earlier run."""
        self.layout = bound.memory.bus.layout
        self._bus = bound.memory.bus.buffer.data
        self._size = bound.memory.bus.buffer.size
        self._chunks, self.ticks, self.notes = [], [], []
        self._add_chunk(self._expected or self.CHUNK)

    def _add_chunk(self, rows: int) -> None:
        chunk = np.empty((rows, self._size), np.uint8)
        self._chunks.append(chunk)
        self._flat = chunk.data.cast("B") if chunk.size else memoryview(bytearray())
        self._used = 0

    def record(self, tick: int) -> None:
        """Copy the bus."""
        first = self._used * self._size
        if first >= len(self._flat) and self._size:
            self._add_chunk(self.CHUNK)
            first = 0
        self._flat[first : first + self._size] = self._bus
        self._used += 1
        self.ticks.append(tick)

    def rewind(self, tick: int) -> None:
        """Forget ``tick`` and all after it; notes stay."""
        count = bisect_left(self.ticks, tick)
        rows = self.rows()[:count].copy()
        del self.ticks[count:]
        self._chunks = [rows]
        self._add_chunk(self.CHUNK)

    def note(self, note: Note) -> None:
        """Keep the note."""
        self.notes.append(note)

    def __getstate__(self) -> dict[str, Any]:
        """Return the recording, without the views of memory that only a run needs."""
        kept = {"_expected": None, "_chunks": [self.rows()], "_used": len(self.ticks)}
        return {**kept, "ticks": self.ticks, "notes": self.notes, "layout": self.layout}

    def rows(self) -> NDArray[np.uint8]:
        """All recorded ticks, (ticks, bytes)."""
        full = self._chunks[:-1]
        last = self._chunks[-1][: self._used] if self._chunks else np.zeros((0, 0), np.uint8)
        return np.concatenate([*full, last]) if full else last
