"""Margins: narrower bounds in the problem, kept by the plan, and no change where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.margins import Margins, joint_bounds, unknown_joints
from aloft.planner.task.phase import Phase
from aloft.planner.task.read_task import contradictions
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
NAMES = [joint.name for joint in ROBOT.joints]
KNEES = [i for i, name in enumerate(NAMES) if name.endswith("knee")]


def test_joints_keep_their_distance_from_their_limits() -> None:
    bounds = joint_bounds(ROBOT, Margins(joints=0.1), landed=True)
    np.testing.assert_allclose(bounds - ROBOT.joint_limits, np.tile([0.1, -0.1], (10, 1)))


def test_limits_of_the_landing_hold_from_touchdown_on_and_on_both_sides() -> None:
    margins = Margins(landing_limits={"knee": (-9.0, -0.4)})
    before, after = (joint_bounds(ROBOT, margins, landed) for landed in (False, True))
    assert [i for i in range(10) if not np.array_equal(before[i], after[i])] == KNEES
    assert after[KNEES, 1].tolist() == [-0.4, -0.4]
    assert np.array_equal(after[KNEES, 0], before[KNEES, 0])


def test_a_joint_by_its_name() -> None:
    bounds = joint_bounds(ROBOT, Margins(landing_limits={"left_knee": (-2.0, -0.5)}), True)
    assert bounds[NAMES.index("left_knee")].tolist() == [-2.0, -0.5]
    assert bounds[NAMES.index("right_knee"), 1] > -0.5


def test_an_unknown_joint_is_named_with_the_nearest() -> None:
    assert unknown_joints(Margins(landing_limits={"knee": (-2, 0), "nee": (0, 1)}), NAMES) == [
        "nee"
    ]
    task = make_task(
        {
            "recipe": "paper",
            "name": "a",
            "rise": 0.1,
            "margins": {"landing_limits": {"nee": [-1.0, 0.0]}},
        }
    )
    assert contradictions(task, ROBOT)[0] == (
        "margins.landing_limits.nee", "bruce has no joint nee; the nearest is knee",
    )  # fmt: skip


def test_without_margins_the_hash_stays() -> None:
    plain = make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    assert "margins" not in plain.content()
    assert plain.hash(ROBOT) != make_task(
        {"recipe": "paper", "name": "a", "rise": 0.1, "margins": {}}
    ).hash(ROBOT)


def test_a_plan_keeps_them() -> None:
    wanted = {
        "squat_lean": 0.8, "landing_lean": 0.1, "joints": 0.05, "pressure": 0.2,
        "landing_limits": {"knee": [-2.1, -0.5]},
    }  # fmt: skip
    plan = solve_jump(
        make_task({"recipe": "paper", "name": "a", "rise": 0.09, "margins": wanted}), ROBOT
    )
    assert check_plan(plan, ROBOT).explain() == ""
    phases = plan.phase
    before = np.arange(len(phases)) <= int(np.argmax(phases == Phase.FLIGHT))
    after = np.arange(len(phases)) >= int(np.argmax(phases == Phase.LANDING))
    lean = np.abs(2.0 * np.arctan2(plan.position[:, 4], plan.position[:, 6]))
    assert lean[before].max() == pytest.approx(0.8, abs=1e-3)
    assert lean[after].max() <= 0.1 + 1e-6
    assert plan.position[after][:, [7 + i for i in KNEES]].max() <= -0.5 + 1e-6
    stands = plan.contact.all(axis=1)
    feet = plan.contact_force[stands][:, :, 2].reshape(-1, 2, 2)
    share = feet.min(axis=2) / np.maximum(feet.sum(axis=2), 1e-9)
    assert share.min() >= 0.2 - 1e-4


@pytest.mark.long
def test_a_plan_hits_the_ground_no_faster_than_it_may() -> None:
    jump = {
        "recipe": "paper", "name": "a", "rise": 0.09, "impact": True, "weights": {"impulse": 1e-6}
    }  # fmt: skip
    free = solve_jump(make_task(jump), ROBOT)
    names = {test.name for test in check_plan(free, ROBOT).tests}
    assert not names & {"touchdown_speed", "touchdown_slide"}
    wanted = {"touchdown_speed": 0.4, "touchdown_slide": 0.1}
    plan = solve_jump(make_task({**jump, "margins": wanted}), ROBOT)
    report = check_plan(plan, ROBOT)
    assert report.explain() == ""
    found = {test.name: test.value for test in report.tests}
    assert found["touchdown_speed"] == pytest.approx(0.4, abs=0.01)
    assert found["touchdown_slide"] <= 0.11
    faster = make_task({**jump, "margins": {"touchdown_speed": 0.2}})
    assert "touchdown_speed" in check_plan(replace(plan, task=faster), ROBOT).explain()


def test_a_plan_leaves_the_ground_no_slower_than_it_may() -> None:
    jump = {"recipe": "paper", "name": "a", "rise": 0.09}
    free = solve_jump(make_task(jump), ROBOT)
    lift_off = int(np.argmax(free.phase == Phase.FLIGHT))
    speed = float(free.com_velocity[lift_off, 2])
    wanted = round(speed + 0.1, 3)
    faster = make_task({**jump, "margins": {"lift_off_speed": wanted}})
    assert "lift_off_speed" in check_plan(replace(free, task=faster), ROBOT).explain()
    plan = solve_jump(faster, ROBOT)
    assert check_plan(plan, ROBOT).explain() == ""
    lift_off = int(np.argmax(plan.phase == Phase.FLIGHT))
    assert plan.com_velocity[lift_off, 2] == pytest.approx(wanted, abs=1e-4)


def test_the_landing_has_the_tasks_effort_unless_the_margins_say_another() -> None:
    asked = {"name": "a", "rise": 0.1, "effort": 0.8}
    assert make_task({**asked, "margins": None}).landing_effort == 0.8
    assert make_task({**asked, "margins": {"pressure": 0.1}}).landing_effort == 0.8
    assert make_task({**asked, "margins": {"landing_effort": 0.95}}).landing_effort == 0.95
