"""Forward kinematics of a robot from its description, and where its feet are, in plain NumPy.

``link_poses`` takes many instants at once, with the base anywhere; ``link_poses_in_base`` one position of the
joints, seen from the base. For set-up, checks and pictures, not for control.

A foot with one contact point is a ball, which rolls on the ground. Its contact point, and its sole, are the
ball's lowest point in the world, whatever the foot's orientation: the point one radius straight below the
centre. The description gives the positions of these points at the zero pose. Contact points of other feet are
fixed to the foot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array, Flags1D
from ..mathematics.body_dynamics import BodyTree, body_motion, set_body_poses
from ..mathematics.linear_algebra import product
from ..mathematics.rotations import axis_rotations, matrices_of_quaternions
from .limb import FootKind, foot_shape
from .robot_description import Joint, RobotDescription

FALL_SHARE = 0.315
"""A base below this share of its standing height counts as fallen: 0.12 m for BRUCE."""


def inertia_tensor(parts: Sequence[float]) -> Array:
    """Return the inertia (3, 3) whose parts are xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = parts
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass(frozen=True)
class LinkPoses:
    """Link frames in the world at ``n`` instants, links in the order of the description.

    ``position`` [m] is (n, n_links, 3), ``rotation`` from link to world (n, n_links, 3, 3).
    """

    names: tuple[str, ...]
    position: Array
    rotation: Array

    def of(self, link: str) -> tuple[Array, Array]:
        """Return the position (n, 3) and rotation (n, 3, 3) of one link. Raises ``ValueError``."""
        index = self.names.index(link)
        return self.position[:, index], self.rotation[:, index]


def body_tree(robot: RobotDescription) -> BodyTree:
    """Return the links and joints of the robot, in the description's order of joints."""
    links = {link.name: link for link in robot.links}
    bodies = [links[robot.base], *(links[joint.child] for joint in robot.joints)]
    index = {link.name: k for k, link in enumerate(bodies)}
    joints = robot.joints
    return BodyTree(
        np.array([index[joint.parent] for joint in joints], dtype=np.int64),
        np.array([joint.origin for joint in joints], dtype=np.float64).reshape(-1, 3),
        np.array([joint.axis for joint in joints], dtype=np.float64).reshape(-1, 3),
        np.array([joint.kind == "slide" for joint in joints], dtype=np.bool_),
        np.array([link.mass for link in bodies], dtype=np.float64),
        np.array([link.com for link in bodies], dtype=np.float64),
        np.array([link.inertia for link in bodies], dtype=np.float64),
    )


def from_base_outwards(robot: RobotDescription) -> list[tuple[int, Joint]]:
    """Return the joints with their index, each behind the one that carries its parent link.

    Raises:
        ValueError: some joints are not connected to the base.
    """
    reached = {robot.base}
    remaining = list(enumerate(robot.joints))
    ordered: list[tuple[int, Joint]] = []
    while remaining:
        ready = [(k, joint) for k, joint in remaining if joint.parent in reached]
        if not ready:
            names = ", ".join(joint.name for _, joint in remaining)
            raise ValueError(f"joints {names} are not connected to the base {robot.base!r}")
        ordered += ready
        reached |= {joint.child for _, joint in ready}
        remaining = [(k, joint) for k, joint in remaining if joint.child not in reached]
    return ordered


def link_poses(
    robot: RobotDescription, base_position: Array, base_orientation: Array, joint_position: Array
) -> LinkPoses:
    """Return the pose of every link.

    Args:
        robot: the description; all its frames are parallel to the base's at the zero pose.
        base_position: base origin in the world [m], (n, 3).
        base_orientation: unit quaternions x, y, z, w from base to world, (n, 4).
        joint_position: joint angles [rad], of slides positions [m], (n, n_joints), in the order of
            the description.
    """
    names = tuple(link.name for link in robot.links)
    index = {name: k for k, name in enumerate(names)}
    instants = len(base_position)
    position = np.zeros((instants, len(names), 3))
    rotation = np.zeros((instants, len(names), 3, 3))
    position[:, index[robot.base]] = base_position
    rotation[:, index[robot.base]] = matrices_of_quaternions(base_orientation)
    for k, joint in from_base_outwards(robot):
        parent, child = index[joint.parent], index[joint.child]
        offset = np.array(joint.origin)
        if joint.kind == "slide":
            offset = offset + joint_position[:, k, None] * np.array(joint.axis)
            position[:, child] = position[:, parent]
            position[:, child] += product(rotation[:, parent], offset[:, :, None])[:, :, 0]
            rotation[:, child] = rotation[:, parent]
            continue
        position[:, child] = position[:, parent] + product(rotation[:, parent], offset)
        turn = axis_rotations(joint.axis, joint_position[:, k])
        rotation[:, child] = product(rotation[:, parent], turn)
    return LinkPoses(names, position, rotation)


def link_poses_in_base(
    robot: RobotDescription, position: Array
) -> Mapping[str, tuple[Array, Array]]:
    """Return the rotation (3, 3) from link to base and the origin [m, base frame] (3,) of every link.

    Args:
        robot: its joints must be listed after those that carry them.
        position: of the joints [rad, or m for a slide], (n_joints,).
    """
    motion = body_motion(len(robot.joints))
    set_body_poses(body_tree(robot), position, motion)
    links = (robot.base, *(joint.child for joint in robot.joints))
    return dict(zip(links, zip(motion.rotation, motion.place, strict=True), strict=True))


