"""Runs all parts of a placed graph in the threads of one process, in lockstep and in virtual time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.errors import AloftError
from ..language.stages import CheckedGraph
from ..links.part import BoundPart, MergedLayout, hash_of, run_part
from ..placement.place import place
from ..placement.placed import PlacedGraph
from ..running.run_result import RunResult
from ..running.sinks import Sink
from ..transports.hub import Hub

Interfere = Callable[[str, bytes], Iterable[bytes]]


@dataclass(frozen=True)
class SpreadRun:
    """What the parts of a run gave, by machine."""

    placed: PlacedGraph
    results: Mapping[str, RunResult]
    parts: Mapping[str, BoundPart]

    @property
    def ticks(self) -> int:
        """How many ticks all parts have recorded."""
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
) -> SpreadRun:
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
        place(graph), hub, ticks=ticks, prepare=prepare, timeout=timeout, wall_time=wall_time,
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
) -> SpreadRun:
    """As ``run_spread``, with a hub and with sinks for each machine."""
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
    return SpreadRun(placed, {name: results[name] for name in parts}, parts)
