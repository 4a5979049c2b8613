"""Held joints that take part: arms raise a jump, keep clear of the body, come back, and the check knows all of it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from tests.robots.limbed_robots import CORNERS, HUMANOID, STANDING, TWO, Y, legged_robot

from aloft.planner.checking.evidence import arm_clearance_deficit
from aloft.planner.checking.validity import check_plan
from aloft.planner.models.link_shapes import arms, moving_shapes
from aloft.planner.problem.arm_range import arm_ranges
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import Capsule, RobotDescription
from aloft.robots.kinematics import link_poses

LIMITS = [-3.0, 3.0]


def _armed() -> RobotDescription:
    """A biped of 14 kg with two arms of 1 kg, which its description holds; they hang, and would pass through a
    head in front of their shoulders if they swung up all the way."""
    shoulders = [
        (f"{side}_arm", [0.0, y, 0.3], Y, LIMITS) for side, y in (("left", 0.2), ("right", -0.2))
    ]
    robot = legged_robot(
        "armed", HUMANOID, [0.03, 0.0, -0.03], CORNERS, STANDING[1], TWO, shoulders,
        held={"left_arm": 0.0, "right_arm": 0.0},
    )  # fmt: skip
    arm = Capsule(start=(0.0, 0.0, -0.1), end=(0.0, 0.0, -0.4), radius=0.04)
    bar = Capsule(start=(-0.05, -0.2, 0.6), end=(-0.05, 0.2, 0.6), radius=0.05)
    return robot.changed(
        links=tuple(
            link.model_copy(update={"com": (0.0, 0.0, -0.25), "mass": 1.0, "shapes": (arm,)})
            if link.name.endswith("_arm_link")
            else link.model_copy(update={"shapes": (bar,)}) if link.name == robot.base else link
            for link in robot.links
        )
    )  # fmt: skip


ROBOT = _armed()
ARM = [joint.name for joint in ROBOT.joints].index("left_arm")


def asked(rise: float, **more: object) -> JumpTask:
    knots = {"squat": 6, "thrust": 8, "flight": 6, "landing": 8}
    return make_task({"recipe": "paper", "name": "high", "rise": rise, "knots": knots, **more})


@lru_cache(maxsize=2)
def planned(rise: float, moving: tuple[str, ...] = ("*_arm",)) -> PlannedJump:
    more = {"moving": list(moving)} if moving else {}
    return solve_jump(asked(rise, **more), ROBOT)


@pytest.mark.long  # the solvers try everything before they give up
def test_arms_reach_what_the_same_legs_cannot() -> None:
    with pytest.raises(PlanError) as error:
        planned(0.3, ())
    assert error.value.family == "apex"
    assert check_plan(planned(0.3), ROBOT).figures["rise_m"] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.long
def test_for_the_same_momentum_the_legs_do_less_when_arms_swing() -> None:
    """Twin arms swing alike, up before the feet leave, so that the legs need not be as fast."""
    still, swings = planned(0.1, ()), planned(0.1)
    assert swings.statistics["coordinates"] == "sagittal"
    left = swings.position[:, 7 + ARM]
    assert left == pytest.approx(swings.position[:, 8 + ARM], abs=1e-9)
    assert np.ptp(left) > 1.0 and not np.ptp(still.position[:, 7 + ARM])
    legs, speeds, rises = slice(6, 6 + ARM), list[float](), list[float]()
    for plan in (still, swings):
        rises.append(check_plan(plan, ROBOT).figures["rise_m"])
        speeds.append(float(np.abs(plan.velocity[plan.time <= plan.lift_off_time, legs]).max()))
    assert rises == pytest.approx([0.1, 0.1], abs=2e-3)
    assert speeds[1] < 0.8 * speeds[0]


def test_arms_come_back_and_the_check_says_so_where_they_do_not() -> None:
    plan = planned(0.1)
    assert plan.position[-1, 7 + ARM] == pytest.approx(0.0, abs=1e-6)
    assert not {"end", "arm_clearance"} & {test.name for test in check_plan(plan, ROBOT).failed}
    position = plan.position.copy()
    position[-1, 7 + ARM] = 0.01
    report = check_plan(replace(plan, position=position), ROBOT)
    assert "end" in {test.name for test in report.failed}


def test_every_pose_in_the_range_is_clear_and_a_wider_range_is_not() -> None:
    freed = ROBOT.freed(["*_arm"])
    ranges = arm_ranges(freed, 0.02)
    assert set(ranges) == {ARM, ARM + 1} and not arm_ranges(ROBOT, 0.02)
    low, high = ranges[ARM]
    assert LIMITS[0] < low < -1.0 and 1.0 < high < LIMITS[1]

    def lack(angle: float) -> float:
        joints = np.tile(freed.standing_position, (2, 1))
        joints[1, ARM] = angle
        poses = link_poses(freed, np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)), joints)
        found = arm_clearance_deficit(freed, moving_shapes(freed, poses), 0.02)
        assert found is not None and found[1] == "left_arm_link at base"
        return float(found[0][1])

    assert max(lack(low), lack(high)) <= 0.0 < min(lack(low - 0.1), lack(high + 0.1))


def test_arms_are_limbs_that_move_and_have_no_foot() -> None:
    assert arms(ROBOT) == []
    assert arms(ROBOT.freed(["*_arm"])) == [["left_arm_link"], ["right_arm_link"]]
