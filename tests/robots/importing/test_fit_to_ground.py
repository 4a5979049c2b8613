"""A standing pose is found from far away, and what cannot be met is said."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.importing.fit_to_ground import find_standing_pose

from ..example_robots import needs_robots
from ..limbed_robots import humanoid, quadruped
from ..validation.wrong_robots import hopper


@pytest.mark.parametrize("robot", [find_robot("bruce"), quadruped(), humanoid()])
def test_it_stands(robot: RobotDescription) -> None:
    pose = find_standing_pose(robot)
    assert pose.holds and max(pose.level, pose.flatness, pose.balance) < 1e-8
    limits = robot.joint_limits
    angles = np.array([pose.angles[joint.name] for joint in robot.joints])
    assert np.all((limits[:, 0] <= angles) & (angles <= limits[:, 1]))
    assert find_standing_pose(robot) == pose  # the same robot gives the same pose


def test_the_start_decides_to_which_side_the_knees_bend() -> None:
    robot = quadruped()
    free = robot.changed(joints=tuple(j.model_copy(update={"limits": None}) for j in robot.joints))
    knees = [joint.name for joint in robot.joints if "knee" in joint.name or "calf" in joint.name]
    assert knees
    for side in (1.0, -1.0):
        start = dict.fromkeys(knees, side * 1.2)
        hips = {j.name: -side * 0.6 for j in robot.joints if "pitch" in j.name or "thigh" in j.name}
        pose = find_standing_pose(free, {**start, **hips})
        assert pose.holds and all(pose.angles[name] * side > 0.1 for name in knees)


@needs_robots
def test_a_lower_stand_bends_the_knees_more_and_held_joints_stay() -> None:
    robot = find_robot("g1")
    high, low = (find_standing_pose(robot, height=height) for height in (0.95, 0.85))
    assert low.holds and low.angles["left_knee_joint"] > high.angles["left_knee_joint"] + 0.1
    assert {name: low.angles[name] for name in robot.held} == dict(robot.held)


def test_what_cannot_stand_says_by_how_much() -> None:
    # One ball under a body that is far to the side, and no joint to bring it there.
    data = hopper()
    data["links"][0]["com"] = [0.0, 1.0, 0.0]
    pose = find_standing_pose(RobotDescription.model_validate(data))
    assert not pose.holds and pose.balance == pytest.approx(1.0 / 3.0, abs=1e-6)


def test_a_robot_without_feet_and_an_unknown_joint() -> None:
    robot = find_robot("bruce")
    with pytest.raises(ValueError, match="bruce has no feet to stand on"):
        find_standing_pose(robot.changed(feet=(), contacts=()))
    with pytest.raises(ValueError, match="bruce has no joint knee"):
        find_standing_pose(robot, {"knee": 1.0})
