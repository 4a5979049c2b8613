"""Limbs of any number of joints: read from the description, placed, and differentiated."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses
from aloft.robots.limb import (
    FootKind,
    chain_to,
    foot_shape,
    limb_jacobian,
    read_limb,
    set_limb_pose,
)

from .limbed_robots import LIGHT_QUADRUPED, SEVEN_JOINTS, humanoid, quadruped, slider

ROBOTS = [
    quadruped(), quadruped(LIGHT_QUADRUPED), humanoid(), humanoid(SEVEN_JOINTS), slider(),
    find_robot("bruce"),
]  # fmt: skip


def place(limb, angles):
    pose, anchors = np.zeros((4, 3)), np.zeros((len(limb.joints), 6))
    set_limb_pose(limb.links, limb.tip, np.asarray(angles, float), anchors, pose)
    return pose, anchors


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: f"{robot.name}{len(robot.joints)}")
def test_a_limb_agrees_with_the_chain_of_the_description(robot):
    if any(joint.kind == "slide" for joint in robot.joints):
        pytest.skip("the kinematics for pictures turns all joints")
    random = np.random.default_rng(3)
    for foot in range(len(robot.feet)):
        limb = read_limb(robot, foot)
        joints = np.zeros((1, len(robot.joints)))
        joints[0, list(limb.joints)] = random.uniform(-1.5, 1.5, len(limb.joints))
        pose, _ = place(limb, joints[0, list(limb.joints)])
        poses = link_poses(robot, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]), joints)
        origin, turn = (x[0] for x in poses.of(robot.feet[foot].link))
        assert np.abs(pose[0] - origin - turn @ np.array(robot.feet[foot].sole)).max() < 1e-14
        assert np.abs(pose[1:] - turn).max() < 1e-14


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: f"{robot.name}{len(robot.joints)}")
def test_the_jacobian_is_the_derivative(robot):
    random = np.random.default_rng(4)
    for foot in range(len(robot.feet)):
        limb = read_limb(robot, foot)
        n = len(limb.joints)
        angles, rate = random.uniform(-1.0, 1.0, n), random.uniform(-1.0, 1.0, n)
        pose, anchors = place(limb, angles)
        jacobian = np.zeros((6, n))
        limb_jacobian(limb.links, anchors, pose, jacobian)
        step = 1e-6
        after, before = place(limb, angles + step * rate)[0], place(limb, angles - step * rate)[0]
        moved = (after[0] - before[0]) / (2 * step)
        spin = (after[1:] - before[1:]) / (2 * step) @ pose[1:].T
        turned = [spin[2, 1], spin[0, 2], spin[1, 0]]
        assert jacobian @ rate == pytest.approx(np.array([*moved, *turned]), abs=1e-8)


def test_a_slide_moves_its_foot_and_does_not_turn_it():
    limb = read_limb(slider(), 0)
    short, long = place(limb, [0.0, 0.0, 0.0])[0], place(limb, [0.0, 0.0, -0.1])[0]
    assert long[0] - short[0] == pytest.approx([0.0, 0.0, -0.1])
    assert np.array_equal(long[1:], short[1:])


def test_the_kind_of_a_foot_follows_from_its_contact_points():
    assert foot_shape(quadruped(), 0)[0] == FootKind.POINT
    kind, line = foot_shape(find_robot("bruce"), 1)
    assert kind == FootKind.LINE
    assert line.tolist() == [1.0, 0.0, 0.0]
    assert foot_shape(humanoid(), 0)[0] == FootKind.FLAT
    robot = humanoid()
    in_line = [c.model_copy(update={"position": (0.1 * k, 0.05 * k, -0.03)})
               for k, c in enumerate(robot.contacts[:4])]  # fmt: skip
    robot = robot.model_copy(update={"contacts": (*in_line[::-1], *robot.contacts[4:])})
    kind, line = foot_shape(robot, 0)
    assert kind == FootKind.LINE
    assert line == pytest.approx(np.array([2.0, 1.0, 0.0]) / np.sqrt(5.0))


def test_limits_keep_their_margin_and_a_held_joint_its_angle():
    robot = quadruped()
    robot = robot.model_copy(update={"held": {"front_right_knee": -1.2}})
    limb = read_limb(robot, 1, margin=0.1)
    assert [robot.joints[i].name for i in limb.joints] == [
        "front_right_hip_roll", "front_right_hip_pitch", "front_right_knee",
    ]  # fmt: skip
    assert limb.limits == pytest.approx(np.array([[-0.95, 0.95], [-1.47, 3.39], [-1.2, -1.2]]))


def test_a_link_that_nothing_carries_is_named():
    robot = quadruped()
    lost = robot.model_copy(update={"joints": robot.joints[1:]})
    with pytest.raises(
        ValueError, match="no joint leads from 'base' to 'front_left_hip_roll_link'"
    ):
        chain_to(lost, "front_left_knee_link")
