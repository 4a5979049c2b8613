"""A standing pose is found from far away, and what cannot be met is said."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.importing.fit_to_ground import (
    CLEARANCE,
    _above,
    _without_ball,
    find_standing_pose,
    fit_to_ground,
)
from aloft.robots.kinematics import BallFoot, link_poses_in_base, standing_heights
from aloft.robots.shapes import Capsule, Hull

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


@needs_robots
def test_feet_are_below_the_hips_of_legs_that_cannot_straighten() -> None:
    robot = find_robot("hyq")  # knees bend by at least 0.35 rad, fore ones back and hind ones ahead
    pose = find_standing_pose(robot, robot.standing, height=0.7)
    assert pose.holds
    angles = np.array([pose.angles[joint.name] for joint in robot.joints])
    poses = link_poses_in_base(robot, angles)
    hips = {side: poses[f"{side}_upperleg"][1][0] for side in ("lf", "lh")}
    soles = {
        f.name: (poses[f.link][1] + poses[f.link][0] @ np.array(f.sole))[0] for f in robot.feet
    }
    assert soles["lf"] - soles["lh"] == pytest.approx(hips["lf"] - hips["lh"], abs=0.05)


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


def test_a_pose_is_found_only_where_none_is_given() -> None:
    robot = find_robot("bruce")
    same, notes = fit_to_ground(robot, True, {})
    assert same.standing == robot.standing
    assert [note.split(" reach ")[0] for note in notes] == ["shapes of right_foot, left_foot"]
    fitted, (found, *others) = fit_to_ground(robot, False, {})
    assert found == "standing is not given: the pose was found" and len(others) == 1
    assert fitted.standing == find_standing_pose(robot).angles != robot.standing
    assert fit_to_ground(robot.changed(feet=(), contacts=()), False, {})[1] == []


def test_shapes_end_above_the_ground_and_what_lies_below_is_gone() -> None:
    upright = np.eye(3)
    shape = Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, -1.0), radius=0.1)
    assert _above(shape, upright, -1.2) is shape
    shortened = _above(shape, upright, -0.6)
    assert isinstance(shortened, Capsule) and shortened.start == (0.0, 0.0, 0.0)
    # the lower ball now rests at the height: its centre is a radius above it
    assert shortened.end[2] - 0.1 == pytest.approx(-0.6, abs=1e-3) and shortened.radius == 0.1
    assert _above(shape, upright, 0.0) is None and _above(shape, upright, 5.0) is None
    # upside down it is the other end that is cut
    over = np.diag([1.0, -1.0, -1.0])
    turned = _above(shape, over, 0.3)
    assert isinstance(turned, Capsule) and turned.end == (0.0, 0.0, -1.0)
    assert -turned.start[2] - 0.1 == pytest.approx(0.3, abs=1e-3)


def test_a_hull_is_cut_at_a_height() -> None:
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-1.0, 0.0)]
    hull, upright = Hull(corners=tuple(corners)), np.eye(3)
    assert _above(hull, upright, -1.1) is hull
    cut = _above(hull, upright, -0.4)
    assert isinstance(cut, Hull)
    assert {corner[2] for corner in cut.corners} == {-0.4, 0.0}
    assert np.ptp(cut.corners, axis=0) == pytest.approx([0.2, 0.4, 0.4])
    assert _above(hull, upright, 0.0) is None
    assert _above(hull, upright, -0.0005) is None, "what is left is no body"


def test_what_a_ball_stands_for_is_no_shape_of_its_leg() -> None:
    ball = BallFoot(foot=0, point=0, radius=0.02, centre=np.array([0.0, 0.0, -0.3]))
    rubber = Capsule(start=(0.0, -0.01, -0.3), end=(0.0, 0.01, -0.3), radius=0.02)
    assert _without_ball(rubber, ball) is None
    fork = [(x, y, z) for x in (-0.01, 0.01) for y in (-0.02, 0.02) for z in (-0.31, 0.0)]
    leg = _without_ball(Hull(corners=tuple(fork)), ball)
    assert isinstance(leg, Hull)
    far = np.linalg.norm(np.array(leg.corners) - ball.centre, axis=1)
    # the fork's four corners are inside the ball, and the knee's are where they were
    assert sorted(np.round(far, 3))[:4] == pytest.approx([0.9 * ball.radius] * 4, abs=2e-4)
    assert set(leg.corners) & set(fork) == {corner for corner in fork if corner[2] == 0.0}
    knee = Hull(corners=tuple((x, y, z + 0.1) for x, y, z in fork))
    assert _without_ball(knee, ball) is knee


def test_a_low_shape_of_a_robot_is_cut_in_its_standing_pose() -> None:
    robot = find_robot("bruce")
    calf = next(link for link in robot.links if link.name == "left_calf")
    long = Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, -0.6), radius=0.02)
    links = tuple(
        link.model_copy(update={"shapes": (*link.shapes, long)}) if link is calf else link
        for link in robot.links
    )
    fitted, notes = fit_to_ground(robot.changed(links=links), True, {})
    assert len(notes) == 1 and "left_calf" in notes[0] and "right_calf" not in notes[0]
    (cut,) = fitted.link("left_calf").shapes[len(calf.shapes) :]
    rotation, position = link_poses_in_base(robot, robot.standing_position)["left_calf"]
    low = min((position + rotation @ np.array(end))[2] for end in (cut.start, cut.end)) - 0.02
    ground = float(np.min(standing_heights(robot)))
    assert ground + CLEARANCE - 1e-4 <= low <= ground + CLEARANCE + 2e-3
