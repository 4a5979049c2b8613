"""Puts the nodes of a diagram into columns, and in each column into an order with few crossings.

This is the layered layout of Sugiyama: wires that lead back are found (the heuristic of Eades, Lin
and Smyth), the others lead from left to right, and a source whose readers are further away passes
through a place of its own in every column between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from .diagram import INTO, OUT, Diagram, DiagramWire

_SWEEPS = 24


@dataclass(frozen=True)
class WirePassage:
    """The place of a net in a column that it only passes."""

    net: tuple[str, str]
    layer: int


Place = str | WirePassage
"""A node, by its path, or the passage of a net."""


@dataclass
class Layers:
    """The columns from left to right, with their places from top to bottom."""

    columns: list[list[Place]]
    layer: dict[str, int]
    forward: list[DiagramWire]
    back: list[DiagramWire]
    links: dict[tuple[Place, Place], list[tuple[str, str]]] = field(default_factory=dict)
    """Between neighbouring columns: the ports at both ends, empty for a passage."""


def arrange(diagram: Diagram) -> Layers:
    """The columns of a diagram, in an order that is the same for the same diagram."""
    rank = _sequence(diagram)
    forward = [w for w in diagram.wires if rank[w.source[0]] < rank[w.target[0]]]
    back = [w for w in diagram.wires if rank[w.source[0]] >= rank[w.target[0]]]
    layer = _longest_paths(diagram, forward, rank)
    columns: list[list[Place]] = [[] for _ in range(max(layer.values(), default=0) + 1)]
    for path in diagram.nodes:
        columns[layer[path]].append(path)
    layers = Layers(columns, layer, forward, back)
    _add_passages(layers)
    _reduce_crossings(layers, diagram)
    return layers


def _sequence(diagram: Diagram) -> dict[str, int]:
    """A rank for every node, so that few wires lead from a higher rank to a lower one."""
    out: dict[str, dict[str, int]] = {path: {} for path in diagram.nodes}
    into: dict[str, dict[str, int]] = {path: {} for path in diagram.nodes}
    for wire in diagram.wires:
        a, b = wire.source[0], wire.target[0]
        if a != b:
            out[a][b] = out[a].get(b, 0) + 1
            into[b][a] = into[b].get(a, 0) + 1
    left = dict.fromkeys(path for path in diagram.nodes if path not in (INTO, OUT))
    first: list[str] = [INTO] if INTO in diagram.nodes else []
    last: list[str] = []

    def degree(links: dict[str, int]) -> int:
        return sum(count for path, count in links.items() if path in left)

    while left:
        sink = next((path for path in reversed(left) if not degree(out[path])), None)
        if sink is not None:
            last.insert(0, sink)
            del left[sink]
            continue
        start = next((path for path in left if not degree(into[path])), None)
        if start is None:
            start = max(left, key=lambda path: degree(out[path]) - degree(into[path]))
        first.append(start)
        del left[start]
    border = [OUT] if OUT in diagram.nodes else []
    return {path: number for number, path in enumerate([*first, *last, *border])}


def _longest_paths(
    diagram: Diagram, forward: Sequence[DiagramWire], rank: dict[str, int]
) -> dict[str, int]:
    """The column of every node: behind all its sources, and not further left than need be."""
    layer = dict.fromkeys(diagram.nodes, 0)
    in_order = sorted(diagram.nodes, key=lambda path: rank[path])
    for path in in_order:
        sources = [w.source[0] for w in forward if w.target[0] == path]
        layer[path] = max((layer[source] + 1 for source in sources), default=0)
    for path in reversed(in_order):  # what nothing feeds stands beside its first reader
        targets = [w.target[0] for w in forward if w.source[0] == path]
        fed = any(w.target[0] == path for w in forward)
        if targets and not fed and path != INTO:
            layer[path] = min(layer[target] for target in targets) - 1
    if OUT in layer:
        layer[OUT] = max(max(layer.values()), 1 + max((v for k, v in layer.items() if k != OUT)))
    return layer


def _add_passages(layers: Layers) -> None:
    """A place in every column that a net passes, shared by all its readers."""
    reach: dict[tuple[str, str], int] = {}
    for wire in layers.forward:
        reach[wire.source] = max(reach.get(wire.source, 0), layers.layer[wire.target[0]])
    for net, end in reach.items():
        before: Place = net[0]
        port = net[1]
        for number in range(layers.layer[net[0]] + 1, end):
            passage = WirePassage(net, number)
            layers.columns[number].append(passage)
            layers.links.setdefault((before, passage), []).append((port, ""))
            before, port = passage, ""
    for wire in layers.forward:
        number = layers.layer[wire.target[0]]
        direct = layers.layer[wire.source[0]] == number - 1
        before = wire.source[0] if direct else WirePassage(wire.source, number - 1)
        ends = (wire.source[1] if direct else "", wire.target[1])
        found = layers.links.setdefault((before, wire.target[0]), [])
        if ends not in found:
            found.append(ends)


def _reduce_crossings(layers: Layers, diagram: Diagram) -> None:
    """Sort every column by the mean place of what it is wired to, to and fro; keep the best."""

    def share(place: Place, port: str, outputs: bool) -> float:
        if isinstance(place, WirePassage):
            return 0.5
        ports = diagram.nodes[place].outputs if outputs else diagram.nodes[place].inputs
        return (ports.index(port) + 1) / (len(ports) + 1) if port in ports else 0.5

    before: dict[Place, list[tuple[Place, float]]] = {}
    behind: dict[Place, list[tuple[Place, float]]] = {}
    for (a, b), ends in layers.links.items():
        for out, into in ends:
            before.setdefault(b, []).append((a, share(a, out, True)))
            behind.setdefault(a, []).append((b, share(b, into, False)))
    best, least = [list(column) for column in layers.columns], _crossings(layers, diagram)
    for sweep in range(_SWEEPS):
        to_right = sweep % 2 == 0
        neighbours = before if to_right else behind
        count = len(layers.columns)
        for number in range(1, count) if to_right else range(count - 2, -1, -1):
            where = {p: k for c in layers.columns for k, p in enumerate(c)}
            column = layers.columns[number]

            def mean(
                place: Place,
                where: dict[Place, int] = where,
                links: dict[Place, list[tuple[Place, float]]] = neighbours,
            ) -> float:
                found = links.get(place, ())
                if not found:
                    return float(where[place])
                return sum(where[p] + s for p, s in found) / len(found)

            column.sort(key=mean)
        crossings = _crossings(layers, diagram)
        if crossings < least:
            best, least = [list(column) for column in layers.columns], crossings
    layers.columns[:] = best


def _crossings(layers: Layers, diagram: Diagram) -> int:
    """How many pairs of wires between neighbouring columns cross."""
    where = {p: k for c in layers.columns for k, p in enumerate(c)}
    spans: dict[int, list[tuple[int, int, int, int]]] = {}
    for (a, b), ends in layers.links.items():
        number = a.layer if isinstance(a, WirePassage) else layers.layer[a]
        for out, into in ends:
            first = 0 if isinstance(a, WirePassage) else diagram.nodes[a].outputs.index(out)
            last = 0 if isinstance(b, WirePassage) else diagram.nodes[b].inputs.index(into)
            spans.setdefault(number, []).append((where[a], first, where[b], last))
    total = 0
    for found in spans.values():
        for i, one in enumerate(found):
            for other in found[i + 1 :]:
                total += (one[:2] < other[:2]) != (one[2:] < other[2:]) and one[:2] != other[:2]
    return total
