"""Computes where every field of every signal lies in one buffer; it allocates no memory itself.

A buffer has three sections, ``float64``, ``int64`` and ``bool``. Each starts at a multiple of 64
bytes and is packed inside. The floats lie together so that one call checks that all are finite.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import DeclarationError
from .signals import DTYPES, Signal, Slot

LARGEST = 1_000_000_000
"""Largest size of the signals and states of a graph [bytes]; a robot's usually need some 10 kB."""
ALIGNMENT = 64
"""Bytes: the size of a cache line, and the alignment of the widest vector instructions."""


@dataclass(frozen=True)
class PortLayout:
    """A port that needs memory: its full name ``block.port``, its signal, its dimensions, and the fields of
    general vectors that carry quaternions."""

    name: str
    signal: type[Signal]
    dimensions: Mapping[str, int]
    quaternions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """The slots of a buffer by ``block.port.field``, and its sections."""

    slots: Mapping[str, Slot]
    lengths: Mapping[str, int]
    """The number of elements of each section."""
    offsets: Mapping[str, int]
    """The byte at which each section starts, from the start of the buffer."""
    size: int
    """The size of the whole buffer in bytes, a multiple of 64."""
    quaternions: tuple[str, ...] = ()
    """The slots of quaternions, which are the identity before their first value."""

    @classmethod
    def of(cls, ports: Sequence[PortLayout]) -> Layout:
        """Lay out all fields of ``ports``, in their order, section by section.

        Raises:
            DeclarationError: a field's dimension has no size, or two ports have one name.
        """
        slots: dict[str, Slot] = {}
        lengths = dict.fromkeys(DTYPES, 0)
        for port in ports:
            for name, field in port.signal.fields.items():
                full_name = f"{port.name}.{name}"
                if full_name in slots:
                    raise DeclarationError(f"{full_name} is laid out twice")
                try:
                    shape = field.resolve(port.dimensions)
                except KeyError as missing:
                    raise DeclarationError(
                        f"{full_name} ({field.describe()}): dimension {missing} has no size; "
                        f"known are {', '.join(sorted(port.dimensions)) or 'none'}. Give it under "
                        "'dimensions', through a robot, or as an integer parameter of the block"
                    ) from None
                slot = Slot(field.dtype_name, lengths[field.dtype_name], shape)
                slots[full_name] = slot
                lengths[field.dtype_name] += slot.size
        offsets: dict[str, int] = {}
        quaternions = [
            f"{port.name}.{name}"
            for port in ports
            for name, field in port.signal.fields.items()
            if field.quaternion or name in port.quaternions
        ]
        size = 0
        for section, length in lengths.items():
            offsets[section] = size
            size += -(-length * DTYPES[section].itemsize // ALIGNMENT) * ALIGNMENT
        return cls(slots, lengths, offsets, size, tuple(quaternions))

    def locate(self, section: str, index: int) -> str:
        """Return the name of one element of a section, ``block.port.field[index]``.

        Raises:
            IndexError: the section has no such element.
        """
        names = [name for name, slot in self.slots.items() if slot.section == section]
        if not 0 <= index < self.lengths[section]:
            raise IndexError(f"section {section} has {self.lengths[section]} elements, not {index}")
        starts = [self.slots[name].start for name in names]
        name = names[bisect_right(starts, index) - 1]
        slot = self.slots[name]
        place = np.unravel_index(index - slot.start, slot.shape) if slot.shape else ()
        return name + (f"[{', '.join(str(int(i)) for i in place)}]" if slot.shape else "")

    def byte_range(self, name: str) -> tuple[int, int]:
        """Return the first byte of a slot and the byte after its last. Raises ``KeyError``."""
        slot = self.slots[name]
        item = DTYPES[slot.section].itemsize
        start = self.offsets[slot.section] + slot.start * item
        return start, start + slot.size * item

    def view(self, rows: np.ndarray[Any, Any], name: str) -> np.ndarray[Any, Any]:
        """One slot of a buffer, or of many recorded ones.

        Args:
            rows: uint8 of shape (size,) or (n, size).
            name: ``block.port.field``.

        Returns:
            The field, of shape (...) or (n, ...): a view of ``rows`` where that is possible.
        """
        slot = self.slots[name]
        first, last = self.byte_range(name)
        part = rows[..., first:last]
        if not part.flags.c_contiguous:
            part = np.ascontiguousarray(part)
        return part.view(DTYPES[slot.section]).reshape((*rows.shape[:-1], *slot.shape))


def only_field(port: str, signals: Iterable[str]) -> str | None:
    """Return the field of a port, where it has only one; wires are written so, too."""
    fields = [name for name in signals if name.rpartition(".")[0] == port]
    return fields[0] if len(fields) == 1 else None
