"""The plan library: what is kept is found by its task alone, and only valid plans are kept."""

from __future__ import annotations

import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.library.library import (
    SHIPPED,
    PlanLibrary,
    find_task,
    kept_name,
    shipped_folder,
    shipped_tasks,
    task_distance,
)
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import InvalidPlanError, PlanFileError, PlannedJump, write_plan
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import RobotDescription, find_robot

ROBOT = find_robot("bruce")
IN_SITU = read_task(SHIPPED.parent / "tasks" / "in_situ.yaml")


class Planner:
    """Stands in for the solver: gives the plan it has, under the task that is asked for."""

    def __init__(self, plan: PlannedJump | None, fails_warm: bool = False) -> None:
        self.plan = plan
        self.fails_warm = fails_warm
        self.started_from: list[str | None] = []

    def __call__(
        self, task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
    ) -> PlannedJump:
        self.started_from.append(warm_start.task.name if warm_start else None)
        if self.plan is None or (self.fails_warm and warm_start is not None):
            raise PlanError("no plan", family="apex")
        return replace(self.plan, task=task.resolved(robot))


@pytest.fixture(scope="module")
def good() -> PlannedJump:
    plan = PlanLibrary(ROBOT, Path("nowhere")).find(IN_SITU)
    assert plan is not None
    return plan


def near(name: str = "near", **values: object) -> JumpTask:
    """A task whose plan of 15 cm in place is valid too."""
    return make_task({"name": name, "rise": 0.1503, **values}).resolved(ROBOT)


def test_a_kept_plan_needs_no_solver(tmp_path: Path, good: PlannedJump) -> None:
    solver = Planner(None)
    plan, kept = PlanLibrary(ROBOT, tmp_path).plan(IN_SITU, solver)
    assert kept and solver.started_from == []
    np.testing.assert_array_equal(plan.position, good.position)
    assert list(tmp_path.iterdir()) == [], "a shipped plan is not copied"


def test_what_is_not_there_is_solved_from_the_nearest_and_kept(
    tmp_path: Path, good: PlannedJump
) -> None:
    library, solver = PlanLibrary(ROBOT, tmp_path), Planner(good)
    plan, kept = library.plan(near(), solver)
    assert not kept and solver.started_from == ["in_situ"]
    assert plan.valid and plan.report["tests"]
    again, kept = library.plan(near("another name"), solver)
    assert kept and solver.started_from == ["in_situ"], "a name decides nothing"
    assert again.task == near()
    assert [path.name for path in tmp_path.iterdir()] == [kept_name(near(), ROBOT)]


def test_a_replaced_file_is_read_again(tmp_path: Path, good: PlannedJump) -> None:
    library = PlanLibrary(ROBOT, tmp_path, ())
    path = library.add(replace(good, task=near().resolved(ROBOT)))
    assert [task.rise for _, task in library.tasks()] == [0.1503]
    write_plan(path, replace(good, task=near(rise=0.16).resolved(ROBOT)))
    assert [task.rise for _, task in library.tasks()] == [0.16]


def test_a_warm_start_that_fails_is_tried_from_nothing(tmp_path: Path, good: PlannedJump) -> None:
    solver = Planner(good, fails_warm=True)
    PlanLibrary(ROBOT, tmp_path).plan(near(), solver)
    assert solver.started_from == ["in_situ", None]


def test_anew_starts_from_nothing(tmp_path: Path, good: PlannedJump) -> None:
    solver = Planner(good)
    _, kept = PlanLibrary(ROBOT, tmp_path).plan(IN_SITU, solver, anew=True)
    assert not kept and solver.started_from == [None]


def test_a_plan_that_is_not_valid_is_never_kept(tmp_path: Path, good: PlannedJump) -> None:
    with pytest.raises(InvalidPlanError, match="rise: how far the apex") as caught:
        PlanLibrary(ROBOT, tmp_path).plan(
            make_task({"recipe": "paper", "name": "high", "rise": 0.2}), Planner(good)
        )
    assert not caught.value.plan.valid
    assert list(tmp_path.iterdir()) == []


def test_a_kept_plan_that_is_not_valid_is_not_handed_over(
    tmp_path: Path, good: PlannedJump
) -> None:
    library, task = (
        PlanLibrary(ROBOT, tmp_path),
        make_task({"recipe": "paper", "name": "high", "rise": 0.2}),
    )
    library.add(replace(good, task=task, report={"valid": True}))
    with pytest.raises(InvalidPlanError, match="'high' is not valid"):
        library.plan(task, Planner(good))


