"""Puts the nodes of a diagram into columns, and in each column into an order with few crossings.

This is the layered layout of Sugiyama: nodes stand in the order of execution, wires lead from left to right
but for those that close a loop, and a source whose readers are further away passes through a place of
its own in every column between.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

from .diagram import INTO, OUT, Diagram, DiagramWire

_SWEEPS = 4
_PASSES = 8
_KICKS = 10
_ROUNDS = 2
_BELOW = "<below>"
"""The place of the lanes that lead back."""
FEW = 300
"""Largest number of places for which the best order is sought; beyond it, a good one."""


@dataclass(frozen=True)
class WirePassage:
    """The place of a net in a column that it only passes."""

    net: tuple[str, str]
    layer: int


Slot = str | WirePassage
"""A node, by its path, or the passage of a net."""


@dataclass
class Layers:
    """The columns from left to right, with their places from top to bottom."""

    columns: list[list[Slot]]
    layer: dict[str, int]
    forward: list[DiagramWire]
    back: list[DiagramWire]
    links: dict[tuple[Slot, Slot], list[tuple[str, str]]] = field(default_factory=dict)
    """Between neighbouring columns: the ports at both ends, empty for a passage."""


def arrange(diagram: Diagram) -> Layers:
    """Arrange a diagram in columns, in an order that is the same for the same diagram.

    The ports of its blocks are put into the order in which their wires come and go.
    """
    rank = _ranks(diagram)
    forward = [w for w in diagram.wires if rank[w.source[0]] < rank[w.target[0]]]
    back = [w for w in diagram.wires if rank[w.source[0]] >= rank[w.target[0]]]
    layer = _longest_paths(diagram, forward, rank)
    columns: list[list[Slot]] = [[] for _ in range(max(layer.values(), default=0) + 1)]
    for path in diagram.nodes:
        columns[layer[path]].append(path)
    layers = Layers(columns, layer, forward, back)
    _add_passages(layers)
    for _ in range(_ROUNDS if len(diagram.nodes) <= FEW else 1):
        _reduce_crossings(layers, diagram)
        _sort_ports(layers, diagram)
    return layers


def _ranks(diagram: Diagram) -> dict[str, float]:
    """Return the rank of each node in the order of execution.

    A block whose outputs follow from its state writes before all others and reads after them; it stands
    where the fewest of its wires lead back.
    """
    order = [p for p, node in diagram.nodes.items() if not node.moore and p not in (INTO, OUT)]
    rank: dict[str, float] = {path: float(number) for number, path in enumerate(order)}
    rank |= {INTO: -2.0, OUT: len(order) + 1.0}
    taken = [-1.0, *map(float, range(len(order)))]
    sources: dict[str, list[str]] = {p: [] for p, node in diagram.nodes.items() if node.moore}
    readers: dict[str, list[str]] = {path: [] for path in sources}
    for wire in diagram.wires:
        a, b = wire.source[0], wire.target[0]
        if a in readers:
            readers[a].append(b)
        if b in sources:
            sources[b].append(a)
    for path in sorted(sources, key=lambda path: -len(readers[path])):
        before = sorted(rank[p] for p in sources[path] if p in rank)
        behind = sorted(rank[p] for p in readers[path] if p in rank)
        places = [-1.0, *before]
        back = [len(before) - bisect_right(before, at) + bisect_right(behind, at) for at in places]
        least = places[back.index(min(back))]
        number = bisect_right(taken, least)
        following = taken[number] if number < len(taken) else least + 1.0
        rank[path] = 0.5 * (least + following)
        taken.insert(number, rank[path])
    return rank


def _longest_paths(
    diagram: Diagram, forward: Sequence[DiagramWire], rank: dict[str, float]
) -> dict[str, int]:
    """Return the column of every node: behind all its sources, and no further right than
    necessary."""
    layer = dict.fromkeys(diagram.nodes, 0)
    sources: dict[str, list[str]] = {path: [] for path in diagram.nodes}
    targets: dict[str, list[str]] = {path: [] for path in diagram.nodes}
    for wire in forward:
        sources[wire.target[0]].append(wire.source[0])
        targets[wire.source[0]].append(wire.target[0])
    in_order = sorted(diagram.nodes, key=lambda path: rank[path])
    for path in in_order:
        layer[path] = max((layer[source] + 1 for source in sources[path]), default=0)
    for path in reversed(in_order):  # what nothing feeds stands beside its first reader
        if targets[path] and not sources[path] and path != INTO:
            layer[path] = min(layer[target] for target in targets[path]) - 1
    if OUT in layer:
        layer[OUT] = max(max(layer.values()), 1 + max((v for k, v in layer.items() if k != OUT)))
    return layer


def _add_passages(layers: Layers) -> None:
    """Add a place in every column that a net passes, shared by all its readers."""
    reach: dict[tuple[str, str], int] = {}
    for wire in layers.forward:
        reach[wire.source] = max(reach.get(wire.source, 0), layers.layer[wire.target[0]])
    for net, end in reach.items():
        before: Slot = net[0]
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


End = tuple[Slot, float]
"""End of a net: the place, and its share of the place's height from the top."""


