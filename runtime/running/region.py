"""Regions of a graph's memory: one aligned buffer each, in which every field of a layout has its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.errors import RunError
from ..language.layout import ALIGNMENT, LARGEST, Layout
from ..language.signals import DTYPES, Signal


class Region:
    """One aligned buffer for a layout, with a flat array for each section; at first it is zero, and
    quaternions are the identity."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        raw = np.zeros(layout.size + ALIGNMENT, np.uint8)
        start = -raw.ctypes.data % ALIGNMENT
        self.buffer: NDArray[np.uint8] = raw[start : start + layout.size]
        self.sections: Mapping[str, NDArray[Any]] = {
            name: self.buffer[first : first + layout.lengths[name] * dtype.itemsize].view(dtype)
            for name, dtype in DTYPES.items()
            for first in (layout.offsets[name],)
        }
        for name in layout.quaternions:
            self.field(name)[..., 3] = 1.0

    def field(self, name: str, *, writable: bool = True) -> NDArray[Any]:
        """Return the view of the slot ``block.port.field``. Raises ``KeyError``."""
        slot = self.layout.slots[name]
        flat = self.sections[slot.section][slot.start : slot.start + slot.size]
        view = flat.reshape(slot.shape)
        view.flags.writeable = writable
        return view

    def signal(
        self, signal: type[Signal], port: str, *, writable: bool = True, source: str = ""
    ) -> Signal:
        """Bind the fields of ``signal`` to the slots of ``source`` (by default of ``port``)."""
        start = source or port
        return signal.bind(
            {name: self.field(f"{start}.{name}", writable=writable) for name in signal.fields}
        )


def allocate(layout: Layout, what: str) -> Region:
    """Allocate the memory of a layout. Raises ``RunError`` if it needs more than a graph may
    have."""
    try:
        if layout.size <= LARGEST:
            return Region(layout)
    except MemoryError:
        pass
    name = max(layout.slots, key=lambda name: layout.slots[name].size)
    raise RunError(
        f"the {what} of the graph need {layout.size / 1e9:.3g} GB of memory; the largest is {name} "
        f"of shape {list(layout.slots[name].shape)}",
        block=name.rpartition(".")[0].rpartition(".")[0],
    )
