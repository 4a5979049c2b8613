"""A placed graph: a checked graph divided among machines, with the links that join the parts.

``split_over_machines`` finds the links that the division needs; ``command_sources`` are the blocks whose commands reach actuators.
The rest shows a placed graph as rows of a table and as JSON.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import Any

from ..language.block import Block
from ..language.errors import AloftError
from ..language.signals import DTYPES, Field
from ..language.stages import WATCHDOG, BlockSpec, CheckedGraph, MachineSpec


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
class MachineLink:
    """Message that one block sends to one other machine whenever it has run.

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
    links: tuple[MachineLink, ...]

    @property
    def machines(self) -> tuple[MachineSpec, ...]:
        """All machines, in the order of the graph; each knows its own blocks, maybe none."""
        return self.graph.machines

    def machine(self, name: str) -> MachineSpec:
        """Return the machine called ``name``.

        Raises:
            PlacementError: there is none; the error names those there are.
        """
        for machine in self.machines:
            if machine.name == name:
                return machine
        known = ", ".join(machine.name for machine in self.machines)
        raise PlacementError(f"the graph {self.graph.name} has no machine {name!r}; it has {known}")

    def blocks_on(self, machine: str) -> tuple[BlockSpec, ...]:
        """Return the blocks that a machine runs, in file order."""
        return tuple(spec for spec in self.graph.blocks if spec.machine == machine)

    def sent_by(self, machine: str) -> tuple[MachineLink, ...]:
        """Return the links on which a machine sends."""
        return tuple(link for link in self.links if link.sender == machine)

    def received_by(self, machine: str) -> tuple[MachineLink, ...]:
        """Return the links on which a machine receives."""
        return tuple(link for link in self.links if link.receiver == machine)


def split_over_machines(graph: CheckedGraph) -> PlacedGraph:
    """Place a graph that names its machines.

    Raises:
        PlacementError: the graph names no machines.
    """
    if not graph.machines:
        raise PlacementError(
            f"the graph {graph.name} names no machines; give it, or a file that includes it, "
            "machines: {onboard: tcp/127.0.0.1:7450, ...} and place: {BLOCK: onboard, ...}"
        )
    specs = {spec.path: spec for spec in graph.blocks}
    read: dict[tuple[str, str], dict[str, None]] = {}
    readers: dict[tuple[str, str], list[str]] = {}
    for spec in graph.blocks:
        for name, wire in spec.wires.items():
            source = specs[wire.source_block]
            if source.machine == spec.machine:
                continue
            key = (source.path, spec.machine)
            names = [f"{wire.source}.{n}" for n in spec.block_type.inputs[name].signal.fields]
            read.setdefault(key, {}).update(dict.fromkeys(names))
            readers.setdefault(key, []).append(f"{spec.path}.{name}")
    links = []
    for source in graph.blocks:
        for machine in graph.machines:
            key = (source.path, machine.name)
            if key not in read:
                continue
            links.append(
                MachineLink(
                    source.path,
                    source.machine,
                    machine.name,
                    tuple(field for field in _fields(source) if field.name in read[key]),
                    tuple(readers[key]),
                    graph.base_rate / source.period_ticks,
                )
            )
    return PlacedGraph(graph, tuple(links))


def spread(
    graph: CheckedGraph, machines: Mapping[str, str], places: Mapping[str, str]
) -> CheckedGraph:
    """Place the same graph on other machines.

    Args:
        graph: the graph; its own machines are forgotten.
        machines: the endpoint of each machine, by name.
        places: the machine of each block, by path; a block that is not named runs on the first.

    Raises:
        PlacementError: a block is placed on a machine that is not there, or is not there itself.
    """
    paths = [spec.path for spec in graph.blocks]
    for path, machine in places.items():
        if path not in paths or machine not in machines:
            raise PlacementError(f"{path} on {machine}: there is no such block or machine")
    first = next(iter(machines))
    return replace(
        graph,
        machines=tuple(MachineSpec(name, endpoint) for name, endpoint in machines.items()),
        blocks=tuple(replace(spec, machine=places.get(spec.path, first)) for spec in graph.blocks),
    )


