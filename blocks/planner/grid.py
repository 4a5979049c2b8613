"""Filling a library with a grid of tasks, on all cores or on a cluster; losing nothing if killed.

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
import yaml

from ...runtime.description import RobotDescription, find_robot
from ...runtime.errors import AloftError
from ...runtime.jobs import job_results
from .library import PlanLibrary, solve_and_check
from .plan import JumpPlan
from .task import JumpTask, TaskError, make_task
from .whole_file import remove_abandoned, write_whole


@dataclass(frozen=True)
class GridRow:
    """One task of a grid and what came of it: ``kept`` (it was there already), ``planned``,
    ``failed`` (and why), or ``known`` to have failed before."""

    task: JumpTask
    outcome: str
    reason: str = ""
    path: Path | None = None


def read_grid(path: str | Path) -> list[JumpTask]:
    """The tasks of a grid file, the last parameter changing fastest.

    Raises:
        TaskError: the file cannot be read, or one of its tasks is wrong.
    """
    path = Path(path)
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TaskError(f"cannot read {path}: {error.strerror or error}") from error
    except yaml.YAMLError as error:
        raise TaskError(f"{path} is not YAML: {error}") from error
    if not isinstance(data, Mapping) or not isinstance(data.get("grid"), Mapping):
        raise TaskError(
            f"{path}: expected the keys name, task and grid, e.g. 'grid: {{rise: ...}}'"
        )
    extra = sorted(set(data) - {"name", "task", "grid"})
    if extra:
        raise TaskError(f"{path}: {', '.join(extra)}: expected only name, task and grid")
    common = dict(data.get("task") or {})
    axes = {key: _values(path, key, given) for key, given in data["grid"].items()}
    tasks = []
    for point in itertools.product(*axes.values()):
        given = dict(zip(axes, point, strict=True))
        label = "_".join(f"{key}_{value}" for key, value in given.items())
        name = f"{data.get('name', path.stem)}_{label}"
        tasks.append(make_task({**common, **given, "name": name}, where=f"{path}: {label}"))
    return tasks


def _values(path: Path, key: str, given: Any) -> list[Any]:
    """The values of one parameter of a grid."""
    if isinstance(given, list) and given:
        return given
    if isinstance(given, Mapping) and set(given) == {"from", "to", "count"}:
        start, end = (_number(path, key, given[which]) for which in ("from", "to"))
        if isinstance(given["count"], int) and given["count"] >= 2:
            # Rounded, so that the hash of a task does not hang on the last bit of a step.
            return [round(float(x), 9) for x in np.linspace(start, end, given["count"])]
    raise TaskError(
        f"{path}: grid.{key}: expected a list of values or {{from: .., to: .., count: ..}}, "
        f"found {given!r}"
    )


def _number(path: Path, key: str, value: Any) -> float:
    """A quantity in the unit of the task's parameter of that name."""
    task = make_task({"name": "grid", "flight_time": 0.3, key: value}, where=f"{path}: grid")
    return float(getattr(task, key))


def fill(
    tasks: Sequence[JumpTask],
    library: PlanLibrary,
    *,
    workers: int = 0,
    cluster: str | None = None,
    again: bool = False,
) -> Generator[GridRow, None, None]:
    """Plan every task that has no plan yet; rows come in the order in which they are done.

    ``workers`` and ``cluster`` are those of ``runtime.jobs``. Each task is planned from nothing,
    so a plan's file has the same bytes whatever was planned before it, by whom and by how many. It
    is kept at once when it is done, so a run that is killed loses only what it was working on. A
    task that cannot be planned leaves a ``.failed`` file with the reason and is not tried
    ``again`` unless that is asked for; one whose process died does not, and is tried next time.
    """
    remove_abandoned(library.folder)
    there, pending = library.hashes(), []
    for task in tasks:
        key = task.hash(library.robot)
        kept = library.find(task) if key in there else None
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


def _keep(library: PlanLibrary, task: JumpTask, plan: JumpPlan | None, reason: str) -> GridRow:
    """Write down what came of a task."""
    mark = failure_mark(library, task)
    if plan is None:
        data = {"task": task.model_dump(mode="json"), "reason": reason}
        write_whole(mark, json.dumps(data).encode())
        return GridRow(task, "failed", reason)
    path = library.add(plan)
    mark.unlink(missing_ok=True)
    return GridRow(task, "planned", path=path)


def failure_mark(library: PlanLibrary, task: JumpTask) -> Path:
    """Where it is written that a task could not be planned."""
    return library.folder / f"{task.hash(library.robot)}.failed"


def read_failure(mark: Path) -> str | None:
    """Why a task could not be planned; ``None`` where nothing is written, or not readably."""
    try:
        return str(json.loads(mark.read_text(encoding="utf-8"))["reason"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def plan_one(job: tuple[JumpTask, RobotDescription]) -> tuple[JumpPlan | None, str]:
    """Plan one task in a worker: the plan, or nothing and why."""
    try:
        return solve_and_check(*job), ""
    except AloftError as error:
        return None, str(error)


def robot_of(tasks: Sequence[JumpTask]) -> RobotDescription:
    """The robot of all tasks. Raises ``TaskError`` where they name several."""
    names = sorted({task.robot for task in tasks})
    if len(names) != 1:
        raise TaskError(f"a grid is for one robot, found {', '.join(names)}")
    return find_robot(names[0])
