"""The plans that come with aloft: one for every shipped task, of that very task, and valid."""

import json
from pathlib import Path
from typing import Any

import pytest
from tests.robots.example_robots import INSTALLED

from aloft.extensions.hopping.blocks.speed_plan import row_lengths, row_task
from aloft.planner.checking.validity import check_plan
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.task.plan import read_plan
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.graph import load

TASKS = sorted((SHIPPED.parent / "tasks").glob("*.yaml"))
REHEARSED = sorted((SHIPPED / "rehearsed").glob("*.json"))
REMEDY = "run: make plans"


def test_there_are_the_basic_tasks() -> None:
    names = {path.stem for path in TASKS}
    assert {"in_situ", "forward_10cm", "back_10cm", "side_10cm", "twist_30deg"} <= names
    assert {"step_up_5cm", "step_down_5cm"} <= names
    assert {"hops_10", "hops_forward_10", "hops_rough_10", "up_and_down"} <= names


@pytest.mark.parametrize("path", TASKS, ids=[path.stem for path in TASKS])
def test_every_task_has_its_valid_plan(path: Path, tmp_path: Path) -> None:
    if "robot:" in path.read_text() and not INSTALLED:
        pytest.skip("the robot's URDF is in the package example-robot-data, which is not installed")
    task = read_task(path)
    robot = find_robot(task.robot)
    plan = PlanLibrary(robot, tmp_path).find(task)
    assert plan is not None, f"{path.name} has changed or is new, and has no plan; {REMEDY}"
    report = check_plan(plan, robot)
    assert report.valid, f"{report.explain()}\nthe planner or the check has changed; {REMEDY}"
    assert plan.valid, "the file says so itself"


@pytest.mark.parametrize("path", REHEARSED, ids=[path.stem.partition("-")[0] for path in REHEARSED])
def test_what_was_rehearsed_is_of_the_shipped_plan_and_controller(path: Path) -> None:
    task = path.stem.partition("-")[0]
    graph = load(SHIPPED.parent / "jump.yaml", {"plan.task": f"tasks/{task}.yaml"})
    learnt = json.loads(path.read_text())
    used: Any = graph.checked.block("targets").params
    remedy = "the plan or the controller has changed since the rehearsal; " + REMEDY
    assert list(used.velocity_correction) == learnt["velocity_correction"], remedy
    assert list(used.momentum_correction) == learnt["momentum_correction"], remedy


def test_the_rows_that_hop_on_mixes_are_shipped(tmp_path: Path) -> None:
    """So that the graph runs without a solver, and to the same bytes everywhere."""
    params: Any = load("aloft:hopping/hop_on").checked.block("plan").params
    robot = find_robot("bruce")
    for way in row_lengths(params):
        assert PlanLibrary(robot, tmp_path).find(row_task(params, "bruce", way)) is not None, REMEDY


def test_no_plan_is_there_without_its_task() -> None:
    if not INSTALLED:
        pytest.skip("some robots' URDFs are in the package example-robot-data: not installed")
    tasks = [read_task(path) for path in TASKS]
    wanted = {task.hash(find_robot(task.robot)) for task in tasks}
    stale = [p.name for p in SHIPPED.glob("*.npz") if p.stem.rpartition("-")[2] not in wanted]
    assert stale == [], f"plans of tasks that are no more; {REMEDY}"


def test_the_remedy_is_one_command_that_makes_them_all() -> None:
    """What the messages above say is there, makes every task anew, and removes what is stale."""
    makefile = (SHIPPED.parents[1] / "Makefile").read_text()
    rule = makefile.partition("\nplans: ")[2].partition("\n\n")[0]
    command = rule.splitlines()[1]
    for part in ("graphs/tasks/*.yaml", "--anew", "--prune", "--keep graphs/plans"):
        assert part in command


def test_every_plan_names_what_made_it() -> None:
    for path in SHIPPED.glob("*.npz"):
        plan = read_plan(path)
        assert plan.statistics["violation"] <= 1e-6
        assert "casadi" in plan.versions
