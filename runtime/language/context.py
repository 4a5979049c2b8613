"""What the runtime tells a block about the run and the graph it is in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...robots.description import RobotDescription


@dataclass
class Clock:
    """The time of a run: the present tick, the duration of a tick [s], and how the run is paced
    (the ``kind`` of its ``ClockSpec``)."""

    base_period: float
    tick: int = 0
    stop_reason: str | None = None
    kind: str = "free"
    stopped_by: str = ""
    """The path of the block that asked for the end of the run."""
    began: int = 0
    """When the present tick began, by the run's source of time [ns]; zero if ticks are not timed."""
    command_limit: float = 0.0
    """How long the links that bring commands may be silent [s]; zero where none is watched."""

    def commands_heard(self) -> int:
        """When the most silent link that brings commands last brought one, by the monotonic clock
        [ns]; zero where no such link is watched."""
        return 0


@dataclass(frozen=True)
class Context:
    """What the runtime tells a block about the graph it is in.

    ``period_ticks`` and ``offset_ticks`` say in which base ticks the block runs. ``dimensions``
    holds the sizes of all dimensions that the block can use, and ``wired`` names its wired inputs.
    ``folder`` is the folder of the graph file that has the block in it: files that a parameter
    names are relative to it. ``graph_folder`` is the folder of the graph that was loaded, beside
    which users keep their modules.

    While a block is asked what it ``tells``, and only then, ``graph`` has the entry of every block
    in the flattened graph, by its path: ``use``, ``with``, ``in`` and what else it has.
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
    graph: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def period(self) -> float:
        """The seconds between two runs of the block."""
        return self.clock.base_period * self.period_ticks
