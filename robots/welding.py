"""A robot without its held joints: the links behind them become part of the links that carry them.

A joint that stands still is no coordinate of a motion. Welding it gives a robot with fewer links
and joints that moves exactly as the whole one does with that joint held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.rotations import axis_rotations
from .description import Joint, Link, RobotDescription, Shape, Vector3
from .kinematics import from_base_outwards, inertia_tensor


@dataclass(frozen=True)
class HeldLoad:
    """Load on a held joint: a rigid body that is part of a link of the welded robot, and what moves on it.

    Attributes:
        joint: the held joint's index in the whole robot.
        link: the link of the welded robot that carries it; all vectors are in that link's frame.
        axis, origin: of the joint (m).
        mass, com: of the rigid body (kg, m).
        inertia: about that centre of mass, xx, yy, zz, xy, xz, yz (kg m^2).
        most: what the joint's motor can hold (N m), or infinity if several motors share the joint.
        carried: the joints of the welded robot that move on the rigid body.
    """

    joint: int
    link: str
    axis: Vector3
    origin: Vector3
    mass: float
    com: Vector3
    inertia: tuple[float, float, float, float, float, float]
    most: float
    carried: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class WeldedRobot:
    """A robot without its held joints, and where its joints are in the whole robot.

    Attributes:
        robot: the welded description; its joints are those of the whole robot that are not held.
        moving: for every joint of the welded robot its index in the whole one.
        held: the indices of the joints that are held in the whole robot.
        angles: their angles [rad] or places [m].
        loads: what hangs on each held hinge that no foot hangs on.
    """

    robot: RobotDescription
    moving: tuple[int, ...]
    held: tuple[int, ...]
    angles: tuple[float, ...]
    loads: tuple[HeldLoad, ...] = ()

    def expand(self, values: Array, *, held: Sequence[float] | None = None) -> Array:
        """Return the values of all joints (..., n) from those of the welded robot's (..., n_moving); the held joints
        get ``held``, or zero.
        """
        whole = np.zeros((*values.shape[:-1], len(self.moving) + len(self.held)))
        whole[..., list(self.moving)] = values
        if held is not None:
            whole[..., list(self.held)] = held
        return whole

    def reduce(self, values: Array) -> Array:
        """Return the values of the welded robot's joints from those of all joints (..., n)."""
        return np.asarray(values[..., list(self.moving)])


def welded(robot: RobotDescription) -> WeldedRobot:
    """Return the robot with its ``held`` joints welded at their angles.

    Link frames of the result are parallel to the base's at its zero pose, as in every description.
    A robot that holds nothing comes back as it is.

    Raises:
        ValueError: a motor drives a held joint together with one that moves.
    """
    if not robot.held:
        return WeldedRobot(robot, tuple(range(len(robot.joints))), (), ())
    return _welded(robot.model_dump_json())


@lru_cache(maxsize=8)
def _welded(text: str) -> WeldedRobot:
    return _weld(RobotDescription.model_validate_json(text))


@dataclass(frozen=True)
class _LinkPose:
    """Place of a link's frame in the link that it has become part of."""

    link: str
    rotation: Array
    origin: Array

    def point(self, place: Sequence[float]) -> Array:
        return np.asarray(self.origin + self.rotation @ np.array(place))

    def vector(self, place: Sequence[float]) -> Vector3:
        """Return the same as plain numbers."""
        return _vector(self.point(place))


def _weld(robot: RobotDescription) -> WeldedRobot:
    held = [k for k, joint in enumerate(robot.joints) if joint.name in robot.held]
    moving = [k for k in range(len(robot.joints)) if k not in held]
    matrix = robot.joint_to_motor
    motors = [m for m in range(len(matrix)) if np.any(matrix[m, moving])]
    shared = [robot.joints[k].name for k in held if np.any(matrix[motors, k])]
    if shared or len(motors) != len(moving):
        names = ", ".join(shared or [robot.joints[k].name for k in held])
        raise ValueError(
            f"{robot.name}: held joints {names} share motors with joints that move; "
            "hold all joints of these motors, or none"
        )
    places = {robot.base: _LinkPose(robot.base, np.eye(3), np.zeros(3))}
    joints: dict[int, Joint] = {}
    for index, joint in from_base_outwards(robot):
        on = places[joint.parent]
        origin = on.point(joint.origin)
        if index in joints or index not in held:
            places[joint.child] = _LinkPose(joint.child, on.rotation, np.zeros(3))
            changed = {
                "parent": on.link,
                "origin": _vector(origin),
                "axis": _vector(on.rotation @ np.array(joint.axis)),
            }
            joints[index] = joint.model_copy(update=changed)
            continue
        value, turn = robot.held[joint.name], on.rotation
        if joint.kind == "slide":
            origin = origin + turn @ np.array(joint.axis) * value
        else:
            turn = turn @ axis_rotations(joint.axis, np.array([value]))[0]
        places[joint.child] = _LinkPose(on.link, turn, origin)
    kept = [robot.base, *(robot.joints[k].child for k in moving)]
    links = tuple(_merged(robot, places, link.name) for link in robot.links if link.name in kept)
    result = robot.model_copy(
        update={
            "links": links,
            "joints": tuple(joints[k] for k in moving),
            "feet": tuple(
                foot.model_copy(
                    update={
                        "link": places[foot.link].link,
                        "sole": _vector(places[foot.link].point(foot.sole)),
                    }
                )
                for foot in robot.feet
            ),
            "contacts": tuple(_moved_contact(robot, places, c) for c in robot.contacts),
            "transmission": robot.transmission.model_copy(
                update={
                    "motors": tuple(robot.transmission.motors[m] for m in motors),
                    "joint_to_motor": tuple(
                        tuple(float(x) for x in row) for row in matrix[np.ix_(motors, moving)]
                    ),
                }
            ),
            "standing": {k: v for k, v in robot.standing.items() if k not in robot.held},
            "held": {},
            "points": {
                name: (places[link].link, _vector(places[link].point(place)))
                for name, (link, place) in robot.points.items()
            },
        }
    )
    # Validated anew, so that nothing computed for the whole robot is kept.
    robot_without = RobotDescription.model_validate(result.model_dump())
    angles = tuple(robot.held[robot.joints[k].name] for k in held)
    loads = tuple(load for k in held if (load := _load(robot, places, k)) is not None)
    return WeldedRobot(robot_without, tuple(moving), tuple(held), angles, loads)


