"""Runs all parts of a placed graph in one process, for tests and for measurements of links.

``run_spread`` runs them in threads, in lockstep. ``run_virtual`` runs free-running parts: they tick
at their own phases, messages take the time that the caller sets, and computing takes none. One
thread goes from event to event, so a run is the same on every machine, however busy it is. Beacons
are left out: the parts count as started, and have one clock.
"""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.compile_calls import compile_calls
from ..language.block import Metric
from ..language.errors import AloftError
from ..language.stages import CheckedGraph, ClockSpec
from ..links.part import COORDINATOR, PREPARED, STARTED, BoundPart, MergedLayout, hash_of, run_part
from ..placement.placed import PlacedGraph, split_over_machines
from ..running.run_result import RunResult, merge_metrics
from ..running.sink import Sink
from ..running.ticker import Ticker
from ..transports.hub import Hub
from ..transports.transport import MessageCallback

Interfere = Callable[[str, bytes], Iterable[bytes]]


@dataclass(frozen=True)
class SpreadResult:
    """Results of the parts of a run, by machine."""

    placed: PlacedGraph
    results: Mapping[str, RunResult]
    parts: Mapping[str, BoundPart]

    @property
    def ticks(self) -> int:
        """Number of ticks that all parts have recorded."""
        counts = {machine: len(log.ticks) for machine, log in self._logs().items()}
        if len(dict.fromkeys(counts.values())) != 1:
            raise AloftError(f"the parts have recorded different numbers of ticks: {counts}")
        return next(iter(counts.values()))

    @property
    def rows(self) -> NDArray[np.uint8]:
        """The rows of the whole graph, (ticks, bytes), as one process would have recorded them."""
        layouts = {machine: part.memory.bus.layout for machine, part in self.parts.items()}
        layout = next(iter(layouts.values()))
        rows = {machine: log.rows()[: self.ticks] for machine, log in self._logs().items()}
        return MergedLayout(self.placed, layout, layouts).rows(rows)

    @property
    def run_hash(self) -> str:
        """The run hash of the whole graph."""
        return hash_of(self.rows)

    def _logs(self) -> dict[str, Any]:
        return {machine: result.log for machine, result in self.results.items()}


def run_spread(
    graph: CheckedGraph,
    ticks: int | None = None,
    *,
    interfere: Interfere | None = None,
    prepare: Callable[[Mapping[str, BoundPart], Hub], None] | None = None,
    timeout: float = 5.0,
    wall_time: float = 60.0,
    **options: Any,
) -> SpreadResult:
    """Run every part in a thread of its own.

    Args:
        graph: a graph with machines.
        ticks: how many ticks; by default the graph's duration.
        interfere: what happens to messages on their way; see ``Hub``.
        prepare: called with all parts and the hub before they start.
        timeout: the seconds that parts wait for one another.
        wall_time: the seconds after which it is an error that they still run.
        options: of the executor.

    Raises:
        AloftError: a part still runs after ``wall_time``, or could not be run.
    """
    hub = Hub()
    hub.interfere = interfere
    return run_parts_of(
        split_over_machines(graph), hub, ticks=ticks, prepare=prepare, timeout=timeout, wall_time=wall_time,
        **options,
    )  # fmt: skip


