"""Left and right of a robot: which limbs mirror each other, and the robot made exactly so.

The mirror is the base's x-z plane. A hinge's axis is mirrored as a pseudovector: the mirror image
of a turn about (x, y, z) is the same angle about (-x, y, -z). A slide's direction (x, y, z) is
mirrored to (x, -y, z). Where the other limb's axis points the opposite way its coordinate is minus
the first limb's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import ContactPoint, Joint, Link, RobotDescription

LENGTH = 1e-3
"""Limbs whose lengths differ by more [m] are no mirror images."""
DIRECTION = 2e-3
"""The same for the components of a joint's axis."""
SHARE = 0.02
"""The same for masses, motors and gears, as a share."""
INERTIA = 0.05
"""The same for the elements of inertias, as a share of the link's largest: they weigh less than masses."""

ANGLE = 1e-3
"""Angles of a pose that differ by less [rad] are meant to be the same."""

PLACE = np.array([1.0, -1.0, 1.0])
TENSOR = np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Pair:
    """Two limbs that mirror each other.

    Attributes:
        limbs: their numbers, the computed one first.
        joints: pairs of joint indices, and the sign of the second's coordinate by the first's.
        contacts: pairs of indices of contact points.
    """

    limbs: tuple[int, int]
    joints: tuple[tuple[int, int, float], ...]
    contacts: tuple[tuple[int, int], ...]


def limbs_of(robot: RobotDescription) -> tuple[list[list[int]], dict[str, int]]:
    """Return the joints of every limb, parents first, and for every link the number of its limb, -1 for the base. Links
    whose joints lead to the base through the same first joint form a limb.

    Raises:
        ValueError: a joint is listed before the one that carries it.
    """
    of_link = {robot.base: -1}
    limbs: list[list[int]] = []
    for index, joint in enumerate(robot.joints):
        if joint.parent not in of_link:
            raise ValueError(f"{robot.name}: joint {joint.name} is listed before its parent link")
        if joint.parent == robot.base:
            of_link[joint.child] = len(limbs)
            limbs.append([])
        else:
            of_link[joint.child] = of_link[joint.parent]
        limbs[of_link[joint.child]].append(index)
    return limbs, of_link


def mirrored_pairs(robot: RobotDescription) -> tuple[Pair, ...] | None:
    """Return the pairs of limbs that mirror each other within the tolerances above; ``None`` if some limb or the base
    has no mirror image, or the robot has none of its limbs in pairs.
    """
    limbs, of_link = limbs_of(robot)
    base = robot.link(robot.base)
    if abs(base.com[1]) > LENGTH or not _alike_inertia(base, base):
        return None
    left, found = list(range(len(limbs))), list[Pair]()
    while left:
        first = left.pop(0)
        pair = next(
            (p for other in left if (p := _pair(robot, limbs, of_link, first, other))), None
        )
        if pair is None:
            return None
        left.remove(pair.limbs[1])
        found.append(pair)
    return tuple(found) if found and _transmissions_alike(robot, found) else None


def symmetrised(robot: RobotDescription, pairs: Sequence[Pair]) -> RobotDescription:
    """Return the robot with every pair of limbs made exact mirror images by averaging both.

    A robot that is symmetric already is returned as it is.
    """
    links = {link.name: link for link in robot.links}
    joints, contacts = list(robot.joints), list(robot.contacts)
    base = links[robot.base]
    links[robot.base] = _averaged_links(base, base)[0]
    for pair in pairs:
        for i, j, sign in pair.joints:
            joints[i], joints[j] = _averaged_joints(joints[i], joints[j], sign)
            one, other = joints[i].child, joints[j].child
            links[one], links[other] = _averaged_links(links[one], links[other])
        for c, d in pair.contacts:
            contacts[c], contacts[d] = _averaged_contacts(contacts[c], contacts[d])
    changed = {
        "links": tuple(links[link.name] for link in robot.links),
        "joints": tuple(joints),
        "contacts": tuple(contacts),
    }
    same = all(getattr(robot, name) == value for name, value in changed.items())
    return robot if same else robot.model_copy(update=changed)


def symmetrised_angles(pairs: Sequence[Pair], angles: Array) -> Array:
    """Return the joint angles (n_joints,) made the same left and right where they differ by little; others are kept, so
    that a pose that is meant to be askew stays so.
    """
    found = angles.copy()
    for pair in pairs:
        for i, j, sign in pair.joints:
            if abs(angles[i] - sign * angles[j]) < ANGLE:
                found[i] = 0.5 * (angles[i] + sign * angles[j])
                found[j] = sign * found[i]
    return found


def _pair(
    robot: RobotDescription, limbs: list[list[int]], of_link: dict[str, int], first: int,
    other: int,
) -> Pair | None:  # fmt: skip
    """Return the pair of those limbs, if they mirror each other."""
    if len(limbs[first]) != len(limbs[other]):
        return None
    image = {robot.base: robot.base}
    joints = []
    for i, j in zip(limbs[first], limbs[other], strict=True):
        one, twin = robot.joints[i], robot.joints[j]
        image[one.child] = twin.child
        sign = _sign(one, twin)
        alike = (
            image[one.parent] == twin.parent
            and one.kind == twin.kind
            and sign != 0.0
            and _near(np.array(one.origin) * PLACE, twin.origin, LENGTH)
            and _near(_mirrored_limits(one, sign), _limits(twin), 0.02)
            and _alike_inertia(robot.link(one.child), robot.link(twin.child))
        )
        if not alike:
            return None
        joints.append((i, j, sign))
    contacts = _contact_pairs(robot, of_link, image, first, other)
    return None if contacts is None else Pair((first, other), tuple(joints), contacts)


