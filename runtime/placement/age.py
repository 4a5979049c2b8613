"""Age of an output's newest sample when an input that depends on it is used.

``worst_age`` computes it before a run, from rates, offsets, order, delays and the limits of free-running
links; ``measured_ages`` computes it from the times at which ticks began and messages were read in a run.
The age counts from the tick in which the sample was taken until the reader runs again, since a robot
applies a command until then. Of several ways from the output to the input the one that brings the
newest sample counts; so a way that goes round in a loop does not. Across machines the measured age has
the error of the estimated clock offset; within one machine there is none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import lcm

import numpy as np
from numpy.typing import NDArray

from ..language.schedule import runs_at
from ..language.stages import BlockSpec, CheckedGraph
from .placed import PlacementError

LONGEST = 20_000
"""Ticks that are looked at, at most."""
Instant = float | None
"""The time at which the newest sample was taken that a value depends on [s], if on any."""


class _SampleTimes:
    """Follows through the ticks of a graph which sample of ``source`` every block depends on."""

    def __init__(self, graph: CheckedGraph, source: str) -> None:
        self.graph = graph
        self.source = source
        self.specs = {spec.path: spec for spec in graph.blocks}
        self.output: dict[str, Instant] = {}
        self.ran: dict[str, float] = {}
        self.kept: dict[str, deque[Instant]] = {
            spec.path: deque([None] * spec.block_type.delay_runs, maxlen=spec.block_type.delay_runs)
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
        """Return the newest sample that any input of a block depends on."""
        found = [self.read(spec, name, now) for name in spec.wires]
        return max((time for time in found if time is not None), default=None)

    def read(self, spec: BlockSpec, name: str, now: float) -> Instant:
        """Return the newest sample that one input depends on."""
        wire = spec.wires[name]
        source = wire.source_block
        time = self.sampled if wire.source == self.source else self.output.get(source)
        links = self.graph.links
        if time is None or links.mode == "lockstep" or self.specs[source].machine == spec.machine:
            return time
        limit = links.policy_of(source).max_age
        return None if limit is None else now - limit - (self.ran[source] - time)


def worst_age(graph: CheckedGraph, source: str, target: str) -> float | None:
    """Return the largest age [s] of the newest sample of ``source`` at ``target``.

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
    settling = sum(spec.period_ticks * (1 + spec.block_type.delay_runs) for spec in graph.blocks)
    if pattern + settling > LONGEST:
        raise PlacementError(
            f"the age of {source} at {target} would need {pattern + settling} ticks to compute; at "
            f"most {LONGEST} are looked at"
        )
    times = _SampleTimes(graph, source)
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


SampleTime = int | None
"""Time of the newest sample that a value depends on, by the clock of a machine [ns]; ``None`` where
it depends on none."""


@dataclass(frozen=True)
class LinkTimes:
    """Messages of a free-running link in each tick of its reader, each (n,).

    Attributes:
        tick: the tick in which the source had run; -1 before the first message.
        sent: when the message was made, by the sender's clock [ns].
        read: when it was read, by the reader's clock [ns].
        age: how old it was then [ns].
    """

    tick: Sequence[int]
    sent: Sequence[int]
    read: Sequence[int]
    age: Sequence[int]


@dataclass(frozen=True)
class Timeline:
    """The ticks of one part, and when each began by the clock of its machine [ns], each (n,); and the
    links that it received, by their source."""

    ticks: Sequence[int]
    began: Sequence[int]
    links: Mapping[str, LinkTimes] = field(default_factory=dict)


