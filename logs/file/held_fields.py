"""Large fields of slow blocks, which a recording holds where the block ran and not in every tick.

A picture of a camera at 25 Hz in a graph of 500 Hz changes in every twentieth tick. The bus of such a graph is
split into the *base*, which is kept in every tick, and groups of *held* fields with one period and offset, of
which a row is kept in the ticks in which their blocks run. Between them the bus holds what it held. Both sides of
the ring, the writer and the reader split the bus in the same way, which follows from the header.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.layout import ALIGNMENT
from ...runtime.language.recording_cost import LEAST_BYTES
from ...runtime.language.schedule import runs_at
from ...runtime.language.signals import DTYPES
from .format import Header, RecordedField, RecordedLayout

Rows = NDArray[np.uint8]
Copy = tuple[int, int, int, int]
"""First byte and end in the bus, first byte and end in the part."""


@dataclass(frozen=True)
class FieldGroup:
    """Some fields of the bus in a layout of their own, and the ticks in which they may change.

    Attributes:
        layout: of the part's fields.
        copies: where their bytes are in the bus and in the part.
        period, offset: of the blocks that write them [ticks].
    """

    layout: RecordedLayout
    copies: tuple[Copy, ...]
    period: int = 1
    offset: int = 0

    def take(self, rows: Rows) -> Rows:
        """Return the part (n, bytes of the part) of rows (n, bytes) of the bus."""
        found = np.zeros((len(rows), self.layout.size), np.uint8)
        for begin, end, to, until in self.copies:
            found[:, to:until] = rows[:, begin:end]
        return found

    def put(self, part: Rows, rows: Rows) -> None:
        """Write the part (n, bytes of the part), or (bytes of the part,) for all, into rows of the bus."""
        for begin, end, to, until in self.copies:
            rows[..., begin:end] = part[..., to:until]

    def is_due(self, tick: int) -> bool:
        """Return whether the blocks of the part run in a tick."""
        return runs_at(tick, self.period, self.offset)


@dataclass(frozen=True)
class SplitBus:
    """The bus in two: the ``base`` of every tick, and the ``held`` groups, of which there may be none.

    Attributes:
        size: bytes of the whole bus.
    """

    size: int
    base: FieldGroup
    held: tuple[FieldGroup, ...]

    @cached_property
    def group_of(self) -> dict[str, int]:
        """The number of the held group of each field that is held, by its name."""
        return {f.name: k for k, part in enumerate(self.held) for f in part.layout.fields}

    def changed(self, ticks: NDArray[np.int64], rows: Rows, before: Rows | None) -> list[NDArray[np.intp]]:  # fmt: skip
        """Return for each held group the places in ``rows`` (n, bytes) that are kept: where its blocks ran or its
        bytes differ from those of the row before.

        Args:
            ticks: of the rows, (n,), in order.
            rows: of the bus.
            before: the row of the tick before the first; ``None`` where it is not known.
        """
        found = []
        for part in self.held:
            keep = ticks % part.period == part.offset % part.period
            keep[1:] |= np.diff(ticks) != 1
            for begin, end, _, _ in part.copies:
                keep[1:] |= (rows[1:, begin:end] != rows[:-1, begin:end]).any(axis=1)
                keep[0] |= before is None or not np.array_equal(
                    before[begin:end], rows[0, begin:end]
                )
            found.append(np.flatnonzero(keep))
        return found


def split_bus(header: Header) -> SplitBus:
    """Split the bus of a recording."""
    bus = header.bus
    times = {b.path: (b.period_ticks, b.offset_ticks % b.period_ticks) for b in header.blocks}
    groups: dict[tuple[int, int], list[RecordedField]] = {}
    base = []
    for field in bus.fields:
        period, offset = times.get(field.name.rsplit(".", 2)[0], (1, 0))
        large = field.size * DTYPES[field.dtype].itemsize >= LEAST_BYTES
        if period > 1 and large and not field.constant:
            groups.setdefault((period, offset), []).append(field)
        else:
            base.append(field)
    if not groups:
        whole = FieldGroup(bus, ((0, bus.size, 0, bus.size),))
        return SplitBus(bus.size, whole, ())
    held = tuple(_group(bus, fields, *when) for when, fields in groups.items())
    return SplitBus(bus.size, _group(bus, base), held)


def _group(
    bus: RecordedLayout, fields: Sequence[RecordedField], period: int = 1, offset: int = 0
) -> FieldGroup:
    """Lay some fields of the bus out one behind another, by type."""
    lengths = dict.fromkeys(bus.lengths, 0)
    placed = []
    for field in fields:
        placed.append(replace(field, start=lengths[field.dtype]))
        lengths[field.dtype] += field.size
    offsets, size = {}, 0
    for section, length in lengths.items():
        offsets[section] = size
        size += -(-length * DTYPES[section].itemsize // ALIGNMENT) * ALIGNMENT
    layout = RecordedLayout(tuple(placed), lengths, offsets, size)
    here, there = bus.layout(), layout.layout()
    copies: list[Copy] = []
    for field in fields:
        begin, end = here.byte_range(field.name)
        to, until = there.byte_range(field.name)
        if copies and copies[-1][1] == begin and copies[-1][3] == to:
            copies[-1] = (copies[-1][0], end, copies[-1][2], until)
        else:
            copies.append((begin, end, to, until))
    return FieldGroup(layout, tuple(copies), period, offset)
