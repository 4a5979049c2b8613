"""How legs in flight follow a plan's joints, with regard to the base's attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.control.leg_inverse_kinematics import LegInverseKinematics
from aloft.blocks.signals import Phase
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

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
