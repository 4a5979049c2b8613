"""Sinks keep what happens in a run: each is called once a tick and may take one copy of the bus."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from hashlib import blake2b
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..language.block import Metric
from ..language.layout import Layout
from ..language.parameter_change import ParameterChange
from .memory import BoundGraph


@dataclass(frozen=True)
class Note:
    """An event of a run at ``tick``, before that tick ran, which the runtime gives to all recorders.

    The runtime writes the kinds ``life`` (a change of the life cycle), ``overrun`` (a late tick),
    ``late`` (a result of a background block that was due and not there), ``fault`` (the error that
    ended a run early), ``warning`` (a block's warning to those who read the result) and ``parameter``
    (a live change). Recorders add ``dropped`` (ticks that were not kept).

    Attributes:
        kind: a word to search for.
        text: one line for people.
        level: ``INFO``, ``WARN`` or ``ERROR``.
        data: the same for machines, as plain data.
    """

    tick: int
    kind: str
    text: str
    level: str = "INFO"
    data: Mapping[str, Any] = field(default_factory=dict)


@runtime_checkable
class SupportsNotes(Protocol):
    """The method that a sink has, beside ``record``, if it wants to receive notes."""

    def note(self, note: Note) -> None:
        """Keep a note. The control thread calls this, so it must not wait."""


def parameter_note(change: ParameterChange) -> Note:
    """Make the note of a live change; its ``data`` are the attributes of the change."""
    text = f"{change.path}: {change.old} -> {change.new}"
    return Note(change.tick, "parameter", text, data=asdict(change))


class Sink(Protocol):
    """Takes the bus of every tick. Row k is the bus after all outputs of tick k were written."""

    def open(self, bound: BoundGraph) -> None:
        """Prepare, once, before the first tick."""

    def record(self, tick: int) -> None:
        """Copy the bus of this tick. The control thread calls this, so it must do no more.

        A sink that waits in it nevertheless, with a limit of its own, has the attribute
        ``waits_for_others``, true meanwhile; otherwise the watchdog takes it for hung.
        """

    def close(self) -> None:
        """Finish, once, also after a failure."""


@runtime_checkable
class SupportsRewind(Protocol):
    """The method that a sink has if it keeps ticks, for a run that goes back; see ``run_control``."""

    def rewind(self, tick: int) -> None:
        """Forget, or set apart, ``tick`` and all after it: they come again, and may be others. The
        graph's memory is already that before ``tick``."""


@runtime_checkable
class SupportsResume(Protocol):
    """The method that a sink has if it measures time, for a run that is paused."""

    def resume(self, tick: int) -> None:
        """Continue with ``tick``, after the run has stood still."""


@runtime_checkable
class SupportsMetrics(Protocol):
    """A sink that has a word in the result, as a block has: ``Block.metrics`` by ``name``."""

    name: str

    def metrics(self) -> Mapping[str, Metric]:
        """Measures of the run, with ``success`` and ``reason`` where it judges."""


class RunHash:
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

    def close(self) -> None:
        """Do nothing."""

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


class MemoryLog:
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

    def close(self) -> None:
        """Do nothing."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the recording, without the views of memory that only a run needs."""
        kept = {"_expected": None, "_chunks": [self.rows()], "_used": len(self.ticks)}
        return {**kept, "ticks": self.ticks, "notes": self.notes, "layout": self.layout}

    def rows(self) -> NDArray[np.uint8]:
        """All recorded ticks, (ticks, bytes)."""
        full = self._chunks[:-1]
        last = self._chunks[-1][: self._used] if self._chunks else np.zeros((0, 0), np.uint8)
        return np.concatenate([*full, last]) if full else last
