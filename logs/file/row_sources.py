"""The rows of a recording, read a stretch at a time: as they are packed, or from old recordings."""

from __future__ import annotations

import math
import os
from bisect import bisect_left
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .changed_rows import filled
from .contents import located, tables, tables_at, unreadable
from .format import EXACT, PACKED, RECORDED, ROWS, SIGNALS, SPAN, Header, RecordedField, entity_of
from .messages import Content, Message, Scan
from .row_codec import unpack, unpack_bytes
from .tail import read_tail

MOST_THREADS = 4
"""Threads that unpack rows: most of the work is done outside of Python."""
Piece = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Ticks (n,) and rows (n, bytes)."""


class RowSource(Protocol):
    """Where the rows of a recording come from."""

    @property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks in order, (ticks,)."""

    def pieces(self, first: int, last: int) -> Iterator[Piece]:
        """The ticks from ``first`` up to, without, ``last``, and their rows, some at a time."""

    def rows(self) -> NDArray[np.uint8]:
        """The rows of all ticks, (ticks, bytes)."""

    def signal(self, field: RecordedField) -> NDArray[Any]:
        """One field at every tick, (ticks, ...)."""


class PackedRows:
    """The rows of a recording of format 3 or 4; in memory there is a batch at a time."""

    def __init__(self, found: Scan, header: Header) -> None:
        self._found, self._header = found, header
        messages = found.of(Content.ROWS) if found.sealed else list(self._without_seals())
        self._messages = sorted(messages, key=lambda message: message.first)
        self._lasts = [message.last for message in self._messages]

    def _without_seals(self) -> Iterator[Message]:
        """The messages that hold rows, in a file that another program has written again."""
        for message, name, batch in located(self._found, Content.ROWS):
            if name == f"/{ROWS}":
                first, rows = self._unpacked(message, batch)
                yield Message(
                    message.place, message.size, message.kind, Content.ROWS,
                    first=first, last=first + len(rows) - 1,
                )  # fmt: skip

    def _unpacked(
        self, message: Message, batch: Any, part: tuple[int, int] | None = None
    ) -> tuple[int, NDArray[np.uint8]]:
        """First tick and rows (n, bytes) of a message, or of each row the bytes ``part`` only."""
        try:
            packed = batch[f"aloft:{PACKED}"][0].values.to_numpy().tobytes()
            first, rows = unpack(packed) if part is None else unpack_bytes(packed, *part)
            if part is None and rows.shape[1] != self._header.bus.size:
                raise ValueError("these rows belong to another layout")
        except (ValueError, KeyError) as error:
            raise unreadable(self._found, message, error) from error
        return first, rows

    @cached_property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks in order, (ticks,)."""
        found = [np.arange(m.first, m.last + 1, dtype=np.int64) for m in self._messages]
        return np.unique(np.concatenate([np.zeros(0, np.int64), *found]))

    def pieces(self, first: int, last: int) -> Iterator[Piece]:
        """The ticks from ``first`` up to, without, ``last``, and their rows, some at a time."""
        begin = bisect_left(self._lasts, first)
        for message in self._messages[begin:]:
            if message.first >= last:
                return
            _, batch = tables_at(self._found, message)
            start, rows = self._unpacked(message, batch)
            ticks = np.arange(start, start + len(rows), dtype=np.int64)
            low, high = bisect_left(ticks, first), bisect_left(ticks, last)
            yield ticks[low:high], rows[low:high]

    def rows(self) -> NDArray[np.uint8]:
        """The rows of all ticks, (ticks, bytes), unpacked by several threads."""
        return self._all()

    def signal(self, field: RecordedField) -> NDArray[Any]:
        """One field at every tick, (ticks, ...), unpacked by several threads."""
        found = self._all(self._header.bus.layout().byte_range(field.name))
        return found.view(field.dtype).reshape(len(found), *field.shape)

    def _all(self, part: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """The rows of all ticks, (ticks, bytes), or of each row the bytes ``part`` only."""
        ticks = self.ticks
        size = self._header.bus.size if part is None else part[1] - part[0]
        rows = np.empty((len(ticks), size), np.uint8)

        def unpack_one(message: Message) -> None:
            _, batch = tables_at(self._found, message)
            first, some = self._unpacked(message, batch, part)
            place = bisect_left(ticks, first)
            rows[place : place + len(some)] = some

        with ThreadPoolExecutor(min(MOST_THREADS, os.cpu_count() or 1)) as pool:
            for _ in pool.map(unpack_one, self._messages):
                pass
        return rows


class SeriesRows:
    """The rows of a recording of format 2, put together from one series a signal."""

    def __init__(self, found: Scan, header: Header, *, whole: bool) -> None:
        self._found, self._header, self._whole = found, header, whole
        self._signals = [field for field in header.bus.fields if not field.constant]

    @cached_property
    def _written(self) -> NDArray[np.int64]:
        """The ticks in the file itself."""
        found = [np.zeros(0, np.int64)]
        for _, batch in tables(self._found, Content.UNKNOWN, f"/{RECORDED}"):
            for first, last in batch[f"aloft:{SPAN}"].to_pylist():
                found.append(np.arange(first, last + 1))
        return np.unique(np.concatenate(found))

    @cached_property
    def _tail(self) -> Piece:
        size, written = self._header.bus.size, self._written
        if self._whole:  # a tail that is there is another run's
            return np.zeros(0, np.int64), np.zeros((0, size), np.uint8)
        last = int(written[-1]) if len(written) else self._header.first_tick
        return read_tail(self._found.path, size, last)

    @cached_property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks in order, (ticks,)."""
        return np.unique(np.concatenate([self._written, self._tail[0]]))

    @cached_property
    def _rows(self) -> NDArray[np.uint8]:
        by_entity: dict[str, list[Any]] = {}
        for entity, batch in tables(self._found, Content.UNKNOWN, f"/{SIGNALS}/**"):
            by_entity.setdefault(entity, []).append(batch)
        layout = self._header.bus.layout()
        rows = np.tile(np.frombuffer(self._header.bus_start, np.uint8), (len(self.ticks), 1))
        for field in self._signals:
            batches = by_entity.pop(f"/{entity_of(SIGNALS, field.name)}", [])
            first, last = layout.byte_range(field.name)
            flat = self._filled(field, batches).reshape(len(rows), math.prod(field.shape))
            rows[:, first:last] = np.ascontiguousarray(flat).view(np.uint8)
        return rows

    def rows(self) -> NDArray[np.uint8]:
        """The rows of all ticks, (ticks, bytes)."""
        return self._rows

    def pieces(self, first: int, last: int) -> Iterator[Piece]:
        """The ticks from ``first`` up to, without, ``last``, and their rows, at once."""
        low, high = bisect_left(self.ticks, first), bisect_left(self.ticks, last)
        yield self.ticks[low:high], self._rows[low:high]

    def signal(self, field: RecordedField) -> NDArray[Any]:
        """One field at every tick, (ticks, ...)."""
        if "_rows" in self.__dict__:
            return self._header.bus.layout().view(self._rows, field.name)
        entity = f"/{entity_of(SIGNALS, field.name)}"
        batches = [batch for _, batch in tables(self._found, Content.UNKNOWN, entity)]
        return self._filled(field, batches)

    def _filled(self, field: RecordedField, batches: list[Any]) -> NDArray[Any]:
        """The value at each of ``ticks``, also at those where an unchanged value was left out."""
        if not len(self.ticks):
            return np.zeros((0, *field.shape), field.dtype)
        tail_ticks, tail = self._tail
        ticks = [tail_ticks]
        parts = [self._header.bus.layout().view(tail, field.name)]
        for batch in batches:
            name = f"aloft:{EXACT}" if field.dtype == "int64" else "Scalars:scalars"
            ticks.append(batch["tick"].cast("int64").to_numpy())
            values = batch[name].flatten().to_numpy().astype(field.dtype, copy=False)
            parts.append(values.reshape(len(ticks[-1]), *field.shape))
        return filled(self.ticks, np.concatenate(ticks), np.concatenate(parts))
