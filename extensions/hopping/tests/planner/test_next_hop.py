"""Plans of hops are valid, are what was asked for, and follow from the request alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.extensions.hopping.planner import correction
from aloft.extensions.hopping.planner.hop_plans import samples_of_hops
from aloft.extensions.hopping.planner.hop_request import HopRequest
from aloft.extensions.hopping.planner.next_hop import HopPlanner
from aloft.extensions.hopping.planner.plan_outcome import PlanOutcome
from aloft.planner.checking.validity import require_valid
from aloft.planner.task.plan import plan_bytes
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
PLANNER = HopPlanner(
    ROBOT, samples_of_hops(find_robot("bruce")), samples_of_hops(find_robot("bruce"), steps=True)
)


@pytest.mark.long
def test_a_plan_is_valid_and_does_not_depend_on_those_before() -> None:
    wanted = HopRequest(0.17, -0.06, math.radians(-20.0))
    first = PLANNER.plan(wanted)
    assert (first.outcome, first.done) == (PlanOutcome.PLANNED, wanted)
    require_valid(first.plan, ROBOT)
    assert first.plan.com[-1, :2] == pytest.approx([0.17, -0.06], abs=0.02)
    PLANNER.plan(HopRequest(-0.05, 0.1, 0.3))
    again = PLANNER.plan(wanted)
    assert plan_bytes(first.plan) == plan_bytes(again.plan)


@pytest.mark.long
@pytest.mark.parametrize("up", [0.045, -0.045])
def test_a_plan_up_or_down_lands_at_its_height(up: float) -> None:
    wanted = HopRequest(0.2, 0.02, 0.1, up)
    found = PLANNER.plan(wanted)
    assert (found.outcome, found.done) == (PlanOutcome.PLANNED, wanted)
    require_valid(found.plan, ROBOT)
    assert found.plan.com[-1, 2] - found.plan.com[0, 2] == pytest.approx(up, abs=3e-3)


@pytest.mark.long
def test_where_the_motion_between_plans_leads_to_none_one_near_the_nearest_is_looked_for() -> None:
    found = PLANNER.plan(HopRequest(-0.0909, -0.1334, 0.3953))
    assert found.outcome in (PlanOutcome.PLANNED, PlanOutcome.NEAREST)
    require_valid(found.plan, ROBOT)


@pytest.mark.long
@pytest.mark.parametrize(
    "wanted", [HopRequest(0.2, 0.0, 0.0), HopRequest(-0.25, 0.1, 0.4), HopRequest(0.0, -0.2, -0.6)]
)
def test_a_robot_with_four_points_for_feet_hops_too(wanted: HopRequest) -> None:
    robot = find_robot("go2")
    found = HopPlanner(robot, samples_of_hops(find_robot("go2")), None).plan(wanted)
    assert (found.outcome, found.done) == (PlanOutcome.PLANNED, wanted)
    require_valid(found.plan, robot)


@pytest.mark.long
def test_without_plans_up_and_down_all_jumps_are_level() -> None:
    planner = HopPlanner(ROBOT, samples_of_hops(find_robot("bruce")), None)
    found = planner.plan(HopRequest(0.2, 0.0, 0.0, 0.05))
    assert (found.outcome, found.done) == (PlanOutcome.NEAREST, HopRequest(0.2, 0.0, 0.0))


@pytest.mark.long
def test_where_the_solver_does_not_end_a_stored_plan_is_followed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(correction, "STEPS", 1)
    found = PLANNER.plan(HopRequest(0.17, -0.06, -0.3))
    assert found.outcome == PlanOutcome.UNSOLVED
    assert np.abs(np.array(found.done) - [0.17, -0.06, -0.3, 0.0]).max() < 0.3
    require_valid_but_for_rounding(found.plan)


def require_valid_but_for_rounding(plan) -> None:
    """The stored plans are in single precision, and were checked before that."""
    from aloft.planner.checking.validity import check_plan

    report = check_plan(plan, ROBOT)
    assert all(test.value <= 1.1 * test.limit + 1e-4 for test in report.failed), report.explain()
