"""Context of a block: the run and the graph it is in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription


class Clock:
    """The time of a run: the present tick, the duration of a tick [s], and how the run is paced
    (the ``kind`` of its ``ClockSpec``)."""

    def __init__(self, base_period: float, tick: int = 0) -> None:
        self.base_period = base_period
        self.present: NDArray[np.int64] = np.array([tick], np.int64)
        """The present tick, (1,), where kernels read it."""
        self.stop_reason: str | None = None
        self.kind = "free"
        self.stopped_by = ""
        """The path of the block that asked for the end of the run."""
        self.began = 0
        """Time at which the present tick began, by the run's source of time [ns]; zero if ticks are
        not timed."""
        self.command_limit = 0.0
        """Longest silence allowed to the links that bring commands [s]; zero where none is
        watched."""

    @property
    def tick(self) -> int:
        """The present tick."""
        return self.present.item()

    @tick.setter
    def tick(self, tick: int) -> None:
        self.present[0] = tick

    def commands_heard(self) -> int:
        """Return the time of the last commands on the most silent link that brings them, by the
        monotonic clock [ns]; zero where no such link is watched."""
        return 0


@dataclass(frozen=True)
class Context:
    """Context of a block in its graph.

    ``period_ticks`` and ``offset_ticks`` say in which base ticks the block runs. ``dimensions``
    holds the sizes of all dimensions that the block can use, and ``wired`` names its wired inputs.
    ``folder`` is the folder of the graph file that has the block in it: files that a parameter
    names are relative to it. ``graph_folder`` is the folder of the graph that was loaded, beside
    which users keep their modules. ``duration`` is that of a run as the graph gives it [s]; it is
    known to ``requires`` only, and ``None`` where the graph gives none.

    During ``exported_values``, and only then, ``asked`` names the values that other blocks ask for, and
    ``graph`` has the entry of every block in the flattened graph, by its path: ``use``, ``with``,
    ``in`` and what else it has.
    """

    path: str
    clock: Clock
    period_ticks: int = 1
    offset_ticks: int = 0
    dimensions: Mapping[str, int] = field(default_factory=dict)
    robot: RobotDescription | None = None
    wired: tuple[str, ...] = ()
    folder: Path = Path()
    graph_folder: Path = Path()
    duration: float | None = None
    asked: frozenset[str] = frozenset()
    graph: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def period(self) -> float:
        """The seconds between two runs of the block."""
        return self.clock.base_period * self.period_ticks
