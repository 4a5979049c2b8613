"""Lays what the parts of a run have recorded together to what one process would have recorded."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.layout import Layout
from ..placement.placed import PlacedGraph


class Whole:
    """Takes from each part's bytes what that part has computed.

    Args:
        placed: the graph.
        layout: the layout of the bus or of the state of the whole graph.
        parts: the layout of each part's bytes, by machine.

    Raises:
        ValueError: a field is of another type or shape in a part.
    """

    def __init__(self, placed: PlacedGraph, layout: Layout, parts: Mapping[str, Layout]) -> None:
        self._layout = layout
        self._copies: dict[str, list[tuple[int, int, int]]] = {}
        owners = {spec.path: spec.machine for spec in placed.graph.blocks}
        for name, slot in layout.slots.items():
            machine = owners[name.rpartition(".")[0].rpartition(".")[0]]
            part = parts[machine]
            if name not in part.slots:
                raise ValueError(f"{name} is not in the part of {machine}")
            other = part.slots[name]
            if (slot.section, slot.shape) != (other.section, other.shape):
                raise ValueError(f"{name} is of another type or shape on {machine}")
            first, last = layout.byte_range(name)
            start = part.byte_range(name)[0]
            copies = self._copies.setdefault(machine, [])
            if copies and copies[-1][1] == first and start - first == copies[-1][2] - copies[-1][0]:
                copies[-1] = (copies[-1][0], last, copies[-1][2])
            else:
                copies.append((first, last, start))

    def rows(self, parts: Mapping[str, NDArray[np.uint8]]) -> NDArray[np.uint8]:
        """The rows (n, bytes) of the whole from those of each part, (n, bytes of that part)."""
        count = len(next(iter(parts.values())))
        rows = np.zeros((count, self._layout.size), np.uint8)
        for machine, copies in self._copies.items():
            for first, last, start in copies:
                rows[:, first:last] = parts[machine][:, start : start + last - first]
        return rows


def hash_of(rows: NDArray[Any]) -> str:
    """The run hash of rows (ticks, bytes), as ``sinks.RunHash`` has it."""
    return blake2b(np.ascontiguousarray(rows).data, digest_size=16).hexdigest()
