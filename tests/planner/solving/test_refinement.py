"""A plan whose intervals are too long is solved again on finer ones."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.validity import InvalidPlanError, checked
from aloft.planner.library.library import solve_and_check
from aloft.planner.solving.refinement import asks_for_finer, curable, finer_knots
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.plan import JumpPlan
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
HIGH = make_task({"recipe": "paper", "name": "high", "rise": 0.2})


def failing(plan: JumpPlan, *tests: tuple[str, float, float]) -> JumpPlan:
    rows = [{"name": n, "value": v, "limit": a, "passed": False} for n, v, a in tests]
    return plan.with_report({"valid": False, "tests": rows, "figures": {}})


@pytest.mark.parametrize(
    ("tests", "expected"),
    [
        ([("flight_position", 1.2e-3, 1e-3)], True),
        ([("flight_position", 1.2e-3, 1e-3), ("motor_torque", 0.4, 0.3)], True),
        ([("flight_position", 1.2e-3, 1e-3), ("friction", 0.4, 0.01)], False),
        ([("flight_position", 0.5, 1e-3)], False),
        ([], False),
    ],
)
def test_what_finer_intervals_may_cure(
    by_hand: JumpPlan, tests: list[tuple[str, float, float]], expected: bool
) -> None:
    assert curable(failing(by_hand, *tests)) is expected


def test_only_a_failed_plan_of_that_very_task_asks_for_finer(by_hand: JumpPlan) -> None:
    failed = failing(replace(by_hand, task=HIGH), ("flight_position", 2e-3, 1e-3))
    assert asks_for_finer(HIGH, failed)
    assert asks_for_finer(HIGH.model_copy(update={"name": "other"}), failed)
    assert not asks_for_finer(make_task({"recipe": "paper", "name": "low", "rise": 0.1}), failed)
    assert not asks_for_finer(HIGH, replace(by_hand, task=HIGH))
    assert not asks_for_finer(HIGH, None)


def test_a_high_jump_is_valid_on_the_grid_it_needs() -> None:
    coarse = checked(solve_jump(HIGH, ROBOT), ROBOT)
    assert not coarse.valid
    plan = solve_and_check(HIGH, ROBOT)
    assert plan.valid
    assert plan.task.hash(ROBOT) == HIGH.hash(ROBOT)
    knots = finer_knots(coarse)
    assert knots.flight == 42
    assert plan.statistics["knots"] == knots.total + 1 == len(plan.time)
    error = [report["figures"]["flight_error_mm"] for report in (plan.report, coarse.report)]
    assert error[0] < 0.6 * error[1]


@pytest.mark.parametrize(
    "task",
    [
        {"rise": 0.1, "distance_x": 0.3},
        pytest.param({"rise": 0.15, "distance_y": 0.2}, marks=pytest.mark.long),
        pytest.param({"rise": 0.15, "twist": "60 deg"}, marks=pytest.mark.long),
    ],
)
def test_the_reach_of_the_real_actuators(task: dict[str, Any]) -> None:
    plan = solve_and_check(make_task({"recipe": "paper", "name": "far", **task}), ROBOT)
    assert plan.valid
    assert plan.statistics["violation"] <= 1e-6


def test_an_invalid_plan_is_not_refined_without_end(by_hand: JumpPlan) -> None:
    calls = []

    def make(task: Any, robot: Any, start: JumpPlan | None) -> JumpPlan:
        calls.append(start)
        bent = by_hand.position.copy()
        bent[len(bent) // 2, 0] += 2e-3
        return replace(by_hand, task=by_hand.task, position=bent)

    with pytest.raises(InvalidPlanError):
        solve_and_check(by_hand.task, ROBOT, None, make)
    assert len(calls) <= 3


def test_a_plan_on_another_grid_is_a_start() -> None:
    first = make_task({"recipe": "paper", "name": "low", "rise": 0.14})
    fine = solve_jump(first, ROBOT, knots=finer_knots(solve_jump(first, ROBOT)))
    warm = solve_jump(
        make_task({"recipe": "paper", "name": "near", "rise": 0.15}), ROBOT, warm_start=fine
    )
    assert warm.statistics["warm"]
    assert len(warm.time) < len(fine.time)
    cold = solve_jump(make_task({"recipe": "paper", "name": "near", "rise": 0.15}), ROBOT)
    assert np.abs(warm.com - cold.com).max() < 2e-3