def contact_centres(robot: RobotDescription) -> Array:
    """Return the centre of the round rubber of every contact point [m, link frame], (n_contacts, 3).

    A contact's ``position`` is the lowest point of its rubber at the zero pose, where all link
    frames are parallel to the base's: the centre is ``radius`` above it in the link's own frame.
    It does not change as the link turns: what touches the ground is always the lowest point of
    the same sphere.
    """
    rows = [np.add(contact.position, (0.0, 0.0, contact.radius)) for contact in robot.contacts]
    return np.array(rows).reshape(-1, 3)


def standing_heights(robot: RobotDescription) -> Array:
    """Return the heights of the contact points above the base's origin [m] in the upright standing pose, (n_contacts,).
    All are equal where every foot can stand on level ground.
    """
    poses = link_poses_in_base(robot, robot.standing_position)
    links = {foot.name: foot.link for foot in robot.feet}
    owners, centres = robot.foot_of_contact(), contact_centres(robot)
    heights = np.zeros(len(robot.contacts))
    for k, contact in enumerate(robot.contacts):
        R, p = poses[links[contact.foot]]
        if owners.count(owners[k]) == 1:  # a ball: straight below its centre
            heights[k] = (p + product(R, centres[k]))[2] - contact.radius
        else:
            heights[k] = (p + product(R, np.array(contact.position)))[2]
    return heights


def fall_height(robot: RobotDescription) -> float:
    """Return the height of the base above the ground below which the robot counts as fallen [m]."""
    return float(round(FALL_SHARE * -float(standing_heights(robot).min()), 3))


def standing_contacts(robot: RobotDescription) -> Array:
    """Return the contact points in the standing pose, from the middle between the feet, (n_contacts, 3)."""
    poses = link_poses_in_base(robot, robot.standing_position)
    links = {foot.name: foot.link for foot in robot.feet}
    points = np.array(
        [
            poses[links[contact.foot]][1] + product(poses[links[contact.foot]][0], centre)
            for contact, centre in zip(robot.contacts, contact_centres(robot), strict=True)
        ]
    )
    owners = np.array(robot.foot_of_contact())
    middles = [points[owners == foot].mean(axis=0) for foot in range(len(robot.feet))]
    found: Array = points - np.mean(middles, axis=0)
    return found


def standing_com(robot: RobotDescription) -> Array:
    """Return the centre of mass in the standing pose [m, base frame], (3,)."""
    poses = link_poses_in_base(robot, robot.standing_position)
    total = np.zeros(3)
    for link in robot.links:
        R, p = poses[link.name]
        total += link.mass * (p + product(R, np.array(link.com)))
    return np.asarray(total / robot.total_mass)


def joints_above(robot: RobotDescription, link: str) -> list[bool]:
    """Return which joints lie between the base and a link, in the description's order."""
    above = [False] * len(robot.joints)
    while link != robot.base:
        index = next(k for k, joint in enumerate(robot.joints) if joint.child == link)
        above[index] = True
        link = robot.joints[index].parent
    return above


@dataclass(frozen=True, eq=False)
class BallFoot:
    """A foot with one contact point: the indices of ``foot`` and ``point``, the ``radius`` [m] of
    the ball, and its ``centre`` in the frame of the foot's link [m], (3,)."""

    foot: int
    point: int
    radius: float
    centre: Array


def ball_feet(robot: RobotDescription) -> tuple[BallFoot, ...]:
    """Return the robot's feet with exactly one contact point, in the order of its contact points."""
    centres = contact_centres(robot)
    owners = robot.foot_of_contact()
    return tuple(
        BallFoot(foot, point, contact.radius, centres[point])
        for point, (foot, contact) in enumerate(zip(owners, robot.contacts, strict=True))
        if owners.count(foot) == 1
    )


def standing_feet(robot: RobotDescription) -> Array:
    """Return the sole centres (n_feet, 3) [m] from the centre of mass, of a robot in its standing pose."""
    level = np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, np.zeros((1, 3)), level, robot.standing_position[None])
    com, feet = np.zeros(3), np.zeros((len(robot.feet), 3))
    for link in robot.links:
        place, turn = poses.of(link.name)
        com += link.mass / robot.total_mass * (place[0] + product(turn[0], np.array(link.com)))
    for number, foot in enumerate(robot.feet):
        place, turn = poses.of(foot.link)
        feet[number] = place[0] + product(turn[0], np.array(foot.sole)) - com
    return feet


def standing_directions(robot: RobotDescription) -> tuple[Array, Flags1D]:
    """Return the direction of every foot as the robot stands, (n_feet, 2), and which of them are points, (n_feet,).

    A foot with a line or a sole points ahead, (1, 0). A point has no direction; its place from the middle of
    all feet [m] stands for it.
    """
    points = np.array(
        [foot_shape(robot, foot)[0] is FootKind.POINT for foot in range(len(robot.feet))]
    )
    directions = np.zeros((len(points), 2))
    directions[:, 0] = 1.0
    feet = standing_feet(robot)[:, :2]
    if len(points) > 1:
        directions[points] = (feet - feet.mean(axis=0))[points]
    return directions, points


def foot_sides(feet: Array) -> tuple[float, ...]:
    """Return the side of every foot: 1 on the left of the base, -1 on the right, 0 in the middle (1 mm)."""
    return tuple(math.copysign(1.0, y) if abs(y) > 1e-3 else 0.0 for y in feet[:, 1].tolist())
