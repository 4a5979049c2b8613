"""The order in which blocks run: topological over ports, with ties broken by the order in the file.

An output of a Mealy block depends on all inputs of that block in the same tick; an output of a
Moore block depends on none. So Moore blocks come first, in file order, and every other block comes
after the sources of its inputs; of several blocks that could run next, the first in the file does.
A ring of wires through Mealy blocks alone has no order; it is found and reported as a whole. The
order depends neither on sets nor on hashes, so it is the same on every machine.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import lcm
from typing import NamedTuple

from .errors import AloftError

MAXIMAL_HYPERPERIOD = 100_000
"""The longest allowed hyperperiod [ticks]. A longer one is taken for a mistake in the rates."""


@dataclass(frozen=True)
class ScheduleBlock:
    """The properties of a block that determine the order.

    ``sources`` names for each wired input the output ``block.port`` that feeds it. A delayed wire
    does not appear in it, because it depends on nothing in this tick.
    """

    path: str
    is_moore: bool
    sources: Mapping[str, str]


@dataclass(frozen=True)
class Loop:
    """A ring without a delay, as ports: output, input it feeds, output of that block, ...

    The input of the last port belongs to the block of the first.
    """

    ports: tuple[str, ...]

    def __str__(self) -> str:
        return " -> ".join(self.ports)

    @property
    def blocks(self) -> tuple[str, ...]:
        """The blocks on the ring, in the direction of the wires."""
        return tuple(_block_of(port) for port in self.ports[::2])


class LoopError(AloftError):
    """Some blocks have no order; ``loops`` holds the rings of wires that prevent it."""

    def __init__(self, loops: Sequence[Loop]) -> None:
        rings = "; ".join(str(loop) for loop in loops)
        super().__init__(
            f"loop without a delay: {rings}. Give one wire of each ring 'delay: 1', or put a "
            "block with state between, such as blocks.UnitDelay"
        )
        self.loops = tuple(loops)


class _Edge(NamedTuple):
    """A wire between two Mealy blocks, by their index in the file."""

    source: int
    target: int
    output: str
    input: str


def _block_of(port: str) -> str:
    return port.rpartition(".")[0]


def _edges(blocks: Sequence[ScheduleBlock]) -> list[_Edge]:
    """All dependencies within a tick, in file order; wires from unknown blocks are left out."""
    index = {block.path: i for i, block in enumerate(blocks)}
    edges = []
    for target, block in enumerate(blocks):
        if block.is_moore:
            continue
        for name, output in block.sources.items():
            source = index.get(_block_of(output))
            if source is not None and not blocks[source].is_moore:
                edges.append(_Edge(source, target, output, f"{block.path}.{name}"))
    return edges


def order_blocks(blocks: Iterable[ScheduleBlock]) -> tuple[str, ...]:
    """Return the paths of ``blocks`` (given in file order) in the order they run within a tick.

    Raises:
        LoopError: there is no such order.
    """
    nodes = tuple(blocks)
    waiting = [0] * len(nodes)
    targets: list[list[int]] = [[] for _ in nodes]
    for edge in _edges(nodes):
        waiting[edge.target] += 1
        targets[edge.source].append(edge.target)
    order = [i for i, block in enumerate(nodes) if block.is_moore]
    ready = [i for i, block in enumerate(nodes) if not block.is_moore and waiting[i] == 0]
    heapq.heapify(ready)
    while ready:
        i = heapq.heappop(ready)
        order.append(i)
        for target in targets[i]:
            waiting[target] -= 1
            if waiting[target] == 0:
                heapq.heappush(ready, target)
    if len(order) < len(nodes):
        raise LoopError(find_loops(nodes))
    return tuple(nodes[i].path for i in order)


def find_loops(blocks: Iterable[ScheduleBlock]) -> tuple[Loop, ...]:
    """Return the rings without a delay; together they contain every wire that lies on any ring.

    Each is a shortest ring through a wire that no earlier ring contains. It starts at that of its
    blocks which comes first in the file.
    """
    nodes = tuple(blocks)
    edges = _without_ends(_edges(nodes))
    leaving: list[list[_Edge]] = [[] for _ in nodes]
    for edge in edges:
        leaving[edge.source].append(edge)
    loops: list[Loop] = []
    covered: dict[_Edge, None] = {}
    for edge in edges:
        if edge in covered:
            continue
        back = _shortest_path(leaving, edge.target, edge.source)
        if back is None:
            continue
        ring = [edge, *back]
        covered.update(dict.fromkeys(ring))
        first = min(range(len(ring)), key=lambda i: ring[i].source)
        ports = [port for e in (*ring[first:], *ring[:first]) for port in (e.output, e.input)]
        loops.append(Loop(tuple(ports)))
    return tuple(loops)


def _without_ends(edges: Sequence[_Edge]) -> list[_Edge]:
    """Return the edges without those that lead to no ring, or that no ring leads to."""
    return _without_sinks(_without_sinks(edges, reverse=False), reverse=True)


def _without_sinks(edges: Sequence[_Edge], *, reverse: bool) -> list[_Edge]:
    """Return the edges without those into blocks that nothing leaves, until there are none of
    these.

    With ``reverse`` all edges point the other way.
    """
    arriving: dict[int, list[_Edge]] = {}
    leaving: dict[int, int] = {}
    for edge in edges:
        source, target = (edge.target, edge.source) if reverse else (edge.source, edge.target)
        arriving.setdefault(target, []).append(edge)
        leaving[source] = leaving.get(source, 0) + 1
    sinks = deque(block for block in arriving if block not in leaving)
    removed: dict[_Edge, None] = {}
    while sinks:
        for edge in arriving.get(sinks.popleft(), ()):
            removed[edge] = None
            source = edge.target if reverse else edge.source
            leaving[source] -= 1
            if not leaving[source]:
                sinks.append(source)
    return [edge for edge in edges if edge not in removed]


def _shortest_path(
    leaving: Sequence[Sequence[_Edge]], start: int, goal: int
) -> tuple[_Edge, ...] | None:
    """Return the edges of a shortest path from ``start`` to ``goal``, or ``None`` if there is none.

    The path is empty if both are the same block.
    """
    if start == goal:
        return ()
    arrived: dict[int, _Edge] = {}
    queue = deque([start])
    while queue:
        here = queue.popleft()
        for edge in leaving[here]:
            if edge.target in arrived or edge.target == start:
                continue
            arrived[edge.target] = edge
            if edge.target == goal:
                path = [edge]
                while path[-1].source != start:
                    path.append(arrived[path[-1].source])
                return tuple(reversed(path))
            queue.append(edge.target)
    return None


def runs_at(tick: int, period: int, offset: int) -> bool:
    """Return whether a block with this period and offset [ticks] runs in ``tick``."""
    return tick % period == offset % period


def hyperperiod(periods: Iterable[int]) -> int:
    """Return the number of ticks after which the pattern of running blocks repeats.

    Raises:
        AloftError: it is longer than ``MAXIMAL_HYPERPERIOD``.
    """
    numbers = tuple(periods)
    length = lcm(*numbers) if numbers else 1
    if length > MAXIMAL_HYPERPERIOD:
        different = ", ".join(str(p) for p in sorted(dict.fromkeys(numbers)))
        raise AloftError(
            f"periods of {different} ticks repeat only after {length} ticks; at most "
            f"{MAXIMAL_HYPERPERIOD} are allowed. Choose rates that divide one another"
        )
    return length


def phases(rates: Sequence[tuple[int, int]]) -> tuple[tuple[int, ...], ...]:
    """Return, for each tick of the hyperperiod, the indices of those ``rates`` (period, offset)
    that run.

    Equal phases are one object, so that a long hyperperiod has few of them, too.
    """
    known: dict[tuple[int, ...], tuple[int, ...]] = {}
    table = []
    for tick in range(hyperperiod(period for period, _ in rates)):
        active = tuple(i for i, (p, o) in enumerate(rates) if runs_at(tick, p, o))
        table.append(known.setdefault(active, active))
    return tuple(table)
