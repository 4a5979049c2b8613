"""The poses of a robot's links at given joint positions, in plain arithmetic.

For set-up and checks: it needs no rigid-body library. During a run use ``PinocchioModel``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import product

if TYPE_CHECKING:
    from .robot_description import RobotDescription


def link_poses(robot: RobotDescription, position: Array) -> Mapping[str, tuple[Array, Array]]:
    """The rotation (3, 3) from link to base and the origin [m, base frame] (3,) of every link.

    Args:
        robot: its joints must be listed after those that carry them.
        position: of the joints [rad, or m for a slide], (n_joints,).
    """
    poses = {robot.base: (np.eye(3), np.zeros(3))}
    for joint, value in zip(robot.joints, position.tolist(), strict=True):
        turn, place = poses[joint.parent]
        origin = place + product(turn, np.array(joint.origin))
        if joint.kind == "slide":
            poses[joint.child] = (turn, origin + product(turn, np.array(joint.axis) * value))
        else:
            poses[joint.child] = (product(turn, axis_rotation(joint.axis, value)), origin)
    return poses


def axis_rotation(axis: tuple[float, float, float], angle: float) -> Array:
    """The matrix (3, 3) that turns vectors by ``angle`` [rad] about the unit vector ``axis``."""
    x, y, z = axis
    cos, sin = math.cos(angle), math.sin(angle)
    rest = 1.0 - cos
    return np.array(
        [
            [cos + x * x * rest, x * y * rest - z * sin, x * z * rest + y * sin],
            [y * x * rest + z * sin, cos + y * y * rest, y * z * rest - x * sin],
            [z * x * rest - y * sin, z * y * rest + x * sin, cos + z * z * rest],
        ]
    )


def contact_centres(robot: RobotDescription) -> Array:
    """The centre of the round rubber of every contact point [m, link frame], (n_contacts, 3).

    A contact's ``position`` is the lowest point of its rubber at the zero pose, where all link
    frames are parallel to the base's: the centre is ``radius`` above it in the link's own frame.
    It does not change as the link turns: what touches the ground is always the lowest point of
    the same sphere.
    """
    rows = [np.add(contact.position, (0.0, 0.0, contact.radius)) for contact in robot.contacts]
    return np.array(rows).reshape(-1, 3)


def standing_heights(robot: RobotDescription) -> Array:
    """The heights of the contact points above the base's origin [m] in the upright standing pose,
    (n_contacts,). All are equal where every foot can stand on level ground."""
    poses = link_poses(robot, robot.standing_position)
    links = {foot.name: foot.link for foot in robot.feet}
    owners, centres = robot.foot_of_contact(), contact_centres(robot)
    heights = np.zeros(len(robot.contacts))
    for k, contact in enumerate(robot.contacts):
        turn, place = poses[links[contact.foot]]
        if owners.count(owners[k]) == 1:  # a ball: straight below its centre
            heights[k] = (place + product(turn, centres[k]))[2] - contact.radius
        else:
            heights[k] = (place + product(turn, np.array(contact.position)))[2]
    return heights


def standing_com(robot: RobotDescription) -> Array:
    """The centre of mass in the standing pose [m, base frame], (3,)."""
    poses = link_poses(robot, robot.standing_position)
    total = np.zeros(3)
    for link in robot.links:
        turn, place = poses[link.name]
        total += link.mass * (place + product(turn, np.array(link.com)))
    return np.asarray(total / robot.total_mass)


def joints_above(robot: RobotDescription, link: str) -> list[bool]:
    """Which joints lie between the base and a link, in the description's order."""
    above = [False] * len(robot.joints)
    while link != robot.base:
        index = next(k for k, joint in enumerate(robot.joints) if joint.child == link)
        above[index] = True
        link = robot.joints[index].parent
    return above