class _PartSamples:
    """Follows through the ticks of one part which sample each value depends on."""

    def __init__(
        self, graph: CheckedGraph, machine: str | None, timeline: Timeline, source: str, target: str
    ) -> None:
        self.graph, self.timeline, self.source = graph, timeline, source
        self.reader, _, self.port = target.rpartition(".")
        self.specs = {spec.path: spec for spec in graph.blocks}
        order = dict.fromkeys([*graph.order, *self.specs])
        self.own = [self.specs[p] for p in order if machine in (None, self.specs[p].machine)]
        self.kept: dict[str, deque[SampleTime]] = {
            spec.path: deque([None] * spec.block_type.delay_runs, maxlen=spec.block_type.delay_runs)
            for spec in self.own
            if spec.block_type.is_moore()
        }
        self.output: dict[str, SampleTime] = {}
        self.sampled: SampleTime = None
        self.known: dict[tuple[int, str], SampleTime] = {}
        """Newest samples behind the outputs of a tick; the output that is followed has its own
        name."""
        self.found: list[tuple[int, SampleTime]] = []
        self.done = False

    def run(self, parts: Mapping[str, _PartSamples]) -> Iterator[None]:
        """Go through all ticks; stops to wait for what another part has not come to yet."""
        at = self.source.rpartition(".")[0]
        for place, tick in enumerate(self.timeline.ticks):
            active = [s for s in self.own if runs_at(tick, s.period_ticks, s.offset_ticks)]
            for spec in active:
                if spec.path in self.kept:
                    self.output[spec.path] = self.kept[spec.path][0]
                else:
                    yield from self._collect(spec, place, parts)
                self.known[tick, spec.path] = self.output[spec.path]
                if spec.path == at:
                    self.sampled = self.timeline.began[place]
                    self.known[tick, self.source] = self.sampled
                if spec.path == self.reader and spec.path not in self.kept:
                    yield from self._note(spec, place, parts)
            for spec in active:
                if spec.path in self.kept:
                    yield from self._collect(spec, place, parts, keep=True)
                    if spec.path == self.reader:
                        yield from self._note(spec, place, parts)
        self.done = True

    def _collect(
        self, spec: BlockSpec, place: int, parts: Mapping[str, _PartSamples], *, keep: bool = False
    ) -> Iterator[None]:
        newest: SampleTime = None
        for name in spec.wires:
            yield from self._arrives(spec, name, place, parts)
            time = self._read(spec, name, place, parts)
            newest = time if newest is None or (time is not None and time > newest) else newest
        if keep:
            self.kept[spec.path].append(newest)
        else:
            self.output[spec.path] = newest

    def _note(
        self, spec: BlockSpec, place: int, parts: Mapping[str, _PartSamples]
    ) -> Iterator[None]:
        yield from self._arrives(spec, self.port, place, parts)
        self.found.append((place, self._read(spec, self.port, place, parts)))

    def _link(self, spec: BlockSpec, name: str) -> LinkTimes | None:
        return self.timeline.links.get(spec.wires[name].source_block)

    def _arrives(
        self, spec: BlockSpec, name: str, place: int, parts: Mapping[str, _PartSamples]
    ) -> Iterator[None]:
        """Wait until the sender has come to the tick whose message was read here."""
        link, source = self._link(spec, name), spec.wires[name].source_block
        if link is None:
            return
        sender, tick = parts[self.specs[source].machine], link.tick[place]
        while not sender.done and (tick, source) not in sender.known:
            if tick < sender.timeline.ticks[0]:
                return
            yield

    def _read(
        self, spec: BlockSpec, name: str, place: int, parts: Mapping[str, _PartSamples]
    ) -> SampleTime:
        wire, link = spec.wires[name], self._link(spec, name)
        followed = wire.source == self.source
        if link is None:
            return self.sampled if followed else self.output.get(wire.source_block)
        sender = parts[self.specs[wire.source_block].machine]
        taken = sender.known.get((link.tick[place], self.source if followed else wire.source_block))
        if taken is None:
            return None
        return link.read[place] - link.age[place] - (link.sent[place] - taken)


def measured_ages(
    graph: CheckedGraph, timelines: Mapping[str, Timeline], source: str, target: str
) -> NDArray[np.float64]:
    """Return the age [s] of the newest sample of ``source`` at ``target``, at every run of the
    reader.

    Args:
        graph: the graph.
        timelines: when ticks began, by machine; one alone stands for all machines, as in one
            process and in lockstep.
        source: an output, ``block.port``.
        target: an input, ``block.port``.

    Returns:
        (n,), from the first run of the reader that depends on a sample. As in ``worst_age`` an age
        counts until the reader runs again.
    """
    alone = len(timelines) == 1
    parts = {
        machine: _PartSamples(graph, None if alone else machine, timeline, source, target)
        for machine, timeline in timelines.items()
        if len(timeline.ticks)
    }
    waiting = {machine: part.run(parts) for machine, part in parts.items()}
    while waiting:
        before = {machine: len(part.known) for machine, part in parts.items()}
        for machine in list(waiting):
            # it goes on until it waits for another part
            if next(waiting[machine], "done") == "done":
                del waiting[machine]
        if waiting and before == {machine: len(part.known) for machine, part in parts.items()}:
            break  # the recordings do not belong together
    ages = []
    for part in parts.values():
        began = part.timeline.began
        for (_, newest), (following, _) in zip(part.found, part.found[1:], strict=False):
            if newest is not None:
                ages.append((began[following] - newest) * 1e-9)
    return np.array(ages, np.float64)