def _fields(spec: BlockSpec) -> list[LinkField]:
    """All fields of a block's outputs, in the order of declaration."""
    return [
        _field(f"{spec.path}.{port}.{name}", field, spec)
        for port, output in spec.block_type.outputs.items()
        for name, field in output.signal.fields.items()
    ]


def _field(name: str, field: Field, spec: BlockSpec) -> LinkField:
    return LinkField(
        name,
        field.dtype_name,
        field.resolve(spec.dimensions),
        "" if field.unit is None else str(field.unit),
        field.frame or "",
    )


def moves_actuators(spec: BlockSpec) -> bool:
    """Return whether a block has something to do to come to rest."""
    return spec.block_type.stop_cycle is not Block.stop_cycle


def silence_limit(graph: CheckedGraph, machine: str) -> float | None:
    """Return the longest silence allowed to the links that bring commands to a machine [s];
    ``None`` where they are not watched, because all actuators are simulated and the graph gives no
    time."""
    moving = [s for s in graph.blocks if s.machine == machine and moves_actuators(s)]
    if not moving:
        return None
    if graph.links.watchdog is not None:
        return graph.links.watchdog
    return WATCHDOG if any(spec.block_type.outside == "real" for spec in moving) else None


def command_sources(graph: CheckedGraph, machine: str) -> tuple[str, ...]:
    """Return the blocks of other machines on whose outputs the actuators of a machine depend,
    through whatever blocks of that machine, in the order in which they are found; without those
    whose links are not to be watched."""
    specs = {spec.path: spec for spec in graph.blocks}
    pending = [s for s in graph.blocks if s.machine == machine and moves_actuators(s)]
    seen = dict.fromkeys(spec.path for spec in pending)
    sources: dict[str, None] = {}
    while pending:
        for wire in pending.pop().wires.values():
            source = specs[wire.source_block]
            if source.machine != machine:
                if graph.links.policy_of(source.path).watch:
                    sources[source.path] = None
            elif source.path not in seen:
                seen[source.path] = None
                pending.append(source)
    return tuple(sources)


def machine_rows(placed: PlacedGraph) -> list[tuple[str, str, str, str, str]]:
    """Return for each machine: name, endpoint, its blocks, and the bytes a second it sends and
    receives."""
    return [
        (
            machine.name,
            machine.endpoint,
            ", ".join(spec.path for spec in placed.blocks_on(machine.name)) or "nothing",
            _load(placed.sent_by(machine.name)),
            _load(placed.received_by(machine.name)),
        )
        for machine in placed.machines
    ]


def link_rows(placed: PlacedGraph) -> list[tuple[str, str, str, str, str]]:
    """Return for each link: source, way, rate, payload and the inputs that read it."""
    return [
        (
            link.source,
            f"{link.sender} -> {link.receiver}",
            f"{link.rate_hz:g} Hz",
            f"{link.payload} B",
            ", ".join(link.readers),
        )
        for link in placed.links
    ]


def placement_json(placed: PlacedGraph) -> dict[str, Any]:
    """Return the placement as plain data."""
    return {
        "machines": [
            {
                "name": machine.name,
                "endpoint": machine.endpoint,
                "blocks": [spec.path for spec in placed.blocks_on(machine.name)],
            }
            for machine in placed.machines
        ],
        "links": [
            {
                "source": link.source,
                "sender": link.sender,
                "receiver": link.receiver,
                "rate_hz": link.rate_hz,
                "payload_bytes": link.payload,
                "fields": [field.describe() for field in link.fields],
                "readers": list(link.readers),
            }
            for link in placed.links
        ],
    }


def _load(links: tuple[MachineLink, ...]) -> str:
    """Links in total, as ``3 links, 240 kB/s``."""
    if not links:
        return "nothing"
    rate = sum(link.payload * link.rate_hz for link in links) * 1e-3
    return f"{len(links)} link{'s' if len(links) > 1 else ''}, {rate:.3g} kB/s"
