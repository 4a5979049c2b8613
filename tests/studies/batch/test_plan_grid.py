"""Filling a library: the grid's tasks, what is kept at once, and what a second run skips."""

from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aloft.planner.library import library
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import JumpTask, JumpTaskError, make_task
from aloft.robots.description import RobotDescription, find_robot
from aloft.studies.batch import plan_grid as grid
from aloft.studies.batch.jobs import JobResult, attempt
from aloft.studies.batch.plan_grid import fill, read_grid, robot_of

ROBOT = find_robot("bruce")


class Here:
    """Does the jobs in this process, one after another."""

    def __init__(self) -> None:
        self.done = 0

    def __call__(
        self, work: Callable[[Any], Any], jobs: Iterable[Any], **where: Any
    ) -> Generator[JobResult, None, None]:
        for index, job in enumerate(jobs):
            self.done += 1
            yield JobResult(index, *attempt(work, job))


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Here:
    made = Here()
    monkeypatch.setattr(grid, "job_results", made)
    return made


@pytest.fixture
def solver(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Plans of 15 cm in place stand in for the solver; lists the names it was asked for."""
    asked: list[str] = []
    kept = PlanLibrary(ROBOT, Path("nowhere")).find(
        read_task(SHIPPED.parent / "tasks/in_situ.yaml")
    )
    assert kept is not None

    def solve(
        task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
    ) -> PlannedJump:
        asked.append(task.name)
        assert warm_start is None, "what is in a library must not depend on the order"
        if task.rise is not None and task.rise > 0.2:
            raise PlanError("no plan: apex is missed", family="apex")
        return replace(kept, task=task.resolved(robot))

    monkeypatch.setattr(library, "solve_task", solve)
    return asked


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "hops.yaml"
    path.write_text(text)
    return path


def test_the_tasks_of_a_grid(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "task: {friction: 0.6}\n"
        "grid:\n  distance_x: [0 cm, 5 cm]\n  rise: {from: 8 cm, to: 0.12, count: 3}\n",
    )
    tasks = read_grid(path)
    assert [(t.distance_x, t.rise) for t in tasks] == [
        (0.0, 0.08), (0.0, 0.1), (0.0, 0.12), (0.05, 0.08), (0.05, 0.1), (0.05, 0.12),
    ]  # fmt: skip
    assert {t.friction for t in tasks} == {0.6}
    assert len({t.name for t in tasks}) == 6
    assert robot_of(tasks) == ROBOT


def test_a_grid_is_for_one_robot() -> None:
    tasks = [
        make_task({"name": "a", "rise": 0.1}),
        make_task({"name": "b", "rise": 0.1, "robot": "x"}),
    ]
    with pytest.raises(JumpTaskError, match="a grid is for one robot, found bruce, x"):
        robot_of(tasks)


def test_plans_are_kept_failures_are_remembered_and_a_second_run_skips_both(
    tmp_path: Path, solver: list[str], here: Here
) -> None:
    rises = {"a": 0.1501, "b": 0.1502, "high": 0.3, "wrong": 0.16}
    tasks = [make_task({"name": name, "rise": rise}) for name, rise in rises.items()]
    kept = PlanLibrary(ROBOT, tmp_path, others=())
    first = {row.task.name: row for row in fill(tasks, kept)}
    assert {name: row.outcome for name, row in first.items()} == {
        "a": "planned", "b": "planned", "high": "failed", "wrong": "failed",
    }  # fmt: skip
    assert "apex is missed" in first["high"].reason
    assert "rise: how far the apex" in first["wrong"].reason, "invalid plans are not kept"
    assert len(list(tmp_path.glob("*.npz"))) == 2
    here.done = 0
    second = {row.task.name: row.outcome for row in fill(tasks, kept)}
    assert second == {"a": "kept", "b": "kept", "high": "known", "wrong": "known"}
    assert here.done == 0
    assert {row.outcome for row in fill(tasks, kept, again=True)} == {"kept", "failed"}
    assert here.done == 2


def test_a_run_that_is_cut_off_has_kept_what_was_done(
    tmp_path: Path, solver: list[str], here: Here
) -> None:
    tasks = [make_task({"name": f"t{k}", "rise": 0.1501 + k * 1e-5}) for k in range(4)]
    kept = PlanLibrary(ROBOT, tmp_path, others=())
    rows = fill(tasks, kept)
    next(rows)
    next(rows)
    rows.close()
    assert len(list(tmp_path.glob("*.npz"))) == 2
    outcomes = sorted(row.outcome for row in fill(tasks, kept))
    assert outcomes == ["kept", "kept", "planned", "planned"]
    assert not list(tmp_path.glob(".*")), "no half-written file is left"


def test_a_task_whose_process_died_is_tried_next_time(
    tmp_path: Path, solver: list[str], here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dead(*_: Any, **__: Any) -> Generator[JobResult, None, None]:
        yield JobResult(0, None, "its process was killed by SIGKILL, 2 times")

    tasks, kept = [make_task({"name": "a", "rise": 0.1501})], PlanLibrary(ROBOT, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(grid, "job_results", dead)
        (row,) = fill(tasks, kept)
    assert (row.outcome, row.reason) == ("failed", "its process was killed by SIGKILL, 2 times")
    assert [row.outcome for row in fill(tasks, kept)] == ["planned"]


def test_torn_files_count_as_none(tmp_path: Path, solver: list[str], here: Here) -> None:
    tasks = [make_task({"name": "a", "rise": 0.1501}), make_task({"name": "high", "rise": 0.3})]
    kept = PlanLibrary(ROBOT, tmp_path, others=())
    list(fill(tasks, kept))
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert [row.outcome for row in fill(tasks, kept)] == ["planned", "failed"]
    assert [row.outcome for row in fill(tasks, kept)] == ["kept", "known"]
