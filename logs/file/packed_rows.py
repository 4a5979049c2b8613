"""The rows of a recording, unpacked piece by piece: the base of every tick, and what slow blocks held."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .format import Header, RecordedField
from .held_fields import FieldGroup, split_bus
from .records import Content, Record, RecordingError, Scan
from .row_codec import unpack, unpack_bytes

MOST_THREADS = 4
"""Threads that unpack rows: most of the work is done outside of Python."""
MOST_KEPT = 2 << 30
"""The bytes of all rows, at most, that are kept in memory."""
LIKELY_RATIO = 200
"""Bytes of rows that a recording's byte stands for, at most, where it is a large one; of the shipped graphs
it is three."""
MOST_TICKS = 1 << 16
"""Ticks that are packed together, at most; a writer of aloft packs 512."""
AT_ONCE = 1 << 26
"""Bytes of rows that are given at a time, but that one row may have more."""
TickRows = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Ticks (n,) and rows (n, bytes)."""


class PackedGroup:
    """The packed rows of one part of the bus: of its base, or of a held group, whose number is ``held``."""

    def __init__(self, found: Scan, part: FieldGroup, held: int | None = None) -> None:
        self._found, self._part = found, part
        if held is None:
            pieces = found.of(Content.ROWS)
        else:
            pieces = [piece for piece in found.of(Content.HELD) if piece.group == held]
        self._pieces = sorted(pieces, key=lambda piece: piece.first)
        self._lasts = [piece.last for piece in self._pieces]
        self._known: tuple[Record, NDArray[np.uint8]] | None = None

    def ticks_of(self, piece: Record) -> NDArray[np.int64]:
        """Return the ticks of a piece, (n,)."""
        return np.arange(piece.first, piece.last + 1, self._part.period, dtype=np.int64)

    def unpack(self, piece: Record, part: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """Unpack the rows (n, bytes) of a piece, or of each row the bytes ``part`` only."""
        found = self._found
        packed = found.payload(piece)
        try:
            first, rows = unpack(packed) if part is None else unpack_bytes(packed, *part)
            last = first + (len(rows) - 1) * self._part.period
            if (first, last) != (piece.first, piece.last):
                raise ValueError("these rows are not of the ticks that their record names")
            if part is None and rows.shape[1] != self._part.layout.size:
                raise ValueError("these rows belong to another layout")
        except ValueError as error:
            raise found.unreadable(piece, error) from error
        return rows

    @cached_property
    def ticks(self) -> NDArray[np.int64]:
        """The ticks of the rows in order, (ticks,)."""
        period = self._part.period
        count = sum((piece.last - piece.first) // period + 1 for piece in self._pieces)
        if any(piece.last < piece.first for piece in self._pieces) or count > MOST_TICKS * len(
            self._pieces
        ):
            raise RecordingError(
                f"{self._found.path} says that {len(self._pieces)} records hold {count} ticks; the "
                f"expected number is {MOST_TICKS} in each at most"
            )
        found = [self.ticks_of(piece) for piece in self._pieces]
        ticks = np.concatenate([np.zeros(0, np.int64), *found])
        in_order = bool((ticks[1:] > ticks[:-1]).all())
        return ticks if in_order else np.unique(ticks)

    def between(self, first: int, last: int) -> Iterator[Record]:
        """Yield the pieces with ticks from ``first`` up to, without, ``last``."""
        for piece in self._pieces[bisect_left(self._lasts, first) :]:
            if piece.first >= last:
                return
            yield piece

    def at(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Put what was held at ``ticks`` (n,), in order, into rows (n, bytes) of the bus."""
        places = np.searchsorted(self.ticks, ticks, side="right") - 1
        for place in np.unique(places).tolist():
            begin, end = np.searchsorted(places, (place, place + 1)).tolist()
            if place >= 0:
                self._part.put(self.row(int(self.ticks[place])), rows[begin:end])

    def row(self, tick: int) -> NDArray[np.uint8]:
        """Return the row (bytes of the part,) of a tick that has one; the piece it is in is kept."""
        piece = self._pieces[bisect_left(self._lasts, tick)]
        if self._known is None or self._known[0] is not piece:
            self._known = piece, self.unpack(piece)
        row: NDArray[np.uint8] = self._known[1][(tick - piece.first) // self._part.period]
        return row

    def all(self, part: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """Unpack the rows of all ticks, (ticks, bytes), or of each row the bytes ``part`` only, in several
        threads."""
        ticks = self.ticks
        size = self._part.layout.size if part is None else part[1] - part[0]
        expect_room(self._found, len(ticks) * size)
        rows = np.empty((len(ticks), size), np.uint8)

        def unpack_one(piece: Record) -> None:
            rows[np.searchsorted(ticks, self.ticks_of(piece))] = self.unpack(piece, part)

        with ThreadPoolExecutor(min(MOST_THREADS, os.cpu_count() or 1)) as pool:
            for _ in pool.map(unpack_one, self._pieces):
                pass
        return rows


def expect_room(found: Scan, size: int) -> None:
    """Raise ``RecordingError`` for more bytes than a recording of this size is unpacked to at once."""
    if size > max(MOST_KEPT, LIKELY_RATIO * found.size):
        raise RecordingError(
            f"{found.path} has {found.size} bytes and would unpack to {size}, more than is unpacked at once; "
            "read it with pieces(), window() or samples()"
        )


class PackedRows:
    """The rows of a recording; in memory there is a batch at a time."""

    def __init__(self, found: Scan, header: Header) -> None:
        self._found, self._header = found, header
        self._bus = split_bus(header)
        self._base = PackedGroup(found, self._bus.base)

    @cached_property
    def _held(self) -> list[PackedGroup]:
        return [PackedGroup(self._found, part, k) for k, part in enumerate(self._bus.held)]

    @cached_property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks in order, (ticks,), of which everything is there."""
        ticks = self._base.ticks
        known = np.ones(len(ticks), np.bool_)
        for part, packed in zip(self._bus.held, self._held, strict=True):
            # a tick is whole if the row is there that its blocks, or the end of a gap, made necessary last
            needed = ticks % part.period == part.offset
            needed[:1] = True
            needed[1:] |= np.diff(ticks) != 1
            since = np.maximum.accumulate(np.where(needed, np.arange(len(ticks)), 0))
            known &= np.isin(ticks, packed.ticks)[since] if len(ticks) else True
        return ticks[known]

    def pieces(self, first: int, last: int) -> Iterator[TickRows]:
        """Yield the ticks from ``first`` up to, without, ``last``, and their rows, some at a time."""
        most = max(1, AT_ONCE // max(1, self._bus.size))
        for piece in self._base.between(first, last):
            ticks, base = self._base.ticks_of(piece), self._base.unpack(piece)
            low, high = bisect_left(ticks, first), bisect_left(ticks, last)
            if not self._bus.held:
                yield ticks[low:high], base[low:high]
                continue
            for begin in range(low, high, most):
                end = min(begin + most, high)
                yield self._filled(ticks[begin:end], base[begin:end])

    def _filled(self, ticks: NDArray[np.int64], base: NDArray[np.uint8]) -> TickRows:
        """Return ticks and rows (n, bytes of the bus) of base rows, without ticks of which something is lost."""
        there = np.isin(ticks, self.ticks)
        ticks, base = ticks[there], base[there]
        rows = np.zeros((len(ticks), self._bus.size), np.uint8)
        self._bus.base.put(base, rows)
        for packed in self._held:
            packed.at(ticks, rows)
        return ticks, rows

    def rows(self) -> NDArray[np.uint8]:
        """Unpack the rows of all ticks, (ticks, bytes)."""
        if not self._bus.held:
            return self._base.all()
        expect_room(self._found, len(self.ticks) * self._bus.size)
        base = self._base.all()
        return self._filled(self._base.ticks, base)[1]

    def signal(self, field: RecordedField) -> NDArray[Any]:
        """Read one field at every tick, (ticks, ...)."""
        at, values = self.samples(field)
        if len(at) == len(self.ticks):
            return values
        expect_room(self._found, len(self.ticks) * values[:1].nbytes)
        found: NDArray[Any] = values[np.searchsorted(at, self.ticks, side="right") - 1]
        return found

    def samples(self, field: RecordedField) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Return the ticks (n,) at which a field is kept, and its values there, (n, ...)."""
        number = self._bus.group_of.get(field.name)
        packed = self._base if number is None else self._held[number]
        part = self._bus.base if number is None else self._bus.held[number]
        found = packed.all(part.layout.layout().byte_range(field.name))
        values = found.view(field.dtype).reshape(len(found), *field.shape)
        if number is not None:
            return packed.ticks, values
        there = np.isin(packed.ticks, self.ticks) if self._bus.held else slice(None)
        return packed.ticks[there], values[there]
