"""Fills a plan library with a grid of tasks, on all cores or on a cluster.

A run that is killed loses only the plans under way.

name: forward
task: {rise: 12 cm}
grid:
  distance_x: [0 cm, 5 cm, 10 cm]
  rise: {from: 8 cm, to: 16 cm, count: 5}
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...planner.library.library import PlanLibrary, solve_and_check
from ...planner.task.files import Key, LocatedFile, read_located, remove_abandoned, write_whole
from ...planner.task.plan import PlanFileError, PlannedJump
from ...planner.task.task import JumpTask, JumpTaskError, make_task
from ...robots.description import RobotDescription, find_robot
from ...runtime.language.errors import AloftError
from .jobs import job_results

MOST = 10_000
"""Values on one axis of a grid."""


@dataclass(frozen=True)
class GridRow:
    """One task of a grid and its result: ``kept`` (it was there already), ``planned``,
    ``failed`` (and why), or ``known`` to have failed before."""

    task: JumpTask
    outcome: str
    reason: str = ""
    path: Path | None = None


def read_grid(path: str | Path) -> list[JumpTask]:
    """Read the tasks of a grid file, the last parameter changing fastest.

    Raises:
        JumpTaskError: the file cannot be read, or one of its tasks is wrong.
    """
    path = Path(path)
    source = read_located(path, "grid: {rise: [10 cm, 15 cm]}")
    data, axes = source.values, source.values.get("grid")
    for key in data:
        if key not in ("name", "task", "grid"):
            place = source.place([key], key=True)
            raise JumpTaskError(f"{place}: {key}: expected only name, task and grid")
    if not isinstance(axes, Mapping) or not axes:
        raise JumpTaskError(
            f"{source.place(['grid'])}: expected the keys name, task and grid, e.g. "
            "'grid: {rise: [10 cm, 15 cm]}'"
        )
    common = data.get("task") or {}
    if not isinstance(common, Mapping):
        raise JumpTaskError(f"{source.place(['task'])}: task: expected a mapping, found {common!r}")
    values = [_values(source, key, given) for key, given in axes.items()]
    tasks = []
    for numbers in itertools.product(*(range(len(column)) for column in values)):
        given = {key: values[k][n] for k, (key, n) in enumerate(zip(axes, numbers, strict=True))}
        label = "_".join(f"{key}_{value}" for key, value in given.items())
        point = _Point(
            source.file, source.values, source.tree, dict(zip(axes, numbers, strict=True))
        )
        name = f"{data.get('name', path.stem)}_{label}"
        tasks.append(make_task({**common, **given, "name": name}, source=point))
    return tasks


@dataclass(frozen=True)
class _Point(LocatedFile):
    """The position of the values of one task of a grid: in its list on an axis, or under ``task``."""

    numbers: Mapping[str, int]

    def place(self, keys: Sequence[Key], *, key: bool = False) -> str:
        number = self.numbers.get(str(keys[0]))
        inside = ("task", *keys) if number is None else ("grid", keys[0])
        if number is not None and not key:
            inside = (*inside, number)
        return super().place(inside, key=key)


def _values(source: LocatedFile, key: str, given: Any) -> list[Any]:
    """Return the values of one parameter of a grid."""
    if isinstance(given, list) and given:
        return given
    if isinstance(given, Mapping) and set(given) == {"from", "to", "count"}:
        start, end = (_number(source, key, given, which) for which in ("from", "to"))
        if isinstance(given["count"], int) and 2 <= given["count"] <= MOST:
            # Rounded, so that the hash of a task does not hang on the last bit of a step.
            return [round(float(x), 9) for x in np.linspace(start, end, given["count"])]
    raise JumpTaskError(
        f"{source.place(['grid', key])}: grid.{key}: expected a list of values or "
        f"{{from: .., to: .., count: ..}} with a count of 2 to {MOST}, found {given!r}"
    )


def _number(source: LocatedFile, key: str, given: Mapping[str, Any], which: str) -> float:
    """Return an end of an axis in the unit of the task's parameter of that name."""
    others = {} if key in ("rise", "take_off_speed") else {"rise": 0.1}
    where = f"{source.place(['grid', key, which])}: {which}"
    task = make_task({"name": "grid", **others, key: given[which]}, where=where)
    value = getattr(task, key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise JumpTaskError(f"{where}: {key}: no number, so give a list of values")
    return float(value)


def fill(
    tasks: Sequence[JumpTask],
    library: PlanLibrary,
    *,
    workers: int = 0,
    cluster: str | None = None,
    again: bool = False,
) -> Generator[GridRow, None, None]:
    """Plan every task that has no plan yet. The rows come in the order in which they are done.

    ``workers`` and ``cluster`` are those of ``jobs.job_results``. Each task is planned without the
    help of other plans, so a plan's file has the same bytes whatever was planned before, by any
    number of workers. A plan is kept as soon as it is done, so a run that is killed loses only the
    tasks under way. A task that cannot be planned leaves a ``.failed`` file with the reason and is
    not tried ``again`` unless that is asked for; one whose process died does not, and is tried next
    time.
    """
    remove_abandoned(library.folder)
    there, pending = library.hashes(), []
    for task in tasks:
        key = task.hash(library.robot)
        kept = _found(library, task) if key in there else None
        known = None if again else read_failure(failure_mark(library, task))
        if kept is not None and kept.valid:
            yield GridRow(task, "kept", path=library.path_of(task))
        elif known is not None:
            yield GridRow(task, "known", known)
        else:
            pending.append(task)
    jobs = [(task, library.robot) for task in pending]
    with closing(job_results(plan_one, jobs, workers=workers, cluster=cluster)) as results:
        for result in results:
            task = pending[result.index]
            if result.error:
                yield GridRow(task, "failed", result.error)
            else:
                yield _keep(library, task, *result.value)


def _found(library: PlanLibrary, task: JumpTask) -> PlannedJump | None:
    """Return the plan that is kept of a task. One whose file is damaged counts as none: this run
    makes it anew."""
    try:
        return library.find(task)
    except PlanFileError:
        return None


def _keep(library: PlanLibrary, task: JumpTask, plan: PlannedJump | None, reason: str) -> GridRow:
    """Keep the plan of a task, or the reason why there is none."""
    mark = failure_mark(library, task)
    if plan is None:
        data = {"task": task.model_dump(mode="json"), "reason": reason}
        write_whole(mark, json.dumps(data).encode())
        return GridRow(task, "failed", reason)
    path = library.add(plan)
    mark.unlink(missing_ok=True)
    return GridRow(task, "planned", path=path)


def failure_mark(library: PlanLibrary, task: JumpTask) -> Path:
    """Return the path of the file that says that a task could not be planned."""
    return library.folder / f"{task.hash(library.robot)}.failed"


def read_failure(mark: Path) -> str | None:
    """Return the reason why a task could not be planned; ``None`` if there is no such file or it
    cannot be read."""
    try:
        return str(json.loads(mark.read_text(encoding="utf-8"))["reason"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def plan_one(job: tuple[JumpTask, RobotDescription]) -> tuple[PlannedJump | None, str]:
    """Plan one task in a worker. Returns the plan, or nothing and the reason."""
    try:
        return solve_and_check(*job), ""
    except AloftError as error:
        return None, str(error)


def robot_of(tasks: Sequence[JumpTask]) -> RobotDescription:
    """Return the robot of all tasks. Raises ``JumpTaskError`` where they name several."""
    names = sorted({task.robot for task in tasks})
    if len(names) != 1:
        raise JumpTaskError(f"a grid is for one robot, found {', '.join(names)}")
    return find_robot(names[0])
