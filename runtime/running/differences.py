"""Compares two runs of one graph byte by byte: finds which field of which block differs first, and
by how many units in the last place (ULP)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.layout import Layout
from ..language.signals import Slot

Rows = NDArray[np.uint8]
_SIGN = np.int64(-(2**63))


@dataclass(frozen=True)
class Difference:
    """One element that differs.

    ``ulps`` is the distance of the two numbers in float64 steps: 1 for neighbours, 0 for -0.0 and
    0.0. It is ``None`` where one of them is NaN or the field holds no floats.
    """

    tick: int
    name: str
    """``block.port.field``."""
    element: tuple[int, ...]
    recorded: float | int | bool
    replayed: float | int | bool
    ulps: int | None
    part: str = "signal"
    """``signal``, or ``state`` where a block's declared state differs at a keyframe."""

    @property
    def place(self) -> str:
        """``block.port.field[i, j]``."""
        index = f"[{', '.join(map(str, self.element))}]" if self.element else ""
        return f"{self.name}{index}"

    @property
    def block(self) -> str:
        """The block's path."""
        return self.name.rpartition(".")[0].rpartition(".")[0]

    def __str__(self) -> str:
        distance = "" if self.ulps is None else f", {self.ulps} ULP apart"
        what = "the state " if self.part == "state" else ""
        return (
            f"tick {self.tick}: block '{self.block}': {what}{self.place} was {self.recorded!r}, "
            f"is {self.replayed!r}{distance}"
        )


@dataclass
class FieldDifference:
    """Difference of one field over all compared ticks."""

    first: Difference
    ticks: int = 0
    """Ticks in which any element differs."""
    elements: int = 0
    """Elements that differ, over all ticks."""
    largest: float = 0.0
    """Largest absolute difference of two finite numbers."""
    largest_tick: int = -1
    ulps: int = 0
    """Largest distance in ULP."""


@dataclass
class RowComparison:
    """Compares recorded and replayed rows of the bus, or of the state.

    Attributes:
        layout: how the rows are laid out in memory; it is the layout of the replayed graph.
        order: the paths of the blocks in their order of execution. Of two differences in one tick
            the one of the block that runs earlier is the first.
        names: the fields to compare; all fields by default.
        fields: the fields that differ, by name.
        compared: the number of rows compared so far.
    """

    layout: Layout
    order: Sequence[str]
    names: Sequence[str] | None = None
    part: str = "signal"
    fields: dict[str, FieldDifference] = field(default_factory=dict)
    compared: int = 0

    def __post_init__(self) -> None:
        names = self.layout.slots if self.names is None else self.names
        rank = {path: i for i, path in enumerate(self.order)}
        self._names = sorted(names, key=lambda name: rank.get(block_of(name), -1))

    def add(self, ticks: NDArray[np.int64], recorded: Rows, replayed: Rows) -> None:
        """Compare rows (n, bytes) of the given ticks (n,)."""
        self.compared += len(ticks)
        if self.names is None and np.array_equal(recorded, replayed):
            return
        for name in self._names:
            one, other = self.layout.view(recorded, name), self.layout.view(replayed, name)
            if one.tobytes() != other.tobytes():
                self._note(name, self.layout.slots[name], ticks, one, other)

    def _note(self, name: str, slot: Slot, ticks: NDArray[np.int64], one: Any, other: Any) -> None:
        flat, other_flat = one.reshape(len(ticks), -1), other.reshape(len(ticks), -1)
        differs = bits(flat) != bits(other_flat)
        rows = np.flatnonzero(differs.any(axis=1))
        row = int(rows[0])
        found = self.fields.get(name)
        if found is None:
            index = int(np.flatnonzero(differs[row])[0])
            element = np.unravel_index(index, slot.shape) if slot.shape else ()
            was, now = flat[row, index].item(), other_flat[row, index].item()
            first = Difference(
                int(ticks[row]), name, tuple(int(i) for i in element), was, now,
                ulp_distance(was, now) if isinstance(was, float) else None, self.part,
            )  # fmt: skip
            found = self.fields[name] = FieldDifference(first)
        found.ticks += len(rows)
        found.elements += int(differs.sum())
        with np.errstate(invalid="ignore", over="ignore"):
            sizes = np.abs(flat.astype(np.float64) - other_flat.astype(np.float64))
        sizes[~np.isfinite(sizes)] = 0.0
        largest = float(sizes.max())
        if largest > found.largest or found.largest_tick < 0:
            found.largest = largest
            found.largest_tick = int(ticks[int(sizes.max(axis=1).argmax())])
        if flat.dtype == np.float64:
            finite = np.isfinite(flat) & np.isfinite(other_flat)
            if finite.any():
                distances = ulp_distances(flat[finite], other_flat[finite])
                found.ulps = max(found.ulps, int(distances.max()))

    @property
    def first(self) -> Difference | None:
        """The first difference: in the earliest tick, and there in the block that runs first."""
        rank = {name: i for i, name in enumerate(self._names)}
        found = [each.first for each in self.fields.values()]
        return min(found, key=lambda d: (d.tick, rank[d.name])) if found else None

    @property
    def elements(self) -> int:
        """Elements that differ, over all fields and ticks."""
        return sum(each.elements for each in self.fields.values())

    def largest(self) -> list[tuple[str, FieldDifference]]:
        """Return the fields that differ, those with the largest difference first."""
        return sorted(self.fields.items(), key=lambda item: (-item[1].largest, item[0]))


