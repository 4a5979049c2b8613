"""How old the newest sample of one output can be when an input that depends on it is used.

Computed before a run, from rates, offsets, order, delays and the limits of free-running links. The
age counts from the tick in which the sample was taken until the reader runs again, since a robot
applies a command until then. Of several ways from the output to the input the
one that brings the newest sample counts; so a way that goes round in a loop does not.
"""

from __future__ import annotations

from collections import deque
from math import lcm

from ..language.delay import Delay
from ..language.schedule import runs_at
from ..language.stages import BlockSpec, CheckedGraph
from .placed import PlacementError

LONGEST = 20_000
"""Ticks that are looked at, at most."""
Instant = float | None
"""The time at which the newest sample was taken that a value depends on [s], if on any."""


class _Times:
    """Follows through the ticks of a graph which sample of ``source`` every block depends on."""

    def __init__(self, graph: CheckedGraph, source: str) -> None:
        self.graph = graph
        self.source = source
        self.specs = {spec.path: spec for spec in graph.blocks}
        self.output: dict[str, Instant] = {}
        self.ran: dict[str, float] = {}
        self.kept: dict[str, deque[Instant]] = {
            spec.path: deque([None] * depth(spec), maxlen=depth(spec))
            for spec in graph.blocks
            if spec.block_type.is_moore()
        }
        self.sampled: Instant = None

    def tick(self, tick: int) -> None:
        """Run all blocks of a tick."""
        now = tick * self.graph.base_period
        active = [
            self.specs[path]
            for path in self.graph.order
            if runs_at(tick, self.specs[path].period_ticks, self.specs[path].offset_ticks)
        ]
        for spec in active:
            kept = self.kept.get(spec.path)
            self.output[spec.path] = self.newest(spec, now) if kept is None else kept[0]
            self.ran[spec.path] = now
            if self.source.rpartition(".")[0] == spec.path:
                self.sampled = now
        for spec in active:
            if spec.path in self.kept:
                self.kept[spec.path].append(self.newest(spec, now))

    def newest(self, spec: BlockSpec, now: float) -> Instant:
        """The newest sample that any input of a block depends on."""
        found = [self.read(spec, name, now) for name in spec.wires]
        return max((time for time in found if time is not None), default=None)

    def read(self, spec: BlockSpec, name: str, now: float) -> Instant:
        """The newest sample that one input depends on."""
        wire = spec.wires[name]
        source = wire.source_block
        time = self.sampled if wire.source == self.source else self.output.get(source)
        links = self.graph.links
        if time is None or links.mode == "lockstep" or self.specs[source].machine == spec.machine:
            return time
        limit = links.policy_of(source).max_age
        return None if limit is None else now - limit - (self.ran[source] - time)


def depth(spec: BlockSpec) -> int:
    """After how many runs of a Moore block its output depends on an input."""
    if not issubclass(spec.block_type, Delay):
        return 1
    entries = next(iter(spec.block_type.states["past"].signal.fields.values()))
    return int(entries.shape[0])


def worst_age(graph: CheckedGraph, source: str, target: str) -> float | None:
    """The largest age [s] of the newest sample of ``source`` at ``target``.

    Args:
        graph: the graph.
        source: an output, ``block.port``.
        target: an input, ``block.port``.

    Returns:
        The age, or ``None`` if the input does not depend on the output, or has no bound because a
        free-running link has no ``max_age``.

    Raises:
        PlacementError: there is no such output or input, or the pattern of rates is too long.
    """
    specs = {spec.path: spec for spec in graph.blocks}
    for end, kind in ((source, "output"), (target, "input")):
        block, _, port = end.rpartition(".")
        found = specs.get(block)
        names = (
            []
            if found is None
            else list(found.block_type.outputs if kind == "output" else found.wires)
        )
        if port not in names:
            there = f"; {block} has {', '.join(names)}" if names else ""
            raise PlacementError(f"there is no wired {kind} {end!r}{there}")
    reader = specs[target.rpartition(".")[0]]
    pattern = lcm(*(spec.period_ticks for spec in graph.blocks))
    settling = sum(spec.period_ticks * (1 + depth(spec)) for spec in graph.blocks)
    if pattern + settling > LONGEST:
        raise PlacementError(
            f"the age of {source} at {target} would need {pattern + settling} ticks to compute; at "
            f"most {LONGEST} are looked at"
        )
    times = _Times(graph, source)
    worst: float | None = None
    for tick in range(settling + pattern):
        times.tick(tick)
        if tick < settling or not runs_at(tick, reader.period_ticks, reader.offset_ticks):
            continue
        now = tick * graph.base_period
        newest = times.read(reader, target.rpartition(".")[2], now)
        if newest is None:
            return None
        held = reader.period_ticks * graph.base_period
        worst = max(worst or 0.0, now - newest + held)
    return worst
