"""A study's cells: every graph with every arm and every case of every axis, checked.

Overrides are applied in this order, and a later one wins: the study's ``set``, the task's, those of
the axes in their order, the arm's, and at last what tuning found for the arm. The files of
``include``, such as a trial, come before the graph's own includes.
"""

from __future__ import annotations

import hashlib
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..files.nodes import Entry, from_plain, plain, text_of
from ..files.problems import Code, LoadError, Position, Problem, Problems, Report
from ..runtime.graph import Graph
from ..runtime.language.stages import CheckedGraph
from ..runtime.loading import checked_file, checked_text
from .study import Arm, Axis, Coordinate, Study, StudyTask

Tuned = Mapping[str, Mapping[str, Any]]
"""Tuned parameters by arm."""


@dataclass(frozen=True)
class Cell:
    """One graph with its overrides, to be run once a seed."""

    task: str
    arm: str
    labels: Mapping[str, str]
    """Labels by axis, ``task`` and ``arm`` among them."""
    coordinates: Mapping[str, Coordinate]
    """Coordinates by the column of each axis of the grid."""
    graph: Path
    include: tuple[Path, ...]
    sets: Mapping[str, Entry]
    origin: Path
    """The study's file, for which the graph is put together."""
    behind: tuple[Path, ...] = ()
    """The files that follow the graph."""
    base: Mapping[str, Entry] | None = None
    """Overrides before a draw was made, which all draws share."""
    key: str = ""
    """Hash of everything that decides the outcome but the seed; set once the cell is checked."""

    @property
    def overrides(self) -> dict[str, Any]:
        """The overrides as plain data."""
        return {key: plain(entry.value) for key, entry in self.sets.items()}

    def with_sets(self, values: Mapping[str, Any], where: Position) -> Cell:
        """Return the cell with further overrides, which are at one place."""
        more = {key: Entry(key, where, from_plain(value, where)) for key, value in values.items()}
        return replace(self, sets={**self.sets, **more})


@dataclass(frozen=True)
class Job:
    """The data that another process needs to make one run of a cell."""

    graph: str
    include: tuple[str, ...]
    origin: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    behind: tuple[str, ...] = ()
    drawn: Mapping[str, Any] = field(default_factory=dict)
    """Overrides after all others; runs that differ in nothing else may share their beginning."""


def cells(study: Study, tuned: Tuned | None = None, common: Sequence[Entry] = ()) -> Iterator[Cell]:
    """Yield every cell, by task, then by arm, then by the axes with the last one fastest.

    ``common`` is applied after the study's ``set`` and before all other overrides.
    """
    where = Position("the tuned parameters", 0, 0)
    for task, arm in itertools.product(study.tasks, study.arms):
        for cases in itertools.product(*(axis.cases for axis in study.axes)):
            cell = _cell(study, common, task, arm, dict(zip(study.axes, cases, strict=True)))
            yield cell.with_sets((tuned or {}).get(arm.name, {}), where)


def _cell(
    study: Study, common: Sequence[Entry], task: StudyTask, arm: Arm, cases: Mapping[Axis, Any]
) -> Cell:
    entries = [*study.sets, *common, *task.sets]
    entries += [entry for case in cases.values() for entry in case.sets]
    return Cell(
        task.name,
        arm.name,
        {"task": task.name, "arm": arm.name, **{a.name: c.label for a, c in cases.items()}},
        {axis.column: case.value for axis, case in cases.items()},
        task.path,
        study.include,
        {entry.key: entry for entry in (*entries, *arm.sets)},
        study.path,
        arm.include,
    )


