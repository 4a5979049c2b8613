"""A stance and a squat of any robot: the feet stay, the base stays level, the height is as asked."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.jumping.stand_reference import (
    NEVER,
    StandReference,
    TriggeredStandReference,
    plan_stand,
)
from aloft.blocks.signals import Phase
from aloft.robots.description import find_robot
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

from ...robots.limbed_robots import SEVEN_JOINTS, humanoid, quadruped

ROBOTS = [find_robot("bruce"), quadruped(), humanoid(), humanoid(SEVEN_JOINTS)]
TIMES = (0.2, 0.4, 0.1, 0.4)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: f"{robot.name}{len(robot.joints)}")
def test_any_robot_squats_over_the_middle_of_its_feet_and_rises_again(robot):
    table = plan_stand(robot, 0.05, TIMES)
    columns, height = table.columns, table.columns["com"][:, 2]
    moved = np.abs(columns["foot_position"] - columns["foot_position"][0]).max()
    if robot.name == "quadruped":
        assert 1e-4 < moved < 0.005  # balls of 5 mm radius roll
    else:
        assert moved < 1e-9
    assert np.abs(columns["orientation"] - [0.0, 0.0, 0.0, 1.0]).max() < 1e-9
    assert height.min() == pytest.approx(height[0] - 0.05, abs=1e-9)
    assert height[-1] == pytest.approx(height[0], abs=1e-9)
    middle = columns["foot_position"][0].mean(axis=0)
    assert columns["com"][-1, :2] == pytest.approx(middle[:2], abs=1e-9)  # as it was planned
    names = [joint.name for joint in robot.joints]
    for name, angle in robot.held.items():
        assert columns["joint_position"][:, names.index(name)] == pytest.approx(angle, abs=1e-12)
    keep = np.diff(table.time, prepend=-1.0) > 1e-9
    rates = np.gradient(columns["joint_position"][keep], table.time[keep], axis=0)
    assert rates[5:-5] == pytest.approx(columns["joint_velocity"][keep][5:-5], abs=0.01)


def test_without_a_depth_it_stands_in_its_standing_pose_for_ever():
    robot = quadruped()
    bench = BlockBench(StandReference, robot=robot, rate=500.0)
    for _ in range(3):
        bench.step(400)
        reference = bench.get("reference")
        assert reference.joint_position == pytest.approx(robot.standing_position, abs=1e-12)
        assert np.abs(reference.joint_velocity).max() < 1e-9
        assert int(reference.phase) == Phase.STAND
        assert reference.contact.all()
        assert float(reference.lift_off_time) == NEVER


@pytest.mark.long
def test_the_squat_is_a_phase_and_no_lift_off_is_planned():
    bench = BlockBench(StandReference, {"squat_depth": 0.04}, robot=quadruped(), rate=500.0)
    phases = []
    for _ in range(1500):
        bench.step()
        reference = bench.get("reference")
        if not phases or phases[-1] != int(reference.phase):
            phases.append(int(reference.phase))
        assert float(reference.time) < float(reference.lift_off_time)
    assert phases == [Phase.STAND, Phase.SQUAT]


def test_a_squat_too_deep_names_the_joint():
    with pytest.raises(BlockError, match=r"takes .*_knee .* rad past its limit"):
        plan_stand(quadruped(), 0.25, TIMES)


def test_too_few_joints_are_in_the_load_report():
    robot = quadruped()
    held = robot.model_copy(update={"held": {"front_left_knee": -1.5}})
    (unmet,) = StandReference.requires(
        StandReference.Params(), Context("block", Clock(0.002), robot=held)
    )
    assert "quadruped lacks 1 joints to move its centre of mass" in unmet.message
    assert not list(
        StandReference.requires(
            StandReference.Params(), Context("block", Clock(0.002), robot=robot)
        )
    )


def test_after_the_trigger_it_is_the_motion_of_a_run_that_begins():
    late, usual = (
        BlockBench(kind, {"squat_depth": 0.04}, robot=quadruped(), rate=500.0)
        for kind in (TriggeredStandReference, StandReference)
    )
    late.set("phase", phase=Phase.HANG)
    for _ in range(100):
        late.step()
        assert float(late.get("reference").time) < 0.0
    late.set("phase", phase=Phase.STAND)
    for _ in range(600):
        late.step()
        usual.step()
        mine, other = late.get("reference"), usual.get("reference")
        assert float(mine.time) == pytest.approx(float(other.time), abs=1e-9)
        assert mine.phase == other.phase
        assert mine.com == pytest.approx(other.com, abs=1e-9)
