"""The rows of a recording, unpacked a stretch at a time."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contents import located, tables_at, unreadable
from .format import PACKED, ROWS, Header, RecordedField
from .messages import Content, Message, Scan
from .row_codec import unpack, unpack_bytes

MOST_THREADS = 4
"""Threads that unpack rows: most of the work is done outside of Python."""
Piece = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Ticks (n,) and rows (n, bytes)."""


class PackedRows:
    """The rows of a recording; in memory there is a batch at a time."""

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
