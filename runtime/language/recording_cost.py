"""The cost of recording a graph, from its declarations: bytes a minute before compression, and the ring.

As ``logs.file.held_fields`` has it, large fields of slow blocks count where their blocks run, all others
in every tick. What a file takes after compression depends on the signals; the shipped jumps take a third.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

from .signals import DTYPES

if TYPE_CHECKING:  # so that reading a recording needs nothing that loads a graph
    from .stages import CheckedGraph

LEAST_BYTES = 4096
"""Bytes of a field from which on a recording holds it between the runs of its block."""

MOST_A_MINUTE = 2e9
"""Bytes a minute before compression from which on the user is warned."""
MANY = 5
"""Fields that are listed, those that take the most."""


@dataclass(frozen=True)
class FieldCost:
    """A field ``block.port.field``: its ``size`` [bytes], and the bytes that it takes a minute."""

    name: str
    size: int
    bytes_per_minute: float


@dataclass(frozen=True)
class RecordingCost:
    """The bytes of a graph's recording, before compression.

    Attributes:
        bus_bytes: bytes of all signals.
        bytes_per_minute: of the rows, and of the bus in the keyframes, one a second.
        largest: the fields that take the most, the largest first.
    """

    bus_bytes: int
    bytes_per_minute: float
    largest: tuple[FieldCost, ...]

    @property
    def is_large(self) -> bool:
        """Return whether the user is to be warned."""
        return self.bytes_per_minute > MOST_A_MINUTE

    def __str__(self) -> str:
        fields = ", ".join(f"{f.name} {_size(f.bytes_per_minute)}" for f in self.largest)
        return (
            f"a minute of its recording takes {_size(self.bytes_per_minute)} before compression; "
            f"the most of it: {fields}"
        )


def recording_cost(graph: CheckedGraph) -> RecordingCost:
    """Compute what it costs to record a graph."""
    found, bus = [], 0
    for spec in graph.blocks:
        for port, output in spec.block_type.outputs.items():
            for name, field in output.signal.fields.items():
                size = prod(field.resolve(spec.dimensions)) * DTYPES[field.dtype_name].itemsize
                held = spec.period_ticks > 1 and size >= LEAST_BYTES
                rate = graph.base_rate / (spec.period_ticks if held else 1)
                found.append(FieldCost(f"{spec.path}.{port}.{name}", size, 60.0 * rate * size))
                bus += size
    found.sort(key=lambda cost: -cost.bytes_per_minute)
    whole = sum(cost.bytes_per_minute for cost in found) + 60.0 * bus
    return RecordingCost(bus, whole, tuple(found[:MANY]))


def large_recording(graph: CheckedGraph) -> str:
    """Return the warning of a recording that is large, with what to do; empty for any other."""
    cost = recording_cost(graph)
    if not cost.is_large:
        return ""
    return f"{cost}; record less often (a lower 'rate' of the block), or not at all (--no-record)"


def _size(count: float) -> str:
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count:.0f} bytes"