def _sign(one: Joint, twin: Joint) -> float:
    """Return the sign of the second joint's coordinate in a mirrored motion: the first's (1) or minus it (-1); 0 if its
    axis is no mirror image.
    """
    image = _mirrored_axis(one)
    for sign in (1.0, -1.0):
        if _near(sign * image, twin.axis, DIRECTION):
            return sign
    return 0.0


def _mirrored_axis(joint: Joint) -> Array:
    flip = PLACE if joint.kind == "slide" else -PLACE
    return np.asarray(np.array(joint.axis) * flip)


def _limits(joint: Joint) -> Array:
    return np.array(joint.limits or (-np.inf, np.inf))


def _mirrored_limits(joint: Joint, sign: float) -> Array:
    limits = _limits(joint)
    return limits if sign > 0.0 else -limits[::-1]


def _near(one: Any, other: Any, tolerance: float) -> bool:
    return bool(np.allclose(one, other, rtol=0.0, atol=tolerance))


def _alike_inertia(one: Link, other: Link) -> bool:
    """Check whether the second link is the first's mirror image."""
    size = max(abs(x) for x in one.inertia)
    return (
        abs(one.mass - other.mass) <= SHARE * max(one.mass, 1e-3)
        and _near(np.array(one.com) * PLACE, other.com, 2.0 * LENGTH)
        and _near(np.array(one.inertia) * TENSOR, other.inertia, INERTIA * size + 1e-6)
    )


def _contact_pairs(
    robot: RobotDescription, of_link: dict[str, int], image: dict[str, str], first: int, other: int
) -> tuple[tuple[int, int], ...] | None:
    """Return every contact point of the first limb with its mirror image on the other."""
    link_of = {foot.name: foot.link for foot in robot.feet}
    points: list[list[int]] = [
        [k for k, c in enumerate(robot.contacts) if of_link[link_of[c.foot]] == limb]
        for limb in (first, other)
    ]
    if len(points[0]) != len(points[1]):
        return None
    found = []
    for c in points[0]:
        one = robot.contacts[c]
        twins = [
            d for d in points[1]
            if link_of[robot.contacts[d].foot] == image[link_of[one.foot]]
            and _near(np.array(one.position) * PLACE, robot.contacts[d].position, LENGTH)
        ]  # fmt: skip
        if len(twins) != 1:
            return None
        found.append((c, twins[0]))
    return tuple(found)


def _transmissions_alike(robot: RobotDescription, pairs: Sequence[Pair]) -> bool:
    """Check whether motors do the same for both limbs of every pair, and nothing across limbs."""
    geared = robot.joint_to_motor.T @ robot.joint_to_motor
    matrices = (geared, robot.rotor_matrix)
    own = np.zeros_like(geared, dtype=bool)
    motors = robot.motors
    for pair in pairs:
        one = [i for i, _, _ in pair.joints]
        other = [j for _, j, _ in pair.joints]
        signs = np.array([sign for _, _, sign in pair.joints])
        own[np.ix_(one, one)] = own[np.ix_(other, other)] = True
        for matrix in matrices:
            image = matrix[np.ix_(one, one)] * np.outer(signs, signs)
            if not np.allclose(image, matrix[np.ix_(other, other)], rtol=SHARE, atol=1e-12):
                return False
        for values in (motors.peak_torque, motors.corner_speed, motors.no_load_speed):
            if not np.allclose(values[one], values[other], rtol=SHARE):
                return False
    return not np.any(geared[~own])


def _averaged_links(one: Link, other: Link) -> tuple[Link, Link]:
    """Return both links as exact mirror images."""
    mass = 0.5 * (one.mass + other.mass)
    com = 0.5 * (np.array(one.com) + np.array(other.com) * PLACE)
    inertia = 0.5 * (np.array(one.inertia) + np.array(other.inertia) * TENSOR)
    first = {"mass": mass, "com": _numbers(com), "inertia": _numbers(inertia)}
    second = {
        "mass": mass, "com": _numbers(com * PLACE), "inertia": _numbers(inertia * TENSOR)
    }  # fmt: skip
    return one.model_copy(update=first), other.model_copy(update=second)


def _averaged_joints(one: Joint, other: Joint, sign: float) -> tuple[Joint, Joint]:
    """Return both joints as exact mirror images; axes almost along y are exactly along it."""
    flip = PLACE if one.kind == "slide" else -PLACE
    axis = 0.5 * (np.array(one.axis) + sign * np.array(other.axis) * flip)
    axis[np.abs(axis) < DIRECTION] = 0.0
    axis /= np.linalg.norm(axis)
    origin = 0.5 * (np.array(one.origin) + np.array(other.origin) * PLACE)
    limits = _mirrored_limits(other, sign), _limits(one)
    low, high = max(x[0] for x in limits), min(x[1] for x in limits)
    first: dict[str, Any] = {"axis": _numbers(axis), "origin": _numbers(origin)}
    second: dict[str, Any] = {
        "axis": _numbers(sign * axis * flip), "origin": _numbers(origin * PLACE)
    }  # fmt: skip
    if one.limits is not None:
        first["limits"] = (float(low), float(high))
        second["limits"] = (float(low), float(high)) if sign > 0.0 else (float(-high), float(-low))
    return one.model_copy(update=first), other.model_copy(update=second)


def _averaged_contacts(one: ContactPoint, other: ContactPoint) -> tuple[ContactPoint, ContactPoint]:
    position = 0.5 * (np.array(one.position) + np.array(other.position) * PLACE)
    return (
        one.model_copy(update={"position": _numbers(position)}),
        other.model_copy(update={"position": _numbers(position * PLACE)}),
    )


def _numbers(values: Array) -> tuple[float, ...]:
    """Return plain numbers, with no negative zero."""
    return tuple(float(x) + 0.0 for x in values)
