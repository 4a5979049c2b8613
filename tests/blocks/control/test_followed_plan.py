"""How legs in flight follow a plan's joints, with regard to the base's attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.control.followed_plan import (
    BEFORE,
    Flown,
    Following,
    PlannedJoints,
    Soles,
    keeps_acceleration,
    planned_pitch,
    turned_too_far,
)
from aloft.blocks.control.leg_inverse_kinematics import LegInverseKinematics
from aloft.blocks.signals import Phase
from aloft.mathematics.rotations import multiply, to_matrix
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

from ...turns import quaternion_of
from .test_leg_inverse_kinematics import feet_of

ROBOT = find_robot("bruce")


def in_flight(params, **reference):
    """The targets of a plan that is followed; the base has turned by 0.1 rad more about y."""
    bench = BlockBench(LegInverseKinematics, {"follow": "plan", **params}, robot="bruce")
    c, s = math.cos(0.1), math.sin(0.1)
    bench.set("feet", rotation=[[[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]] * 2)
    bench.set(
        "reference", phase=int(Phase.FLIGHT), lift_off_time=1.0, touchdown_time=1.4,
        orientation=[0.0, 0.0, 0.0, 1.0], joint_velocity=2.0, joint_acceleration=-50.0,
        **{"joint_position": -0.3, **reference},
    )  # fmt: skip
    bench.step()
    return bench.get("target")


@pytest.mark.parametrize(
    ("time", "ahead"), [(1.0, 0.0), (1.1, 0.005), (1.2, 0.01), (1.39, 0.01), (0.9, 0.01)]
)
def test_the_joints_are_ahead_of_the_plan_by_the_lead_from_mid_flight_on(time, ahead):
    target = in_flight({"plan_lead": 0.01}, time=time)
    assert target.position == pytest.approx(-0.3 + 2.0 * ahead - 25.0 * ahead**2)
    assert target.velocity == pytest.approx(2.0 - 50.0 * ahead)


def test_soles_become_level_by_the_ankles_before_touchdown():
    names = [joint.name for joint in ROBOT.joints]
    ankles = [names.index("right_ankle"), names.index("left_ankle")]
    early, late = (in_flight({"level_time": 0.08}, time=time) for time in (1.31, 1.37))
    assert early.position == pytest.approx(-0.3)
    others = np.delete(late.position, ankles)
    assert others == pytest.approx(-0.3)
    flat = np.array([0.0, 0.5, 0.0, -1.0, 0.5] * 2)
    level = in_flight({"level_time": 0.08}, time=1.37, joint_position=flat)
    (_, before), (_, after) = feet_of(flat), feet_of(level.position)
    for foot in range(2):
        pitch = [math.atan2(-turn[foot, 2, 0], turn[foot, 0, 0]) for turn in (before, after)]
        assert pitch[1] - pitch[0] == pytest.approx(-0.1, abs=1e-9)


@pytest.mark.parametrize("late_time", [0.0, 0.005])
def test_legs_that_land_late_go_on_as_in_the_flight(late_time):
    bench = BlockBench(
        LegInverseKinematics, {"follow": "plan", "late_time": late_time}, robot="bruce"
    )
    bench.set("feet", rotation=[np.eye(3)] * 2)
    found = []
    for tick, (phase, acceleration) in enumerate(
        [(Phase.FLIGHT, -50.0), (Phase.FLIGHT, 700.0), *[(Phase.LANDING, 700.0)] * 3]
    ):
        bench.set(
            "reference", phase=int(phase), lift_off_time=1.0, touchdown_time=1.398,
            time=1.391 + 0.002 * tick + 0.002 * (tick > 0), orientation=[0.0, 0.0, 0.0, 1.0],
            joint_position=-0.3, joint_velocity=2.0, joint_acceleration=acceleration,
        )  # fmt: skip
        bench.step()
        found.append(bench.get("target").velocity.copy())
    goes_on = [2.0 - 50.0 * since for since in (0.002, 0.004)]
    law = found[4][0]
    assert law != pytest.approx(2.0, abs=0.3)
    expected = [2.0, 2.0, *(goes_on if late_time else [law, law]), law]
    assert [velocity[0] for velocity in found] == pytest.approx(expected)


def test_the_lead_reads_no_acceleration_of_the_landing():
    for late_time, expected in ((0.0, 700.0), (0.005, -50.0)):
        bench = BlockBench(
            LegInverseKinematics,
            {"follow": "plan", "late_time": late_time, "plan_lead": 0.01},
            robot="bruce",
        )
        bench.set("feet", rotation=[np.eye(3)] * 2)
        for time, acceleration in ((1.39, -50.0), (1.396, 700.0)):
            bench.set(
                "reference", phase=int(Phase.FLIGHT), lift_off_time=1.0, touchdown_time=1.398,
                time=time, orientation=[0.0, 0.0, 0.0, 1.0], joint_position=-0.3,
                joint_velocity=2.0, joint_acceleration=acceleration,
            )  # fmt: skip
            bench.step()
        assert bench.get("target").velocity == pytest.approx(2.0 + 0.01 * expected)


def plan_of(**values):
    """The planned joints, with the values named."""
    plan = PlannedJoints(
        np.zeros((), dtype=np.int64), *(np.zeros(()) for _ in range(3)), np.array([0.0, 0, 0, 1]),
        *(np.zeros(10) for _ in range(3)),
    )  # fmt: skip
    for name, value in values.items():
        getattr(plan, name)[...] = value
    return plan


@pytest.mark.parametrize("pitch", [-3.0, -1.0, 0.0, 0.7, 2.5])
@pytest.mark.parametrize("other", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (-0.2, 0.5)])
def test_the_planned_pitch_is_the_turn_about_y_before_roll_and_yaw(pitch, other):
    roll, yaw = other
    found = planned_pitch(plan_of(orientation=quaternion_of([0.0, pitch, 0.0])))
    assert found == pytest.approx(pitch, abs=1e-12)
    rolled = multiplied(quaternion_of([0.0, pitch, 0.0]), quaternion_of([roll, 0.0, 0.0]))
    turned = multiplied(rolled, quaternion_of([0.0, 0.0, yaw]))
    matrix = np.empty((3, 3))
    to_matrix(turned, matrix)
    # the x axis, seen in the plane of x and z
    expected = math.atan2(-matrix[2, 0], matrix[0, 0])
    assert planned_pitch(plan_of(orientation=turned)) == pytest.approx(expected, abs=1e-12)


def multiplied(first, second):
    out = np.empty(4)
    multiply(first, second, out)
    return out


@pytest.mark.parametrize("pitch", [-2.9, -0.5, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("more", [-0.3, 0.0, 0.2])
def test_how_far_the_base_has_turned_beyond_the_plan(pitch, more):
    c, s = math.cos(pitch + more), math.sin(pitch + more)
    level = np.array([[[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]])
    soles = Soles(level, np.zeros(1, int), np.ones(1), np.full(1, -9.0), np.full(1, 9.0))
    assert turned_too_far(0, soles, pitch) == pytest.approx(more, abs=1e-12)


@pytest.mark.parametrize(
    ("touchdown", "known", "late", "keeps"),
    [
        (1.0, True, 0.01, True), (1.0, False, 0.01, False), (1.0, True, 0.0, False),
        (1.0 + 0.9 * BEFORE, True, 0.01, True), (1.0 + 1.1 * BEFORE, True, 0.01, False),
        (1.0 - 0.9 * BEFORE, True, 0.01, True), (1.0 - 1.1 * BEFORE, True, 0.01, False),
    ],
)  # fmt: skip
def test_accelerations_near_the_touchdown_are_those_of_before(touchdown, known, late, keeps):
    following = Following(np.zeros(1), np.zeros(1), np.full(1, late))
    flown = Flown(np.array(known), np.zeros(()), *(np.zeros(10) for _ in range(3)))
    plan = plan_of(time=1.0, touchdown_time=touchdown)
    assert keeps_acceleration(following, plan, flown) == keeps
