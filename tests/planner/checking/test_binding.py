"""The limits that prevent a larger jump: motors, joints and friction by what the plan does to them."""

from dataclasses import replace

import numpy as np
import pytest

from aloft.planner.checking.binding import _short, what_binds
from aloft.planner.checking.evidence import Evidence
from aloft.planner.checking.replay import replay
from aloft.planner.task.plan import JumpPlan
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.mark.parametrize(
    ("name", "short"),
    [
        ("left_knee_motor", "knee"),
        ("right_hip_pitch_joint", "hip pitch"),
        ("l_ankle", "ankle"),
        ("r_hip_roll", "hip roll"),
        ("waist_yaw_joint", "waist_yaw"),
        ("front_left_knee", "front_left_knee"),
        ("knee", "knee"),
    ],
)
def test_a_limit_is_named_without_the_side(name: str, short: str) -> None:
    assert _short(name) == short


def scaled(plan: JumpPlan, **task: object) -> JumpPlan:
    return replace(plan, task=plan.task.model_copy(update=task))


def test_a_plan_that_is_far_from_all_limits_reaches_none(by_hand: JumpPlan) -> None:
    limits = what_binds(scaled(by_hand, friction=50.0), ROBOT)
    assert "friction" not in limits
    evidence = Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))
    share = np.abs(evidence.motor_speed) / ROBOT.motors.no_load_speed
    fast = {
        _short(name) for name, most in zip(ROBOT.transmission.motors, share.max(axis=0), strict=True)
        if most > 0.985
    }  # fmt: skip
    assert {each.removesuffix(" motor speed") for each in limits if "speed" in each and "at" not in each} == fast  # fmt: skip


def test_less_friction_makes_friction_a_limit_and_the_last_one(by_hand: JumpPlan) -> None:
    force = by_hand.contact_force
    loaded = force[:, :, 2] > 1.0
    used = (np.hypot(force[:, :, 0], force[:, :, 1])[loaded] / force[:, :, 2][loaded]).max()
    # the planner's pyramid lies inside of the cone, so its edges count
    for share, binds in ((0.97, False), (1.03, True)):
        friction = used * np.sqrt(2.0) / 0.985 / share
        limits = what_binds(scaled(by_hand, friction=float(friction)), ROBOT)
        assert ("friction" in limits) == binds
        assert not binds or limits[-1] == "friction"


def test_less_effort_makes_motors_a_limit_the_more_the_less(by_hand: JumpPlan) -> None:
    evidence = Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))
    middle = evidence.middles
    torque = np.abs(evidence.motor_torque[middle]) / ROBOT.motors.peak_torque
    strongest = _short(ROBOT.transmission.motors[int(torque.max(axis=0).argmax())])
    sets = [set(what_binds(scaled(by_hand, effort=share), ROBOT)) for share in (1.0, 0.7, 0.4)]
    motors = [{each for each in found if "motor" in each} for found in sets]
    assert any(each.startswith(f"{strongest} motor torque") for each in motors[2])
    assert len(motors[0]) < len(motors[2])


@pytest.mark.parametrize(("joint", "side"), [(0, 0), (3, 1)])
def test_a_joint_that_stays_at_its_limit_is_named(by_hand: JumpPlan, joint: int, side: int) -> None:
    name = f"{_short(ROBOT.joints[joint].name)} joint limit"
    assert name not in what_binds(by_hand, ROBOT)
    position = by_hand.position.copy()
    position[:, 7 + joint] = ROBOT.joint_limits[joint, side]
    assert name in what_binds(replace(by_hand, position=position), ROBOT)
