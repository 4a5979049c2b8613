"""Finds in a robot's description what the recipe needs of its legs: toes, knees, distances from limits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ...robots.limb import chain_to
from .per_robot import per_robot

SAME_PLACE = 0.01
"""Contact points of a foot closer together than this [m], along it, are no heel and toe."""
LEAST_CHANGE = 0.02
"""m for each rad; what bends a leg by less is no knee."""
PART_OF_STANDING = 0.8
"""Where a robot stands on nearly straight legs, this share of how they are bent then is asked for."""


def word_of_toes(robot: RobotDescription) -> str:
    """What the names of the front contact points of all feet have in common and those of no other
    points have, such as ``toe``; empty where feet are no soles, or have no such word."""
    front, others = list[str](), list[str]()
    for foot in robot.feet:
        places = {c.name: c.position[0] for c in robot.contacts if c.foot == foot.name}
        if not places or max(places.values()) - min(places.values()) < SAME_PLACE:
            return ""
        middle = 0.5 * (max(places.values()) + min(places.values()))
        for name, x in places.items():
            (front if x > middle else others).append(name)
    words = [word for word in front[0].split("_") if word] if front else []
    for word in words:
        if all(word in name for name in front) and not any(word in name for name in others):
            return word
    return ""


@per_robot
def knee_limits(robot: RobotDescription, bend: float) -> Mapping[str, tuple[float, float]]:
    """Limits [rad] that keep every knee bent by that much, by the joint's name or by the part of it
    that is the same for all of them; no more than most of what the standing robot bends them."""
    found: dict[str, tuple[float, float]] = {}
    for foot in robot.feet:
        knee = _knee(robot, foot.link, foot.sole)
        if knee is None:
            continue
        index, straight = knee
        low, high = (float(limit) for limit in robot.joint_limits[index])
        standing = float(robot.standing_position[index]) - straight
        least = round(min(bend, PART_OF_STANDING * abs(standing)), 2)
        name = robot.joints[index].name
        if standing < 0.0:
            found[name] = (low, min(high, round(straight - least, 3)))
        else:
            found[name] = (max(low, round(straight + least, 3)), high)
    short = {name.partition("_")[2] for name in found}
    if len(short) == 1 and "" not in short and len(set(found.values())) == 1:
        return {short.pop(): next(iter(found.values()))}
    return found


@per_robot
def least_distance_to_limits(robot: RobotDescription) -> float:
    """The least distance [rad] of a joint of the standing robot from its limits."""
    angles, limits = robot.standing_position, robot.joint_limits
    moving = [k for k, joint in enumerate(robot.joints) if joint.name not in robot.held]
    return float(min((angles - limits[:, 0])[moving].min(), (limits[:, 1] - angles)[moving].min()))


def _knee(
    robot: RobotDescription, link: str, sole: tuple[float, float, float]
) -> tuple[int, float] | None:
    """The joint of a leg that changes its length most, and the angle [rad] nearest to zero at which
    the leg is longest; ``None`` for a leg that no hinge bends."""
    chain = [k for k in chain_to(robot, link) if robot.joints[k].kind == "hinge"]
    best, least = None, LEAST_CHANGE
    for k in chain:
        around = robot.standing_position[k] + np.array([-0.05, 0.05])
        change = abs(float(np.diff(_lengths(robot, link, sole, chain[0], k, around))[0])) / 0.1
        if change > least:
            best, least = k, change
    if best is None:
        return None
    # A sole ahead of its ankle would make a bent leg the longest.
    after = [k for k in chain if chain.index(k) > chain.index(best)]
    if after:
        link, sole = robot.joints[after[0]].child, (0.0, 0.0, 0.0)
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, 181)
    lengths = _lengths(robot, link, sole, chain[0], best, angles)
    return best, round(float(angles[int(lengths.argmax())]), 2)


def _lengths(
    robot: RobotDescription, link: str, sole: tuple[float, float, float],
    first: int, joint: int, angles: Array,
) -> Array:  # fmt: skip
    """Distances [m] from a leg's first joint to a place of a link, with one joint at those angles."""
    positions = np.tile(robot.standing_position, (len(angles), 1))
    positions[:, joint] = angles
    count = len(angles)
    poses = link_poses(
        robot, np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), positions
    )
    hip, _ = poses.of(robot.joints[first].child)
    place, rotation = poses.of(link)
    return np.asarray(np.linalg.norm(place + product(rotation, np.array(sole)) - hip, axis=1))
