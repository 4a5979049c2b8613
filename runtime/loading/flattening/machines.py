"""Reads which machines share a graph, and which of them each block is placed on.

A block is placed by its own ``on``, by the ``on`` of a sub-graph that it is in, or by the graph's
``place``, which names blocks and sub-graphs and wins over ``on``. So a file that includes a graph
and has ``machines`` and ``place`` spreads that graph without a change to it. A block that is placed
nowhere runs on the first machine.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ....files.nodes import Entry, MapNode, Node, ScalarNode, kind, text_of
from ....files.problems import Code, Problems, listing, nearest
from ...language.flat_graph import FlatBlock, FlatGraph
from ...language.signal_error import FOLDER
from ...language.stages import BlockSpec, CheckedGraph, MachineSpec
from .subgraphs import Instance

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*$")


def placed(
    blocks: Sequence[FlatBlock],
    places: MapNode | None,
    instances: Mapping[str, Instance],
    problems: Problems,
) -> tuple[FlatBlock, ...]:
    """Return the blocks with the machines that the graph's ``place`` gives them; the most special
    wins."""
    found: dict[str, Node] = {entry.key: entry.value for entry in places or ()}
    paths = [*(block.path for block in blocks), *instances]
    broken = any(instance.broken for instance in instances.values())
    for entry in places or ():
        if entry.key not in paths and not broken:
            similar = nearest(entry.key, paths)
            problems.add(
                Code.MACHINE,
                f"'place' names {entry.key!r}, which is no block of this graph",
                entry.key_where,
                at=entry.key,
                expected=listing(paths),
                found=entry.key,
                nearest=similar,
                fix=f"{similar[0]}: {text_of(_value(entry.value))}" if similar else "",
            )
    result = []
    for block in blocks:
        names = [block.path]
        while "/" in names[-1]:
            names.append(names[-1].rpartition("/")[0])
        given = next((found[name] for name in names if name in found), None)
        result.append(block if given is None else replace(block, machine=given))
    return tuple(result)


def read_machines(graph: FlatGraph, problems: Problems) -> tuple[MachineSpec, ...]:
    """Read the machines of a graph; also check that every block is placed on one of them."""
    if not graph.machines and all(block.machine is None for block in graph.blocks):
        return ()
    from ...transports.registry import EXAMPLE, transport_type  # most graphs run on one machine

    machines: list[MachineSpec] = []
    for entry in graph.machines or ():
        machine = _read_machine(entry, problems)
        same = next((m for m in machines if machine and m.endpoint == machine.endpoint), None)
        if same is not None:
            problems.add(
                Code.MACHINE,
                f"machines {same.name!r} and {entry.key!r} have one endpoint",
                entry.value.where,
                at=f"machines.{entry.key}",
                other=f"machines.{same.name}",
                other_where=same.where,
                expected="an address or a port of its own",
                found=same.endpoint,
            )
        elif machine is not None:
            machines.append(machine)
            if transport_type([machine]) is not transport_type(machines):
                problems.add(
                    Code.MACHINE,
                    f"machines {machines[0].name!r} and {machine.name!r} use different transports",
                    entry.value.where,
                    at=f"machines.{entry.key}",
                    other=f"machines.{machines[0].name}",
                    other_where=machines[0].where,
                    expected=f"an endpoint as that of {machines[0].name}, {machines[0].endpoint}",
                    found=machine.endpoint,
                )
    names = [entry.key for entry in graph.machines or ()]
    for block in graph.blocks:
        node = block.machine
        if node is None or (isinstance(node, ScalarNode) and node.value in names):
            continue
        shown = text_of(_value(node)) if isinstance(node, ScalarNode) else kind(node)
        similar = nearest(shown, names)
        problems.add(
            Code.MACHINE,
            f"{block.path} is placed on {shown}, which is no machine of this graph"
            if names
            else f"{block.path} is placed on {shown}, but the graph names no machines",
            node.where,
            at=f"{block.path}.on",
            expected=listing(names) if names else "a key 'machines' of the graph",
            found=shown,
            nearest=similar,
            fix=f"on: {(*similar, *names)[0]}" if names else f"machines: {{{shown}: {EXAMPLE}}}",
        )
    return tuple(machines)


def on_machines(
    checked: CheckedGraph, graph: FlatGraph, machines: tuple[MachineSpec, ...]
) -> CheckedGraph:
    """Return the checked graph with its machines and the place of every block.

    Delays and constants that loading inserted run where the block that reads them runs. So the
    value of a delayed wire has a whole period to travel.
    """
    if not machines:
        return checked
    named: Mapping[str, str] = {
        block.path: str(block.machine.value)
        for block in graph.blocks
        if isinstance(block.machine, ScalarNode)
    }

    specs = {spec.path: spec for spec in checked.blocks}

    def machine_of(spec: BlockSpec) -> str:
        if (
            spec.path.startswith(FOLDER) and "u" in spec.wires
        ):  # a fault is where its signal is written
            return machine_of(specs[spec.wires["u"].source_block])
        owner = spec.path if "~" not in spec.path else spec.path.rpartition("/")[0]
        return named.get(owner, machines[0].name)

    blocks = tuple(replace(spec, machine=machine_of(spec)) for spec in checked.blocks)
    return replace(checked, blocks=blocks, machines=machines)


def _value(node: Node) -> object:
    return node.value if isinstance(node, ScalarNode) else kind(node)


def _read_machine(entry: Entry, problems: Problems) -> MachineSpec | None:
    if not _NAME.match(entry.key):
        problems.add(
            Code.MACHINE,
            f"{entry.key!r} cannot name a machine",
            entry.key_where,
            at="machines",
            expected="a letter, then letters, digits and '_'",
            found=entry.key,
        )
        return None
    from ...transports.registry import EXAMPLE, endpoint_problem

    text = entry.value.value if isinstance(entry.value, ScalarNode) else None
    reason = endpoint_problem(text) if isinstance(text, str) else "it is no text"
    if reason:
        problems.add(
            Code.MACHINE,
            f"the endpoint of machine {entry.key!r} is wrong: {reason}",
            entry.value.where,
            at=f"machines.{entry.key}",
            expected=f"the address and port at which the other machines reach it, as {EXAMPLE}",
            found=text if isinstance(text, str) else kind(entry.value),
            fix=f"{entry.key}: {EXAMPLE}",
        )
        return None
    return MachineSpec(entry.key, str(text), entry.key_where)