@dataclass
class _NetInGap:
    """A net between two neighbouring columns: where it comes from, and where it goes."""

    start: End
    ends: list[End] = field(default_factory=list)


def _reduce_crossings(layers: Layers, diagram: Diagram) -> None:
    """Sort every column by the mean place of what it is wired to, to and fro; keep the best.

    With few places each then moves to its best place after every sweep, and in the end some are moved by
    chance, the same in every run, which is kept where no more nets cross than before.
    """
    ports = {
        path: (_shares(node.inputs), _shares(node.outputs)) for path, node in diagram.nodes.items()
    }
    before: dict[Slot, list[End]] = {}
    behind: dict[Slot, list[End]] = {}
    nets: dict[tuple[Slot, str], _NetInGap] = {}
    gaps: list[list[_NetInGap]] = [[] for _ in layers.columns]
    for (a, b), links in layers.links.items():
        for out, into in links:
            start = (a, 0.5 if isinstance(a, WirePassage) else ports[a][1].get(out, 0.5))
            end = (b, 0.5 if isinstance(b, WirePassage) else ports[b][0].get(into, 0.5))
            before.setdefault(b, []).append(start)
            behind.setdefault(a, []).append(end)
            if (a, out) not in nets:
                number = a.layer if isinstance(a, WirePassage) else layers.layer[a]
                nets[a, out] = _NetInGap(start)
                gaps[number].append(nets[a, out])
            nets[a, out].ends.append(end)
    wires = [list(gap) for gap in gaps]
    for wire in layers.back:  # down to its lane below all places, and up from there
        (a, out), (b, into) = wire.source, wire.target
        number, start = layers.layer[a], (a, ports[a][1].get(out, 0.5))
        if (a, out) not in nets:
            nets[a, out] = _NetInGap(start)
            gaps[number].append(nets[a, out])
        nets[a, out].ends.append((_BELOW, 0.0))
        if layers.layer[b]:
            end = (b, ports[b][0].get(into, 0.5))
            gaps[layers.layer[b] - 1].append(_NetInGap((_BELOW, 0.0), [end]))
    where = {place: k for column in layers.columns for k, place in enumerate(column)}
    where[_BELOW] = len(where)
    few = len(where) <= FEW
    best, least = layers.columns, 0
    for sweep in range(_SWEEPS):
        neighbours = before if sweep % 2 == 0 else behind
        for column in layers.columns if sweep % 2 == 0 else layers.columns[::-1]:
            means = {
                place: sum(where[p] + s for p, s in found) / len(found)
                if (found := neighbours.get(place))
                else float(where[place])
                for place in column
            }
            column.sort(key=means.__getitem__)
            where.update({place: k for k, place in enumerate(column)})
        swept = [list(column) for column in layers.columns]
        if few:
            _exchange(layers, gaps, where)
            crossings = _all_pairs(gaps, where)
        else:
            crossings = _crossings(wires, where)
        if not sweep or crossings < least:
            best, least = [list(column) for column in layers.columns], crossings
        layers.columns[:] = swept
        where.update({p: k for column in swept for k, p in enumerate(column)})
    layers.columns[:] = best
    wide = [column for column in layers.columns if len(column) > 1]
    if not few or not wide:
        return
    where.update({p: k for column in best for k, p in enumerate(column)})
    chance = Random(0)
    for _ in range(_KICKS):
        kept = [list(column) for column in layers.columns]
        column = chance.choice(wide)
        column.insert(chance.randrange(len(column)), column.pop(chance.randrange(len(column))))
        where.update({p: k for k, p in enumerate(column)})
        _exchange(layers, gaps, where)
        crossings = _all_pairs(gaps, where)
        if crossings <= least:
            least = crossings
        else:
            for changed, before_it in zip(layers.columns, kept, strict=True):
                changed[:] = before_it
            where.update({p: k for column in kept for k, p in enumerate(column)})


def _all_pairs(gaps: Sequence[Sequence[_NetInGap]], where: dict[Slot, int]) -> int:
    """Count the unavoidable crossings of nets in all gaps."""
    return sum(
        _pair(one, other, where)
        for gap in gaps
        for number, one in enumerate(gap)
        for other in gap[number + 1 :]
    )