def run_parts_of(
    placed: PlacedGraph,
    hub: Hub,
    sinks: Mapping[str, Sequence[Sink]] | None = None,
    *,
    ticks: int | None = None,
    prepare: Callable[[Mapping[str, BoundPart], Hub], None] | None = None,
    timeout: float = 5.0,
    wall_time: float = 60.0,
    **options: Any,
) -> SpreadResult:
    """Run as ``run_spread`` does, with a hub and with sinks for each machine."""
    parts = {
        machine.name: BoundPart(
            placed, machine.name, hub.transport(), timeout=timeout, connect_timeout=timeout
        )
        for machine in placed.machines
    }
    if prepare is not None:
        prepare(parts, hub)
    results: dict[str, RunResult] = {}
    failures: list[str] = []

    def run(machine: str) -> None:
        own = (sinks or {}).get(machine, ())
        try:
            results[machine] = run_part(parts[machine], ticks, sinks=own, **options)
        except Exception as error:  # noqa: BLE001  # it is raised again below
            failures.append(f"{machine}: {type(error).__name__}: {error}")

    threads = [threading.Thread(target=run, args=(name,), daemon=True) for name in parts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(wall_time)
    if any(thread.is_alive() for thread in threads):
        failures.append(f"not all parts ended within {wall_time:g} s")
    if failures:
        raise AloftError("; ".join(failures))
    return SpreadResult(placed, {name: results[name] for name in parts}, parts)


Travel = Callable[[str, int], int | None]
"""Gives how long a message takes [ns], by the key of its link and the time; ``None`` if it is lost."""
_RUNTIME = (COORDINATOR, PREPARED, STARTED)


@dataclass(frozen=True)
class VirtualRun:
    """Result of a run: whether it succeeded and why, its metrics, its parts, and its duration
    [s]."""

    success: bool
    reason: str
    metrics: Mapping[str, Metric]
    parts: Mapping[str, BoundPart]
    duration_s: float


class _Time:
    """The virtual time [ns]."""

    def __init__(self) -> None:
        self.time = 1_000_000_000

    def now(self) -> int:
        return self.time

    def sleep(self, seconds: float) -> None:
        """Do nothing: ticks are events."""


class _Network:
    """Messages on their way; a part's transport hands them over."""

    def __init__(self, time: _Time, travel: Travel) -> None:
        self.time, self.travel = time, travel
        self.takers: dict[str, MessageCallback] = {}
        self.waiting: list[tuple[int, int, str, bytes]] = []
        self._count = 0

    def send(self, key: str, data: bytes) -> None:
        travel = self.travel(key, self.time.time)
        if travel is not None:
            self._count += 1
            heapq.heappush(self.waiting, (self.time.time + travel, self._count, key, data))

    def deliver(self) -> None:
        """Hand over the next message."""
        instant, _, key, data = heapq.heappop(self.waiting)
        self.time.time = instant
        take = self.takers.get(key)
        if take is not None:
            take(data)


class _VirtualTransport:
    """One part's end of the network."""

    is_open = True

    def __init__(self, network: _Network) -> None:
        self._network = network

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Do nothing."""

    def publisher(self, key: str) -> MessageCallback:
        return lambda data: self._network.send(key, data)

    def background_publisher(self, key: str) -> MessageCallback:
        return self.publisher(key)

    def before_close(self, call: Callable[[], None]) -> None:
        """Do nothing: this transport does not close."""

    def subscribe(self, key: str, take: MessageCallback) -> None:
        self._network.takers[key] = take

    def close(self) -> None:
        """Do nothing."""


def run_virtual(
    graph: CheckedGraph,
    travel: Travel,
    phases: Mapping[str, float] | None = None,
) -> VirtualRun:
    """Run a free-running graph for its duration, or until a block requests the end.

    Args:
        graph: with machines; its clock is ignored.
        travel: how long each message takes.
        phases: when the first tick of each machine is, as a share of a period; by default zero.

    Raises:
        AloftError: the graph names no machines, or a part fails.
    """
    placed = split_over_machines(graph)
    time = _Time()
    network = _Network(time, travel)
    parts = {
        machine.name: BoundPart(placed, machine.name, _VirtualTransport(network), clock=time.now)
        for machine in placed.machines
    }
    for name, part in parts.items():
        for other in part.peers.names:
            part.peers.assume_started(other, parts[other].peers.run)
        part.open_links()
        compile_calls(part.kernel_calls)
        assert name == part.machine
    blocks = [
        block for part in parts.values() for path, block in part.blocks.items()
        if path not in _RUNTIME
    ]  # fmt: skip
    try:
        for block in blocks:
            block.start()
        stopped = _go_through(graph, parts, network, time, phases or {})
    finally:
        for block in blocks:
            block.stop_cycle()
        for block in blocks:
            block.close()
    own: dict[str, Any] = {
        path: dict(block.metrics())
        for name, part in parts.items()
        for path, block in part.blocks.items()
        if path in [spec.path for spec in placed.blocks_on(name)]
    }
    metrics, unmet, success_reason = merge_metrics(own)
    reason = unmet or success_reason or stopped or "ran to its end"
    began = 1_000_000_000
    return VirtualRun(unmet is None, reason, metrics, parts, (time.time - began) * 1e-9)


def _go_through(
    graph: CheckedGraph, parts: Mapping[str, BoundPart], network: _Network, time: _Time,
    phases: Mapping[str, float],
) -> str:  # fmt: skip
    """Every tick and every message in the order of their instants; gives who ended the run, and why."""
    tickers = {
        name: Ticker(part, ClockSpec("free"), time, timing=False) for name, part in parts.items()
    }
    period = round(graph.base_period * 1e9)
    due = [
        (time.time + round(phases.get(name, 0.0) * period), number, name)
        for number, name in enumerate(parts)
    ]
    heapq.heapify(due)
    while due:
        # a message that comes at the instant of a tick is there
        while network.waiting and network.waiting[0][0] <= due[0][0]:
            network.deliver()
        instant, number, name = heapq.heappop(due)
        time.time = instant
        part = parts[name]
        tickers[name].advance(1)
        if part.clock.stop_reason is not None:
            return f"{name}: {part.clock.stop_reason}"
        if graph.ticks is None or part.clock.tick < graph.ticks:
            heapq.heappush(due, (instant + period, number, name))
    return ""