def checked_cells(
    found: Iterable[Cell],
    study: Study,
    fingerprint: str,
    on_cell: Callable[[], None] = lambda: None,
) -> list[Cell]:
    """Return the cells with their keys.

    Raises:
        LoadError: some graph may not run with its overrides; the report has all problems of all cells, with the
            study's own places where an override is wrong.
    """
    good: list[Cell] = []
    problems: dict[Problem, None] = {}
    known: dict[str, str] = {}
    for cell in found:
        on_cell()
        try:
            graph = load_cell(cell.graph, cell.include, cell.sets, cell.origin, cell.behind).checked
        except LoadError as error:
            problems.update(dict.fromkeys(error.report.problems))
            continue
        seeded = Graph(graph).seed_parameters
        if not seeded:
            task = next(task for task in study.tasks if task.name == cell.task)
            add = Problems()
            add.add(
                Code.MISSING_KEY, f"graph {task.path} has no parameter called 'seed'", task.where,
                at=task.name, expected="a block whose parameter 'seed' makes runs differ",
                fix="noise: {use: blocks.WhiteNoise, with: {std: 0.1, seed: 0}}",
            )  # fmt: skip
            problems.update(dict.fromkeys(add.report("").problems))
            continue
        good.append(replace(cell, key=_key(graph, fingerprint, known)))
    if problems:
        ordered = tuple(sorted(problems, key=lambda problem: problem.where))
        raise LoadError(Report(str(study.path), ordered))
    return good


def load_cell(
    graph: Path,
    include: Sequence[Path],
    overrides: Mapping[str, Any],
    origin: Path,
    behind: Sequence[Path] = (),
) -> Graph:
    """Load the graph between files that it includes, with a cell's overrides. Raises ``LoadError``."""
    if not include and not behind:
        return Graph(checked_file(graph, overrides))
    files = [os.path.relpath(file, origin.parent) for file in (*include, graph, *behind)]
    return Graph(checked_text(f"include: {text_of(files)}\n", origin, overrides))


def seeded_graph(work: Job) -> Graph:
    """Load the graph of one run: that of its cell, with the seed in all of its parameters for
    seeds.

    Raises:
        LoadError: the graph cannot be loaded.
    """
    graph, origin = Path(work.graph), Path(work.origin)
    include, behind = ([Path(file) for file in files] for files in (work.include, work.behind))
    overrides = {**work.overrides, **work.drawn}
    seeds = load_cell(graph, include, overrides, origin, behind).seed_parameters
    seeded = {**overrides, **dict.fromkeys(seeds, work.seed)}
    return load_cell(graph, include, seeded, origin, behind)


def job(cell: Cell, seed: int) -> Job:
    """Return a run of the cell, for another process."""
    base = cell.sets if cell.base is None else cell.base
    drawn = {k: plain(each.value) for k, each in cell.sets.items() if base.get(k) is not each}
    return Job(
        str(cell.graph.absolute()),
        tuple(str(file.absolute()) for file in cell.include),
        str(cell.origin.absolute()),
        {key: plain(entry.value) for key, entry in base.items()},
        seed,
        tuple(str(file.absolute()) for file in cell.behind),
        drawn,
    )


def _key(graph: CheckedGraph, fingerprint: str, known: dict[str, str]) -> str:
    """Hash the flattened graph and every file that a parameter names."""
    digest = hashlib.sha256(f"{fingerprint}\n{graph.text}".encode())
    for spec in graph.blocks:
        module = getattr(spec.block_type, "__module__", "")
        if not module.startswith(__package__.partition(".")[0] + "."):
            digest.update(_content(_source(spec.block_type), known).encode())
        for name in _texts(spec.params.model_dump(mode="json")):
            if len(name) < 200 and "\n" not in name and "\0" not in name:
                digest.update(_content(spec.folder / name, known).encode())
    return digest.hexdigest()[:24]


def _source(block_type: type) -> Path:
    """Return the file that somebody else's block is written in."""
    import sys

    module = sys.modules.get(block_type.__module__)
    return Path(getattr(module, "__file__", None) or "nowhere")


def _content(path: Path, known: dict[str, str]) -> str:
    """Return the hash of a file's content; empty where there is no such file."""
    shown = str(path)
    if shown not in known:
        is_file = bool(path.name) and path.is_file()
        known[shown] = hashlib.sha256(path.read_bytes()).hexdigest() if is_file else ""
    return known[shown]


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(item)
