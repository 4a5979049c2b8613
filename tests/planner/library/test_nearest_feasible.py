"""The search for the nearest task that can be planned: what it tries, finds, says and costs."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aloft.planner.library import nearest_feasible as module
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.nearest_feasible import (
    candidates,
    continuation_path,
    nearest_feasible,
    seconds_left,
    values_towards,
)
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import RobotDescription, find_robot

ROBOT = find_robot("bruce")
TASK = make_task({"recipe": "paper", "name": "high", "rise": 0.4, "twist": 1.0})


class Planner:
    """Plans whatever a rule allows; keeps what it was asked and from where it started."""

    def __init__(self, allows: Callable[[JumpTask], bool]) -> None:
        self.allows = allows
        self.asked: list[JumpTask] = []
        self.warm: list[bool] = []
        found = PlanLibrary(ROBOT, Path("nowhere")).find(
            read_task(SHIPPED.parent / "tasks" / "in_situ.yaml")
        )
        assert found is not None
        self.plan = found

    def __call__(
        self, task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
    ) -> PlannedJump:
        self.asked.append(task)
        self.warm.append(warm_start is not None)
        if not self.allows(task):
            raise PlanError("no plan", family="apex")
        return replace(self.plan, task=task)


@pytest.fixture(autouse=True)
def _no_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands in for plans is valid."""

    def solved(task: JumpTask, robot: Any, warm: Any, solve: Any, *, refine: bool) -> PlannedJump:
        assert not refine, "a finer grid costs more than a value that is a step nearer"
        plan = solve(task, robot, warm)
        assert isinstance(plan, PlannedJump)
        return plan

    monkeypatch.setattr(module, "solve_and_check", solved)


def test_it_finds_the_last_round_value_that_can_be_planned() -> None:
    solve = Planner(lambda task: (task.rise or 0.0) < 0.2431)
    found = nearest_feasible(TASK, ROBOT, family="apex", solve=solve)
    assert found is not None
    assert (found.parameter, found.asked, found.value, found.beyond) == ("rise", 0.4, 0.24, 0.245)
    assert found.solves == len(solve.asked) <= 8
    assert found.plan.task.rise == 0.24
    assert found.text.startswith(
        "rise: 40 cm is beyond the robot; the nearest that can be planned is rise: 24 cm; 24.5 cm "
        "cannot; what binds: "
    )
    assert all(task.twist == 1.0 for task in solve.asked), "one parameter changes at a time"
    assert solve.warm == [False, *[True] * (found.solves - 1)]


def test_the_family_decides_what_is_tried_first() -> None:
    assert candidates(TASK, "apex") == ["rise", "twist"]
    assert candidates(TASK, "leg clearance") == ["twist", "rise"]
    side = make_task({"recipe": "paper", "name": "side", "rise": 0.15, "distance_y": 0.6})
    assert candidates(side, "") == ["distance_y", "rise"], "the furthest first"
    assert candidates(make_task({"recipe": "paper", "name": "hop", "rise": 0.08}), "") == []


def test_another_parameter_is_tried_where_the_first_does_not_help() -> None:
    solve = Planner(lambda task: task.twist < 0.5)
    found = nearest_feasible(TASK, ROBOT, family="apex", solve=solve)
    assert found is not None
    assert found.parameter == "twist"
    assert "twist: 28 deg; 30 deg cannot" in found.text


def test_values_come_from_both_sides_and_onto_a_step() -> None:
    low = make_task(
        {
            "recipe": "paper",
            "name": "low",
            "rise": 0.06,
            "landing_height": 0.03,
            "distance_x": -0.025,
        }
    )
    assert values_towards(low, "rise") == [0.11, 0.105, 0.1, 0.095, 0.09, 0.085, 0.08, 0.075, 0.07,
                                           0.065, 0.06]  # fmt: skip
    assert values_towards(low, "distance_x") == [0.0, -0.01, -0.02, -0.025]
    assert values_towards(low, "take_off_speed") == []
    assert values_towards(low, "friction") == []
    slippery = make_task({"recipe": "paper", "name": "ice", "rise": 0.1, "friction": 0.65})
    assert values_towards(slippery, "friction") == [0.7, 0.675, 0.65]


def test_onto_a_step_its_height_and_the_rise_change_together() -> None:
    asked = {"rise": 0.46, "distance_x": 0.2, "landing_height": 0.4}
    task = make_task({"recipe": "paper", "name": "onto a table", **asked})
    solve = Planner(lambda task: (task.rise or 0.0) < 0.3)
    found = nearest_feasible(task, ROBOT, solve=solve)
    assert found is not None
    ways = {found.parameter: (found.asked, found.value, found.beyond), **found.others}
    assert ways == {"rise": (0.46, 0.29, 0.31), "landing_height": (0.4, 0.22, 0.24)}
    assert found.plan.task.distance_x == 0.2
    assert found.text.startswith(
        "rise: 46 cm, landing_height: 40 cm together are beyond the robot; the nearest that can be "
        "planned is rise: 29 cm, landing_height: 22 cm; rise: 31 cm, landing_height: 24 cm cannot; "
        "what binds: "
    )