def _load(robot: RobotDescription, places: dict[str, _LinkPose], index: int) -> HeldLoad | None:
    """Return the load on a held joint; ``None`` for a slide, and where something that stands on the ground hangs on
    it.
    """
    joint = robot.joints[index]
    rigid, beyond, carried = {joint.child}, {joint.child}, list[int]()
    for k, other in from_base_outwards(robot):
        if other.parent not in beyond:
            continue
        beyond.add(other.child)
        if other.parent in rigid and other.name in robot.held:
            rigid.add(other.child)
        elif other.parent in rigid:
            carried.append(k)
    if joint.kind == "slide" or beyond & {foot.link for foot in robot.feet}:
        return None
    on = places[joint.parent]
    mass, com, inertia = _lumped(places, [x for x in robot.links if x.name in rigid])
    motors = np.flatnonzero(robot.joint_to_motor[:, index])
    alone = len(motors) == 1 and np.count_nonzero(robot.joint_to_motor[motors[0]]) == 1
    gear = float(abs(robot.joint_to_motor[motors[0], index])) if alone else 1.0
    most = gear * float(robot.motors.peak_torque[motors[0]]) if alone else np.inf
    moving = [k for k, each in enumerate(robot.joints) if each.name not in robot.held]
    return HeldLoad(
        index, on.link, _vector(on.rotation @ np.array(joint.axis)), _vector(on.point(joint.origin)),
        mass, _vector(com), _six(inertia), most, tuple(moving.index(k) for k in carried),
    )  # fmt: skip


def _moved_contact(robot: RobotDescription, places: dict[str, _LinkPose], contact: Any) -> Any:
    link = next(foot.link for foot in robot.feet if foot.name == contact.foot)
    return contact.model_copy(update={"position": _vector(places[link].point(contact.position))})


def _merged(robot: RobotDescription, places: dict[str, _LinkPose], name: str) -> Link:
    """Return a link with all that is welded to it."""
    parts = [link for link in robot.links if places[link.name].link == name]
    mass, com, inertia = _lumped(places, parts)
    shapes = list[Shape]()
    for link in parts:
        place = places[link.name]
        shapes += [shape.moved(place.vector) for shape in link.shapes]
    changed = {
        "mass": mass, "com": _vector(com), "inertia": _six(inertia), "shapes": tuple(shapes)
    }  # fmt: skip
    return robot.link(name).model_copy(update=changed)


def _lumped(places: dict[str, _LinkPose], parts: Sequence[Link]) -> tuple[float, Array, Array]:
    """Return the mass, centre of mass and inertia about it of links that are welded to each other."""
    mass = float(sum(link.mass for link in parts))
    centres = [places[link.name].point(link.com) for link in parts]
    weighed = [link.mass * centre for link, centre in zip(parts, centres, strict=True)]
    com = sum(weighed, np.zeros(3)) / mass if mass else centres[0]
    inertia = np.zeros((3, 3))
    for link, centre in zip(parts, centres, strict=True):
        turn, off = places[link.name].rotation, centre - com
        inertia += turn @ inertia_tensor(link.inertia) @ turn.T
        inertia += link.mass * (off @ off * np.eye(3) - np.outer(off, off))
    return mass, com, inertia


def _six(inertia: Array) -> tuple[float, float, float, float, float, float]:
    xx, yy, zz = (float(x) for x in np.diag(inertia))
    return xx, yy, zz, float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])


def _vector(values: Array) -> Vector3:
    x, y, z = (float(value) for value in values)
    return x, y, z
