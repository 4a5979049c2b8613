"""A placed graph: a checked graph divided among machines, with the links that join the parts."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

from ..language.errors import AloftError
from ..language.signals import DTYPES
from ..language.stages import BlockSpec, CheckedGraph, MachineSpec


class PlacementError(AloftError):
    """A graph cannot be spread as it was asked for."""


@dataclass(frozen=True)
class LinkField:
    """One field that travels, as ``block.port.field``, with its type."""

    name: str
    dtype: str
    shape: tuple[int, ...]
    unit: str
    frame: str

    @property
    def size(self) -> int:
        """The number of bytes."""
        return prod(self.shape) * DTYPES[self.dtype].itemsize

    def describe(self) -> str:
        """Name and type in one line."""
        shape = f"[{', '.join(map(str, self.shape))}]" if self.shape else ""
        unit = f" {self.unit}" if self.unit else ""
        frame = f" in {self.frame}" if self.frame else ""
        return f"{self.name}: {self.dtype}{shape}{unit}{frame}"


@dataclass(frozen=True)
class Link:
    """What one block sends to one other machine whenever it has run: one message.

    ``fields`` holds only the fields that some block over there reads, in the order of the source's
    declaration. ``readers`` are the inputs that read them, as ``block.input``.
    """

    source: str
    sender: str
    receiver: str
    fields: tuple[LinkField, ...]
    readers: tuple[str, ...]
    rate_hz: float

    @property
    def name(self) -> str:
        """The name by which messages and errors call the link."""
        return f"{self.source}@{self.sender} -> {self.receiver}"

    @property
    def payload(self) -> int:
        """The bytes of all fields, without the header of the message."""
        return sum(field.size for field in self.fields)


@dataclass(frozen=True)
class PlacedGraph:
    """A graph and its links. The machines and the place of every block are in ``graph``."""

    graph: CheckedGraph
    links: tuple[Link, ...]

    @property
    def machines(self) -> tuple[MachineSpec, ...]:
        """All machines, in the order of the graph; each knows its own blocks, maybe none."""
        return self.graph.machines

    def machine(self, name: str) -> MachineSpec:
        """The machine of that name.

        Raises:
            PlacementError: there is none; the error names those there are.
        """
        for machine in self.machines:
            if machine.name == name:
                return machine
        known = ", ".join(machine.name for machine in self.machines)
        raise PlacementError(f"the graph {self.graph.name} has no machine {name!r}; it has {known}")

    def blocks_on(self, machine: str) -> tuple[BlockSpec, ...]:
        """The blocks that a machine runs, in file order."""
        return tuple(spec for spec in self.graph.blocks if spec.machine == machine)

    def sent_by(self, machine: str) -> tuple[Link, ...]:
        """The links on which a machine sends."""
        return tuple(link for link in self.links if link.sender == machine)

    def received_by(self, machine: str) -> tuple[Link, ...]:
        """The links on which a machine receives."""
        return tuple(link for link in self.links if link.receiver == machine)
