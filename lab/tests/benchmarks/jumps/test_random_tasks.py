"""Tasks drawn by seed."""

import pytest

from aloft.lab.benchmarks.jumps import random_tasks as module
from aloft.lab.benchmarks.jumps.random_tasks import plan_one, random_rows, random_tasks
from aloft.planner.task.files import PlanError
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot


def test_a_seed_is_always_the_same_tasks() -> None:
    assert random_tasks(40, 3) == random_tasks(40, 3)
    assert random_tasks(40, 3) == random_tasks(60, 3)[:40]
    assert random_tasks(40, 3) != random_tasks(40, 4)


def test_every_kind_is_drawn_within_its_range() -> None:
    tasks = random_tasks(200, 1)
    kinds = {task.name.rpartition(" ")[0] for task in tasks}
    assert kinds == set(module._KINDS)
    assert all(0.04 <= (task.rise or 0.0) <= 0.22 for task in tasks)
    assert 0.40 < max(task.distance_x for task in tasks) <= 0.50
    assert -0.25 <= min(task.distance_x for task in tasks) < -0.15
    assert 0.20 < max(abs(task.distance_y) for task in tasks) <= 0.30
    assert 1.5 < max(abs(task.twist) for task in tasks) <= 2.1
    assert -0.35 <= min(task.landing_height for task in tasks) < -0.25
    assert 0.08 < max(task.landing_height for task in tasks) <= 0.12
    assert {task.profile for task in tasks} == {""}, "the one that the robot is used with"
    said = {name for task in tasks for name in task.model_fields_set}
    assert said == {"name", "rise", "distance_x", "distance_y", "twist", "landing_height"}


def test_harder_tasks_reach_farther() -> None:
    tasks = random_tasks(200, 1, harder=True)
    assert {task.name.rpartition(" ")[0] for task in tasks} == set(module._HARDER)
    assert 0.24 < max(task.rise or 0.0 for task in tasks) <= 0.26
    assert 0.58 < max(task.distance_x for task in tasks) <= 0.62
    assert -0.28 <= min(task.distance_x for task in tasks) < -0.26
    assert 0.31 < max(abs(task.distance_y) for task in tasks) <= 0.35
    assert any(task.twist and task.distance_y for task in tasks)
    assert max(abs(task.twist) for task in tasks if task.distance_x) > 1.9
    assert -0.30 <= min(task.landing_height for task in tasks) < -0.25
    assert random_tasks(8, 1, harder=True) == tasks[:8]


def test_what_fails_is_counted_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(task: object, robot: object) -> None:
        if getattr(task, "distance_y", 0.0) == 0.0 and getattr(task, "twist", 0.0) == 0.0:
            raise PlanError("no plan", family="apex")

    monkeypatch.setattr(module, "solve_and_check", solve)
    share, *_ = random_rows(16, 2)
    failed = [t for t in random_tasks(16, 2) if not t.distance_y and not t.twist]
    assert share.value == len(failed) / 16 > 0.0
    assert f"{failed[0].name} (apex)" in share.note
    assert share.met is False


@pytest.mark.long
def test_one_task_is_planned_and_checked() -> None:
    robot = find_robot("bruce")
    assert plan_one(random_tasks(1, 5)[0].model_copy(update={"twist": 0.0}), robot) == ""
    crooked = make_task({"name": "crooked", "rise": 0.1, "initial": {"right_ankle": 0.1}})
    assert plan_one(crooked, robot) == "stance"
