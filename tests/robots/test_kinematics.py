"""Forward kinematics for pictures: known poses, and Pinocchio's answer for the shipped robot.

Feet that are balls: found by their one contact point, seen the same by everybody.
"""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics.rotations import axis_rotations, matrices_of_quaternions
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.kinematics import (
    ball_feet,
    foot_sides,
    from_base_outwards,
    link_poses,
    link_poses_in_base,
    standing_heights,
)
from aloft.robots.pinocchio_model import build_pinocchio_model

from .limbed_robots import humanoid, quadruped

INERTIA = (0.01, 0.01, 0.01, 0.0, 0.0, 0.0)


def two_links(**changes: object) -> RobotDescription:
    """A base with an arm of two links, its joints listed from the tip inwards."""
    link = {"mass": 1.0, "com": (0, 0, 0), "inertia": INERTIA}
    joint = {"axis": (0, 1, 0), "limits": (-3, 3)}
    return RobotDescription.model_validate(
        {
            "name": "arm",
            "base": "base",
            "links": [{"name": name, **link} for name in ("base", "upper", "lower")],
            "joints": [
                {"name": "elbow", "parent": "upper", "child": "lower", "origin": (0, 0, -0.2), **joint},
                {"name": "shoulder", "parent": "base", "child": "upper", "origin": (0, 0.1, 0), **joint},
            ],
            "feet": [],
            "contacts": [],
            "transmission": {"motors": ["a", "b"], "joint_to_motor": [[1, 0], [0, 1]]},
            "profiles": {},
            "standing": {},
            **changes,
        }
    )  # fmt: skip


def test_a_bent_arm_is_where_geometry_puts_it() -> None:
    robot = two_links()
    # elbow, shoulder: a right angle at the shoulder about +y takes -z to -x
    joints = np.array([[0.0, 0.0], [0.0, np.pi / 2], [np.pi / 2, 0.0]])
    base = np.array([[0.0, 0.0, 1.0]] * 3)
    upright = np.array([[0.0, 0.0, 0.0, 1.0]] * 3)
    poses = link_poses(robot, base, upright, joints)
    assert poses.names == ("base", "upper", "lower")
    position, rotation = poses.of("lower")
    expected = [[0, 0.1, 0.8], [-0.2, 0.1, 1.0], [0, 0.1, 0.8]]
    np.testing.assert_allclose(position, expected, atol=1e-15)
    np.testing.assert_allclose(rotation[2] @ [0, 0, -1], [-1, 0, 0], atol=1e-15)


def test_the_base_carries_everything_with_it() -> None:
    robot = two_links()
    quarter_left = np.array([[0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]])
    poses = link_poses(robot, np.array([[1.0, 2.0, 3.0]]), quarter_left, np.zeros((1, 2)))
    np.testing.assert_allclose(poses.of("upper")[0], [[0.9, 2.0, 3.0]], atol=1e-15)


def test_rotations_are_right_handed_and_orthonormal() -> None:
    angles = np.linspace(-7.0, 7.0, 9)
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    about = axis_rotations(tuple(axis), angles)
    quaternions = np.column_stack([np.sin(angles / 2)[:, None] * axis, np.cos(angles / 2)])
    np.testing.assert_allclose(about, matrices_of_quaternions(quaternions), atol=1e-14)
    np.testing.assert_allclose(about @ np.swapaxes(about, 1, 2), [np.eye(3)] * 9, atol=1e-14)


def test_a_joint_that_hangs_on_nothing_is_named() -> None:
    joints = [
        {"name": "elbow", "parent": "upper", "child": "lower", "origin": (0, 0, 0),
         "axis": (0, 1, 0), "limits": (-3, 3)},
        {"name": "loose", "parent": "lower", "child": "upper", "origin": (0, 0, 0),
         "axis": (0, 1, 0), "limits": (-3, 3)},
    ]  # fmt: skip
    with pytest.raises(
        ValueError, match="joints elbow, loose are not connected to the base 'base'"
    ):
        from_base_outwards(two_links(joints=joints))


def test_bruce_is_where_pinocchio_puts_it() -> None:
    import pinocchio

    robot = find_robot("bruce")
    model = build_pinocchio_model(robot).model
    data = model.createData()
    random = np.random.default_rng(5)
    orientation = random.standard_normal((4, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    base, joints = random.standard_normal((4, 3)), random.uniform(-1.5, 1.5, (4, 10))
    poses = link_poses(robot, base, orientation, joints)
    for row in range(4):
        q = np.concatenate([base[row], orientation[row], joints[row]])
        pinocchio.framesForwardKinematics(model, data, q)
        for joint in robot.joints:
            placement = data.oMi[model.getJointId(joint.name)]
            position, rotation = poses.of(joint.child)
            np.testing.assert_allclose(position[row], placement.translation, atol=1e-12)
            np.testing.assert_allclose(rotation[row], placement.rotation, atol=1e-12)


def test_only_feet_with_one_contact_point_are_balls():
    robot = quadruped()
    assert [ball.foot for ball in ball_feet(robot)] == [0, 1, 2, 3]
    assert ball_feet(humanoid()) == ()
    assert ball_feet(find_robot("bruce")) == ()
    ball, contact = ball_feet(robot)[2], robot.contacts[2]
    assert (ball.point, ball.radius) == (2, contact.radius)
    assert ball.centre.tolist() == np.add(contact.position, (0.0, 0.0, contact.radius)).tolist()


def test_the_lowest_point_is_below_the_centre_for_everybody():
    robot, upright = quadruped(), np.array([0.0, 0.0, 0.0, 1.0])
    poses, n = link_poses_in_base(robot, robot.standing_position), len(robot.joints)
    seen = ContactKinematics(robot)
    seen.evaluate(upright, np.zeros(3), robot.standing_position, np.zeros(n))
    for ball in ball_feet(robot):
        turn, place = poses[robot.feet[ball.foot].link]
        lowest = place + turn @ ball.centre - [0, 0, ball.radius]
        assert seen.points[ball.point] == pytest.approx(lowest, abs=1e-12)
        assert seen.soles[ball.foot] == pytest.approx(lowest, abs=1e-12)
        assert standing_heights(robot)[ball.point] == pytest.approx(lowest[2], abs=1e-8)
    assert seen.forward / np.linalg.norm(seen.forward) == pytest.approx([1, 0, 0], abs=1e-6)


def test_the_pattern_of_the_feet_turns_with_the_robot():
    """The direction is seen from the base: turning the legs under it turns the direction."""
    robot, seen = quadruped(), ContactKinematics(quadruped())
    position = robot.standing_position
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    seen.evaluate(upright, np.zeros(3), position, np.zeros(len(position)))
    before = seen.points.copy()
    angle = 0.2
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for point, place in enumerate(before):
        seen.points[point, :2] = turn @ place[:2]
    pattern = seen._pattern
    ahead = pattern[0] @ seen.points + np.cross([0, 0, -1.0], pattern[1] @ seen.points)
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(angle, abs=1e-6)


def test_feet_are_on_the_left_on_the_right_or_in_the_middle() -> None:
    feet = np.array([[0.1, 0.2, 0.0], [0.0, -0.002, 0.0], [0.3, 0.0005, 0.0], [0.0, 0.002, -1.0]])
    assert foot_sides(feet) == (1.0, -1.0, 0.0, 1.0)