def test_what_an_older_version_kept_for_the_user_is_planned_anew_where_it_is_not_valid(
    tmp_path: Path, good: PlannedJump, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    library = PlanLibrary(ROBOT)
    path = library.add(replace(good, task=near(), position=good.position + 0.01))
    plan, kept = library.plan(near(), Planner(good))
    assert not kept and library.path_of(near()) == path
    np.testing.assert_array_equal(plan.position, good.position)
    assert library.plan(near(), Planner(None))[1], "the new one is kept"


def test_a_damaged_file_is_an_error_that_names_it(tmp_path: Path, good: PlannedJump) -> None:
    library = PlanLibrary(ROBOT, tmp_path, others=())
    path = library.add(replace(good, task=near()))
    whole = path.read_bytes()
    path.write_bytes(whole[:5000])
    with pytest.raises(PlanFileError, match=rf"{path.name} is no plan file.*remove it to have"):
        library.find(near())
    rng = np.random.default_rng(0)
    for _ in range(150):  # nothing but that error, whatever is changed
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= int(rng.integers(1, 256))
        path.write_bytes(data)
        with suppress(PlanFileError):
            library.find(near())
        list(library.tasks())
    path.write_bytes(whole[:5000])
    assert library.nearest(near()) is None
    assert list(library.tasks()) == []


def test_a_shipped_plan_wins_over_a_cached_one(
    tmp_path: Path, good: PlannedJump, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shipped = PlanLibrary(ROBOT, tmp_path / "shipped", others=())
    first = shipped.add(replace(good, task=near()))
    library = PlanLibrary(ROBOT, others=(tmp_path / "shipped",))
    cached = library.add(replace(good, task=near()))
    assert cached.is_relative_to(tmp_path / "cache")
    assert library.path_of(near()) == first
    chosen = PlanLibrary(ROBOT, cached.parent, others=(tmp_path / "shipped",))
    assert chosen.path_of(near()) == cached  # a folder that somebody has named


def test_the_nearest_is_by_scaled_distance(tmp_path: Path, good: PlannedJump) -> None:
    library = PlanLibrary(ROBOT, tmp_path, others=())
    assert library.nearest(near()) is None
    for name, values in (("far", {"distance_x": 0.3}), ("close", {"twist": 0.2})):
        library.add(replace(good, task=near(name, **values)))
    found = library.nearest(near(twist=0.3))
    assert found is not None
    assert found[0].task.name == "close"
    assert found[1] == pytest.approx(0.2)


def test_tasks_that_differ_in_kind_have_no_distance() -> None:
    base = near()
    assert task_distance(base, near("other")) == 0.0
    some, more = near(effort=0.9), near(rise=0.2003, effort=0.9)
    assert task_distance(some, more) == pytest.approx(1.0)
    assert task_distance(base, near(formulation="paper")) is None
    assert task_distance(base, near(knots={"flight": 30})) is None
    assert task_distance(base, near(flight_time=0.3)) is None


def test_another_robot_finds_nothing(tmp_path: Path) -> None:
    other = ROBOT.model_copy(update={"text": "another"})
    shutil.copytree(SHIPPED, tmp_path / "plans")
    assert PlanLibrary(other, tmp_path / "plans").find(IN_SITU) is None


def test_pruning_leaves_the_tasks_that_are_named(tmp_path: Path, good: PlannedJump) -> None:
    library = PlanLibrary(ROBOT, tmp_path)
    kept, gone = (library.add(replace(good, task=near(rise=rise))) for rise in (0.1501, 0.1502))
    (tmp_path / "notes.txt").write_text("mine")
    assert library.prune([near(rise=0.1501)]) == [gone]
    assert sorted(path.name for path in tmp_path.iterdir()) == [kept.name, "notes.txt"]
    assert library.find(IN_SITU) is not None, "other folders are left alone"


def test_the_shipped_folder_has_tasks_and_plans():
    assert (shipped_folder() / "tasks" / "in_situ.yaml").is_file()
    assert "tasks/in_situ.yaml" in shipped_tasks()
    assert list((shipped_folder() / "plans").glob("*.npz"))


def test_the_folders_given_come_first(tmp_path):
    assert find_task("tasks/in_situ.yaml", tmp_path).parent == shipped_folder() / "tasks"
    (tmp_path / "tasks").mkdir()
    own = tmp_path / "tasks" / "in_situ.yaml"
    own.write_text("rise: 5 cm\n")
    assert find_task("tasks/in_situ.yaml", tmp_path) == own


def test_a_task_that_is_nowhere_is_refused(tmp_path):
    with pytest.raises(LookupError, match=r"no task 'mine.yaml' beside the graph or among the sh"):
        find_task("mine.yaml", tmp_path)


@pytest.mark.parametrize("place", ["file", "folder"])
def test_a_plan_that_others_may_write_is_not_even_begun_from(
    place: str, good: PlannedJump, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    library = PlanLibrary(ROBOT)
    path = library.add(replace(good, task=near()))
    task = near()

    def known() -> tuple[bool, ...]:
        nearest = library.nearest(task)
        assert nearest is not None
        return (
            library.find(task) is not None, nearest[0].task.name == "near",
            task.hash(ROBOT) in library.hashes(), path in [found for found, _ in library.tasks()],
        )  # fmt: skip

    assert known() == (True, True, True, True)
    changed = path if place == "file" else path.parent
    changed.chmod(changed.stat().st_mode | 0o022)
    assert known() == (False, False, False, False)