def block_of(name: str) -> str:
    """Return the block's path in ``block.port.field``."""
    return name.rpartition(".")[0].rpartition(".")[0]


def bits(values: NDArray[Any]) -> NDArray[Any]:
    """Return the numbers' bit patterns, so that NaN equals itself and -0.0 differs from 0.0."""
    patterns = np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")
    return patterns.reshape(values.shape)  # ascontiguousarray makes an array of a scalar


def ulp_distances(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Count the float64 values from each number to the other, neither being NaN."""
    first, second = _ranks(one), _ranks(other)
    low, high = np.minimum(first, second), np.maximum(first, second)
    # unsigned, because the distance of two large numbers of different sign overflows int64
    return high.view(np.uint64) - low.view(np.uint64)


def ulp_distance(one: float, other: float) -> int | None:
    """Count the float64 values from one number to the other; ``None`` if one is NaN."""
    if math.isnan(one) or math.isnan(other):
        return None
    return int(ulp_distances(np.array([one]), np.array([other]))[0])


def _ranks(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Integers in the order of the floats, neighbours one apart; -0.0 and 0.0 are both zero."""
    whole = np.ascontiguousarray(values, np.float64).view(np.int64)
    return np.where(whole < 0, _SIGN - whole, whole)


def common_names(one: Layout, other: Layout) -> tuple[list[str], list[str]]:
    """Return the fields that both layouts have with equal type and shape, and a text for each
    other."""
    same, notes = [], []
    for name, slot in one.slots.items():
        there = other.slots.get(name)
        if there is None:
            notes.append(f"{name} is in the recording only")
        elif (there.section, there.shape) != (slot.section, slot.shape):
            notes.append(f"{name} was {_type(slot)} and is {_type(there)}")
        else:
            same.append(name)
    notes += [f"{name} is new" for name in other.slots if name not in one.slots]
    return same, notes


def _type(slot: Slot) -> str:
    return f"{slot.section}[{', '.join(map(str, slot.shape))}]" if slot.shape else slot.section


class Translation:
    """Copies rows of one layout into those of another, field by field, where both have it."""

    def __init__(self, source: Layout, target: Layout) -> None:
        self.names, self.notes = common_names(source, target)
        self.identical = source == target
        self._pieces = [(source.byte_range(n), target.byte_range(n)) for n in self.names]
        self._size = target.size

    def rows(self, rows: Rows) -> Rows:
        """Return the rows (n, bytes) in the target's layout; zero where the source has no such
        field."""
        if self.identical:
            return rows
        out = np.zeros((len(rows), self._size), np.uint8)
        for (first, last), (start, end) in self._pieces:
            out[:, start:end] = rows[:, first:last]
        return out

    def write(self, row: Rows, out: Rows, names: Mapping[str, Any] | None = None) -> None:
        """Copy one row (bytes,) into another; only ``names``, where given."""
        for name, (source, target) in zip(self.names, self._pieces, strict=True):
            if names is None or name in names:
                out[target[0] : target[1]] = row[source[0] : source[1]]
