"""Delays of wires that lead into a part of a graph: in the part, or on the side of its caller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from ....runtime.language.errors import AloftError
from ....runtime.language.flat_graph import FlatBlock
from ....runtime.language.stages import BlockSpec, CheckedGraph

SIDES = ("inside", "outside")


@dataclass(frozen=True)
class InputDelay:
    """A delayed wire into a part: its reader ``block.input``, the outputs outside that it reads, the delay in
    runs of their block and in seconds, and its side, ``inside`` or ``outside``."""

    reader: str
    sources: tuple[str, ...]
    runs: int
    seconds: float
    side: str

    def plain(self) -> dict[str, Any]:
        """Return the delay as plain data."""
        return asdict(self)

    def __str__(self) -> str:
        late = f"{self.seconds:.9g} s late"
        if self.side == "inside":
            return f"{self.reader} reads it {late}, by a delay in here"
        return f"give it {late}: {self.reader} has no delay in here"


def input_delays(
    inside: Sequence[FlatBlock], graph: CheckedGraph, side: str
) -> tuple[InputDelay, ...]:
    """Return the delays of wires from outside.

    Raises:
        AloftError: there is no such side, or a delay cannot be outside, because its wire joins what is inside
            and outside, or because another block reads the same output with another delay.
    """
    if side not in SIDES:
        raise AloftError(
            f"there is no side {side!r} for delays of inputs; there is {', '.join(SIDES)}"
        )
    own = {block.path for block in inside}
    found: list[InputDelay] = []
    read: dict[str, dict[int, str]] = {}
    for block in inside:
        for name, wire in block.wires.items():
            reader = f"{block.path}.{name}"
            sources = [each.source for each in wire.inner() if each.source_block not in own]
            for source in sources:
                read.setdefault(source, {})[wire.delay] = reader
            if not wire.delay or not sources:
                continue
            if side == "outside" and len(sources) < len(wire.inner()):
                raise AloftError(
                    f"the delay of {reader} cannot be outside: its wire joins outputs of both sides; "
                    "write it with --delays inside"
                )
            delay = graph.block(f"{block.path}/{name}~delay")
            seconds = wire.delay * delay.period_ticks * graph.base_period
            found.append(
                InputDelay(reader, tuple(dict.fromkeys(sources)), wire.delay, seconds, side)
            )
    for delayed in found if side == "outside" else ():
        for source in delayed.sources:
            if len(read[source]) > 1:
                late = [
                    f"{reader} {runs} runs late" for runs, reader in sorted(read[source].items())
                ]
                raise AloftError(
                    f"the delays of {source} cannot be outside: {' and '.join(late)}; "
                    "write it with --delays inside"
                )
    return tuple(found)


def without_delays(
    inside: Iterable[FlatBlock], graph: CheckedGraph, delays: Iterable[InputDelay]
) -> tuple[list[FlatBlock], CheckedGraph]:
    """Return the blocks inside, and the graph, without these delays."""
    flat = {block.path: block for block in inside}
    specs: dict[str, BlockSpec] = {spec.path: spec for spec in graph.blocks}
    order = list(graph.order)
    for delay in delays:
        path, _, name = delay.reader.rpartition(".")
        removed = f"{path}/{name}~delay"
        source = specs.pop(removed).wires["u"].source
        order.remove(removed)
        wire = replace(specs[path].wires[name], source=source, delay=0, initial={})
        specs[path] = replace(specs[path], wires={**specs[path].wires, name: wire})
        joined = source.rpartition(".")[0]
        if "~" in joined:  # it reads what is outside alone, and now feeds its reader at once
            order.remove(joined)
            order.insert(order.index(path), joined)
        wires = dict(flat[path].wires)
        wires[name] = replace(wires[name], delay=0, initial=None)
        flat[path] = replace(flat[path], wires=wires)
    changed = replace(graph, blocks=tuple(specs.values()), order=tuple(order))
    return list(flat.values()), changed


def said_of(source: str, delays: Iterable[InputDelay]) -> str:
    """Return what the text of an input ``block.port.field`` says of its delays; nothing where there is none."""
    port = source.rpartition(".")[0]
    return "".join(f"; {delay}" for delay in delays if port in delay.sources)


def rates(specs: Mapping[str, BlockSpec], paths: Iterable[str]) -> list[dict[str, Any]]:
    """Return the blocks by their rate: every how many ticks they run, from which, and which blocks."""
    found: dict[tuple[int, int], list[str]] = {}
    for path in paths:
        found.setdefault((specs[path].period_ticks, specs[path].offset_ticks), []).append(path)
    return [
        {"every": period, "from": offset, "blocks": blocks}
        for (period, offset), blocks in sorted(found.items())
    ]