def _sort_ports(layers: Layers, diagram: Diagram) -> None:
    """Put the ports of every block into the order of what they are wired to."""
    where: dict[Slot, int] = {p: k for column in layers.columns for k, p in enumerate(column)}
    far = float(len(where))
    ports = {p: (_shares(node.inputs), _shares(node.outputs)) for p, node in diagram.nodes.items()}
    found: dict[tuple[str, bool, str], list[float]] = {}
    for (a, b), links in layers.links.items():
        for out, into in links:
            if isinstance(a, str):
                at = ports[b][0].get(into, 0.5) if isinstance(b, str) else 0.5
                found.setdefault((a, True, out), []).append(where[b] + at)
            if isinstance(b, str):
                at = ports[a][1].get(out, 0.5) if isinstance(a, str) else 0.5
                found.setdefault((b, False, into), []).append(where[a] + at)
    for wire in layers.back:
        found.setdefault((*wire.source[:1], True, wire.source[1]), []).append(far)
        found.setdefault((*wire.target[:1], False, wire.target[1]), []).append(far)

    def wired_to(path: str, is_output: bool) -> Callable[[str], float]:
        def mean(port: str) -> float:
            places = found.get((path, is_output, port), [far])
            return sum(places) / len(places)

        return mean

    for path, node in diagram.nodes.items():
        if node.inside is None and path not in (INTO, OUT):
            node.inputs.sort(key=wired_to(path, False))
            node.outputs.sort(key=wired_to(path, True))


def _shares(ports: Sequence[str]) -> dict[str, float]:
    """Return the height of each port in its block, as a share from the top."""
    return {port: (k + 1) / (len(ports) + 1) for k, port in enumerate(ports)}


def _crossings(gaps: Sequence[Sequence[_NetInGap]], where: dict[Slot, int]) -> int:
    """Count the crossing pairs of wires between neighbouring columns."""
    total = 0
    for gap in gaps:
        wires = sorted(
            (where[net.start[0]] + net.start[1], where[p] + s) for net in gap for p, s in net.ends
        )
        arrived: list[float] = []
        for _, end in wires:
            number = bisect_right(arrived, end)
            total += len(arrived) - number
            arrived.insert(number, end)
    return total


def _exchange(layers: Layers, gaps: Sequence[Sequence[_NetInGap]], where: dict[Slot, int]) -> None:
    """Move single places up and down in their columns while fewer nets cross."""
    touching: dict[Slot, tuple[list[_NetInGap], list[_NetInGap]]] = {
        place: ([], []) for place in where
    }
    for gap in gaps:
        for net in gap:
            touching[net.start[0]][1].append(net)
            for place in dict.fromkeys(p for p, _ in net.ends):
                touching[place][0].append(net)

    def among(one: Slot, other: Slot) -> int:
        return sum(
            _pair(a, b, where)
            for side in (0, 1)
            for a in touching[one][side]
            for b in touching[other][side]
            if a is not b
        )

    for _ in range(_PASSES):
        moved = False
        for column in layers.columns:
            for place in list(column):
                for step in (1, -1):
                    moved = _move(column, place, step, where, among) or moved
        if not moved:
            break


def _move(
    column: list[Slot],
    place: Slot,
    step: int,
    where: dict[Slot, int],
    among: Callable[[Slot, Slot], int],
) -> bool:
    """Move a place down (1) or up (-1) to where the fewest nets cross; whether that is elsewhere."""

    def swap(number: int, way: int) -> None:
        other = column[number + way]
        column[number], column[number + way] = other, place
        where[other], where[place] = number, number + way

    begin = at = best = where[place]
    gain = most = 0
    while 0 <= at + step < len(column):
        other = column[at + step]
        gain += among(place, other)
        swap(at, step)
        gain -= among(place, other)
        at += step
        if gain > most:
            best, most = at, gain
    for number in range(at, best, -step):  # back to the best
        swap(number, -step)
    return best != begin


def _pair(one: _NetInGap, other: _NetInGap, where: dict[Slot, int]) -> int:
    """Count the unavoidable crossings of two nets in a gap."""
    if where[one.start[0]] + one.start[1] > where[other.start[0]] + other.start[1]:
        one, other = other, one
    upper = [where[p] + s for p, s in one.ends]
    lower = [where[p] + s for p, s in other.ends]
    if max(upper) <= min(lower):
        return 0
    first = sum(min(lower) < y < max(lower) for y in upper)
    second = sum(min(upper) < y < max(upper) for y in lower)
    return 1 + min(first, second)
