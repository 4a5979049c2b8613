"""Divides a checked graph among its machines and finds the links that the division needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ..language.signals import Field
from ..language.stages import BlockSpec, CheckedGraph, MachineSpec
from .placed import Link, LinkField, PlacedGraph, PlacementError


def place(graph: CheckedGraph) -> PlacedGraph:
    """The placed graph of a graph that names its machines.

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
                Link(
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
    """The same graph on other machines.

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