def test_where_no_single_parameter_helps_all_change_together() -> None:
    asked = {"rise": 0.5, "distance_x": 1.0, "twist": 2.0}
    task = make_task({"recipe": "paper", "name": "far", **asked})
    (way,) = continuation_path(task)
    assert way[0] == {"rise": 0.08, "distance_x": 0.0, "twist": 0.0}
    assert way[-1] == asked
    solve = Planner(lambda task: (task.rise or 0.0) < 0.3 and task.distance_x < 0.5)
    found = nearest_feasible(task, ROBOT, solve=solve)
    assert found is not None
    assert (found.parameter, found.value, found.beyond) == ("rise", 0.27, 0.29)
    assert set(found.others) == {"distance_x", "twist"}
    assert found.solves == len(solve.asked) <= module.MOST_SOLVES
    assert continuation_path(make_task({"recipe": "paper", "name": "high", "rise": 0.6})) == []


def test_a_task_that_took_long_leaves_less_time() -> None:
    assert [seconds_left(spent) for spent in (0.0, 4.0, 20.0)] == [6.0, 4.5, 2.0]


def test_the_search_is_bounded() -> None:
    solve = Planner(lambda _: False)
    odd = dict.fromkeys(("distance_x", "distance_y", "landing_height", "foot_clearance"), 0.3)
    task = make_task(
        {"recipe": "paper", "name": "odd", "rise": 1.0, "friction": 0.1, "effort": 0.2, **odd}
    )
    assert nearest_feasible(task, ROBOT, solve=solve) is None
    assert len(solve.asked) <= module.MOST_SOLVES
    solve = Planner(lambda _: True)
    found = nearest_feasible(TASK, ROBOT, solve=solve, seconds=0.0)
    assert found is not None
    assert (found.solves, found.value) == (1, 0.08)


def test_it_begins_where_a_kept_plan_of_a_similar_task_ends(tmp_path: Path) -> None:
    """A turn of 180 degrees at 20 cm is among the shipped plans."""
    task = make_task({"name": "round", "rise": 0.12, "twist": "360 deg"})
    library = PlanLibrary(ROBOT, tmp_path, (SHIPPED,))
    kept = library.farthest(task, "twist", 0.0)
    assert kept is not None
    assert (kept.task.rise, kept.task.twist) == pytest.approx((0.2, math.pi))
    solve = Planner(lambda asked: asked.twist < 3.2)
    found = nearest_feasible(task, ROBOT, solve=solve, library=library)
    assert found is not None
    degrees = [round(math.degrees(asked.twist)) for asked in solve.asked]
    assert degrees[:2] == [180, 202], "a longer step from a turn near the limits is not found"
    assert solve.warm[0]
    assert math.degrees(found.value) == pytest.approx(182.0)


def test_a_kept_plan_of_that_very_task_is_not_solved_again(tmp_path: Path) -> None:
    task = make_task({"name": "high", "rise": 0.6})
    solve = Planner(lambda _: False)
    found = nearest_feasible(
        task, ROBOT, solve=solve, library=PlanLibrary(ROBOT, tmp_path, (SHIPPED,))
    )
    assert found is not None
    assert (found.value, found.beyond) == (0.32, 0.325)
    assert all(asked.rise > 0.32 for asked in solve.asked)


@pytest.mark.parametrize(
    "values",
    [{"twist": "-360 deg"}, {"twist": "100 deg"}, {"rise": 0.4, "twist": "360 deg"},
     {"friction": 1.4, "twist": "360 deg", "weights": {"force": 0.5}}],
    ids=["the other way", "further than asked", "another height", "other weights"],
)  # fmt: skip
def test_a_kept_plan_of_another_task_says_nothing(values: dict[str, Any], tmp_path: Path) -> None:
    task = make_task({"name": "round", "rise": 0.15, **values})
    kept = PlanLibrary(ROBOT, tmp_path, (SHIPPED,)).farthest(task, "twist", 0.0)
    assert kept is None or 0.0 < kept.task.twist < math.radians(100.0) == task.twist


def test_from_what_a_kept_plan_cannot_help_with_it_begins_at_the_modest_value(
    tmp_path: Path,
) -> None:
    task = make_task({"name": "round", "rise": 0.12, "twist": "360 deg"})
    solve = Planner(lambda asked: asked.twist < 0.5)
    found = nearest_feasible(
        task, ROBOT, solve=solve, library=PlanLibrary(ROBOT, tmp_path, (SHIPPED,))
    )
    assert found is not None
    degrees = [round(math.degrees(asked.twist)) for asked in solve.asked]
    assert degrees[:3] == [180, 134, 0]
    assert found.value < 0.5


def test_where_a_kept_plans_value_is_beyond_this_task_three_quarters_of_it_are_tried(
    tmp_path: Path,
) -> None:
    task = make_task({"name": "round", "rise": 0.12, "twist": "360 deg"})
    solve = Planner(lambda asked: asked.twist < 2.7)
    found = nearest_feasible(
        task, ROBOT, solve=solve, library=PlanLibrary(ROBOT, tmp_path, (SHIPPED,))
    )
    assert found is not None
    degrees = [round(math.degrees(asked.twist)) for asked in solve.asked]
    assert degrees[:3] == [180, 134, 162]
    assert solve.warm[:2] == [True, True], "both start from the kept plan"


def test_with_little_time_left_three_quarters_of_a_kept_plans_value_come_first(
    tmp_path: Path,
) -> None:
    """A machine that is slow today finds what a fast one finds, if not as near."""
    task = make_task({"name": "round", "rise": 0.12, "twist": "360 deg"})
    solve = Planner(lambda asked: asked.twist < 2.7)
    found = nearest_feasible(
        task, ROBOT, solve=solve, seconds=seconds_left(20.0),
        library=PlanLibrary(ROBOT, tmp_path, (SHIPPED,)),
    )  # fmt: skip
    assert found is not None
    assert [round(math.degrees(asked.twist)) for asked in solve.asked][:2] == [134, 162]
