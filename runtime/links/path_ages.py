"""Holds what a run has measured against the ages that a graph allows on paths (``links.paths``)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.block import Metric
from ..language.stages import CheckedGraph
from ..placement.age import LinkTimes, Timeline, measured_ages
from ..placement.placed import PlacedGraph
from ..running.memory import BoundGraph
from ..running.sink import Sink
from .free_link import TICK_TIME, health_path

MAX_TICKS = 20_000
"""The last ticks of a run that are looked at."""
JITTER_ALLOWANCE = 0.05
"""Allowance for the jitter of clocks, in base periods."""
NAME = "links.paths"
"""Name of the check among the blocks that give metrics."""


def path_sinks(graph: CheckedGraph, kind: str = "") -> list[PathAges]:
    """Return the sinks that check the ages of a run in one process, or in lockstep; none where no
    ages are limited, or where time is virtual. ``kind`` is that of the clock, by default the
    graph's."""
    virtual = (kind or graph.clock.kind) == "free"
    return [] if virtual or not graph.links.paths else [PathAges(graph)]


class PathAges(Sink):
    """The sink that keeps when ticks began, and judges at the end of the run.

    Args:
        graph: the whole graph.
    """

    name = NAME

    def __init__(self, graph: CheckedGraph) -> None:
        self._graph = graph
        self._began: NDArray[np.int64] = np.zeros(MAX_TICKS, np.int64)
        self._ticks: NDArray[np.int64] = np.zeros(MAX_TICKS, np.int64)
        self._count = 0

    def open(self, bound: BoundGraph) -> None:
        """Begin."""
        self._clock = bound.clock
        self._count = 0

    def record(self, tick: int) -> None:
        """Keep when the tick began."""
        place = self._count % MAX_TICKS
        self._ticks[place], self._began[place] = tick, self._clock.began or time.perf_counter_ns()
        self._count += 1

    def resume(self, tick: int) -> None:
        """Begin anew: the time of a pause is no age."""
        self._count = 0

    def metrics(self) -> Mapping[str, Metric]:
        """Return the ages, and whether they were allowed."""
        kept = min(self._count, MAX_TICKS)
        order = np.argsort(self._ticks[:kept])
        line = Timeline(self._ticks[:kept][order].tolist(), self._began[:kept][order].tolist())
        return check_path_ages(self._graph, {"": line})


def check_path_ages(graph: CheckedGraph, timelines: Mapping[str, Timeline]) -> dict[str, Metric]:
    """Return the median and the longest age [ms] of each path; and no success where one is too
    long."""
    found: dict[str, Metric] = {}
    complaints = []
    for path, limit in graph.links.paths.items():
        source, _, target = (part.strip() for part in path.partition("->"))
        ages = measured_ages(graph, timelines, source, target) * 1e3
        if not len(ages):
            complaints.append(f"no {source} came to {target}, so its age was not measured")
            continue
        found[f"age_p50_ms {path}"] = float(np.median(ages))
        found[f"age_max_ms {path}"] = float(ages.max())
        allowed = (limit + JITTER_ALLOWANCE * graph.base_period) * 1e3
        late = int(np.count_nonzero(ages > allowed))
        if late:
            complaints.append(
                f"{source} at {target} was up to {ages.max():.3g} ms old, at most "
                f"{limit * 1e3:.6g} ms are allowed; it was older {late} times of {len(ages)}"
            )
    if complaints:
        found |= {"success": False, "reason": "; ".join(complaints)}
    return found


def timeline_of(placed: PlacedGraph, machine: str, ticks: NDArray[Any], view: Any) -> Timeline:
    """Build the timeline of a part that ran free, from its recording.

    Args:
        placed: the graph.
        machine: of the part.
        ticks: (n,).
        view: gives the values of a field, (n,), by its name ``block.port.field``.
    """
    links = {}
    for link in placed.received_by(machine):
        path = f"{health_path(link)}.health"
        times = {name: view(f"{path}.{name}").tolist() for name in ("tick", "sent", "read")}
        age = np.rint(view(f"{path}.age") * 1e9).astype(np.int64).tolist()
        links[link.source] = LinkTimes(**times, age=age)
    return Timeline(ticks.tolist(), view(f"{TICK_TIME}.began.time").tolist(), links)
