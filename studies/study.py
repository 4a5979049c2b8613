"""The data of a study whose file has been read, with the place of every override in the file.

study -> cells (one graph with its overrides, see ``expansion``) -> runs (a cell and a seed).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..files.nodes import Entry
from ..files.problems import Position

FIRST_REPORT_SEED = 1000
"""Gains are tuned on the seeds below, and reported on those from here on."""

Coordinate = float | int | str | bool
"""A run's position on an axis."""


@dataclass(frozen=True)
class Case:
    """One value of an axis: its label, its value in the table, and the overrides that it sets."""

    label: str
    value: Coordinate
    sets: tuple[Entry, ...]


@dataclass(frozen=True)
class Axis:
    """One dimension of the grid; ``column`` is its name in the table, with the unit."""

    name: str
    column: str
    unit: str
    cases: tuple[Case, ...]
    where: Position


@dataclass(frozen=True)
class Range:
    """The range of a tuned parameter.

    ``bounds`` has (low, high) for every number of the value, uniform or, with ``log``, uniform in
    the logarithm; or ``choices`` are all that it may be.
    """

    key: str
    where: Position
    bounds: tuple[tuple[float, float], ...] = ()
    scalar: bool = True
    unit: str = ""
    log: bool = False
    choices: tuple[object, ...] = ()


@dataclass(frozen=True)
class Arm:
    """One of the variants that are compared: settings, files that follow every graph, and its parameters that
    may be tuned."""

    name: str
    sets: tuple[Entry, ...] = ()
    ranges: tuple[Range, ...] = ()
    include: tuple[Path, ...] = ()


@dataclass(frozen=True)
class StudyTask:
    """One graph of the study, with its name and its overrides."""

    name: str
    path: Path
    where: Position
    sets: tuple[Entry, ...] = ()


@dataclass(frozen=True)
class CellFilter:
    """The labels that a cell may have on some axes, ``task`` and ``arm`` among them."""

    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def takes(self, labels: Mapping[str, str]) -> bool:
        """Tell whether the filter includes a cell with these labels."""
        return all(labels[axis] in allowed for axis, allowed in self.labels.items())


@dataclass(frozen=True)
class Goal:
    """The success rate that the cells of a filter should reach."""

    rate: float
    cells: CellFilter = CellFilter()


@dataclass(frozen=True)
class Tuning:
    """Random search with the same effort for every arm."""

    seeds: tuple[int, ...]
    draws: int
    seed: int = 0
    cells: CellFilter = CellFilter()
    sets: tuple[Entry, ...] = ()
    least: str = ""
    """Between draws of the same number of successes, the one whose mean of this metric is less."""
    race: bool = False
    """True to stop draws that can no longer win."""


@dataclass(frozen=True)
class MarginTerm:
    """A metric of the margin: 1 where it has its ``best`` value, 0 at its ``limit``, linear between."""

    metric: str
    best: float
    limit: float


@dataclass(frozen=True)
class Falsification:
    """Search for the worst case in ranges of parameters."""

    draws: int
    ranges: tuple[Range, ...]
    margin: tuple[MarginTerm, ...]
    seeds: tuple[int, ...] = ()
    """Seeds of every draw; empty for the study's."""
    seed: int = 0
    cells: CellFilter = CellFilter()
    sets: tuple[Entry, ...] = ()
    smallest: str = ""
    """The parameter of whose values that fail the least is searched."""


@dataclass(frozen=True)
class Plot:
    """One picture; see ``plots``."""

    name: str
    kind: str
    title: str = ""
    x: str = ""
    y: str = "rate"
    lines: str = "arm"
    panels: str = ""
    angle: str = ""
    radius: str = ""
    level: float = 0.95
    cells: CellFilter = CellFilter()


@dataclass(frozen=True)
class Study:
    """The whole content of a study's file."""

    name: str
    path: Path
    title: str
    tasks: tuple[StudyTask, ...]
    include: tuple[Path, ...]
    seeds: tuple[int, ...]
    sets: tuple[Entry, ...] = ()
    arms: tuple[Arm, ...] = (Arm("default"),)
    axes: tuple[Axis, ...] = ()
    goals: tuple[Goal, ...] = ()
    tuning: Tuning | None = None
    falsification: Falsification | None = None
    plots: tuple[Plot, ...] = ()

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Every name that a filter or a plot may use."""
        return ("task", "arm", *(axis.name for axis in self.axes))

    def labels_of(self, axis: str) -> tuple[str, ...]:
        """Return the labels of an axis, in order."""
        if axis == "task":
            return tuple(task.name for task in self.tasks)
        if axis == "arm":
            return tuple(arm.name for arm in self.arms)
        return tuple(c.label for a in self.axes if a.name == axis for c in a.cases)

    def axis(self, name: str) -> Axis | None:
        """Return the axis of the grid called ``name``."""
        return next((axis for axis in self.axes if axis.name == name), None)
