"""Scales the defaults of a task to the robot: a large robot moves more slowly and pushes harder.

The defaults of ``JumpTask`` are those of a robot of 5.118 kg on four contact points, whose centre
of mass stands at a height of 0.3287 m. For another robot the times grow with the square root of
that height, as a pendulum's do, and the weights of forces and impulses fall so that the weight
shared by all contact points costs the same. A parameter that the task sets is never changed.

What the recipe needs of the legs (toes, knees, distances from limits) is found in the robot's description. What
follows from a robot alone is kept, because recipe and scaling ask for it for every task anew.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.kinematics import LinkPoses, link_poses
from ...robots.kinematics import ball_feet as feet_that_are_balls
from ...robots.limb import chain_to
from ...runtime.language.parameters import Parameters

KEPT = 8
"""Number of robots and arguments for which a function's results are kept."""

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_OfRobot = Callable[Concatenate[RobotDescription, _Parameters], _Result]


_texts: OrderedDict[int, tuple[RobotDescription, str]] = OrderedDict()
"""The content of the robots used last, by their ``id``. They are kept alive with it, so that no other
object has it, and they cannot change."""


def _text_of(robot: RobotDescription) -> str:
    if id(robot) not in _texts:
        _texts[id(robot)] = robot, robot.model_dump_json()
    _texts.move_to_end(id(robot))
    while len(_texts) > KEPT:
        _texts.popitem(last=False)
    return _texts[id(robot)][1]


def per_robot(function: _OfRobot[_Parameters, _Result]) -> _OfRobot[_Parameters, _Result]:
    """Call a function once for the same robot and arguments. What it returns must not be changed."""
    kept: OrderedDict[tuple[str, str], _Result] = OrderedDict()

    @wraps(function)
    def called(
        robot: RobotDescription, *args: _Parameters.args, **kwargs: _Parameters.kwargs
    ) -> _Result:
        # A description is not hashable, and two of the same content may be different objects.
        given = f"{args} {sorted(kwargs.items())}" if args or kwargs else ""
        key = _text_of(robot), given
        if key not in kept:
            kept[key] = function(robot, *args, **kwargs)
        kept.move_to_end(key)
        while len(kept) > KEPT:
            kept.popitem(last=False)
        return kept[key]

    return called  # type: ignore[return-value]  # mypy types what wraps gives by itself


ball_feet = per_robot(feet_that_are_balls)

SAME_PLACE = 0.01
"""Contact points of a foot closer together than this [m], along it, are no heel and toe."""
LEAST_CHANGE = 0.02
"""m for each rad; what bends a leg by less is no knee."""
LEAST_LOAD = 1e-6
"""Motors that a load on the toes takes a smaller share of their torque of do not carry it."""
PART_OF_STANDING = 0.8
"""Share of the standing robot's bend in the legs that is required where it stands on nearly straight ones."""


@per_robot
def toe_name_token(robot: RobotDescription) -> str:
    """Return the word that the names of the front contact points of all feet have in common and those of no other
    points have, such as ``toe``; empty where feet are no soles, or have no such word.
    """
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
def toe_push(robot: RobotDescription) -> float:
    """Return the multiple of its weight that a robot can bear on its toes: what the joints behind its knees can, each
    with all of its motors' torque, as the robot stands. Infinite where no such joint carries the toes.
    """
    toes = [c for c in robot.contacts if toe_name_token(robot) in c.name.split("_")]
    poses, torque = _standing_poses(robot), np.zeros(len(robot.joints))
    for foot in robot.feet:
        knee, here = _knee(robot, foot.link, foot.sole), [c for c in toes if c.foot == foot.name]
        chain = chain_to(robot, foot.link)
        place, turn = poses.of(foot.link)
        for k in chain[chain.index(knee[0]) + 1 :] if knee else ():
            origin, rotation = poses.of(robot.joints[k].child)
            axis = product(rotation[0], np.array(robot.joints[k].axis))
            for contact in here:
                arm = place[0] + product(turn[0], np.array(contact.position)) - origin[0]
                weight = np.array([0.0, 0.0, robot.weight / len(toes)])
                if robot.joints[k].kind == "hinge":
                    torque[k] += float(product(axis, np.cross(arm, weight)))
    motors = np.abs(product(robot.torque_to_motor, torque))
    loaded = motors > LEAST_LOAD * robot.motors.peak_torque
    return float(min((robot.motors.peak_torque[loaded] / motors[loaded]), default=np.inf))


@per_robot
def knee_limits(robot: RobotDescription, bend: float) -> Mapping[str, tuple[float, float]]:
    """Return the limits [rad] that keep every knee bent by that much, by the joint's name or by the part of it that is
    the same for all of them; no more than most of what the standing robot bends them.
    """
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
    """Return the least distance [rad] of a joint of the standing robot from its limits."""
    angles, limits = robot.standing_position, robot.joint_limits
    moving = [k for k, joint in enumerate(robot.joints) if joint.name not in robot.held]
    return float(min((angles - limits[:, 0])[moving].min(), (limits[:, 1] - angles)[moving].min()))


@per_robot
def _knee(
    robot: RobotDescription, link: str, sole: tuple[float, float, float]
) -> tuple[int, float] | None:
    """Return the joint of a leg that changes its length most, and the angle [rad] nearest to zero at which the leg is
    longest; ``None`` for a leg that no hinge bends.
    """
    chain = [k for k in chain_to(robot, link) if robot.joints[k].kind == "hinge"]
    if not chain:
        return None
    each = np.repeat(chain, 2)  # one joint after the other, to both sides
    around = robot.standing_position[each] + np.tile([-0.05, 0.05], len(chain))
    lengths = _lengths(robot, link, sole, chain[0], each, around)
    best, least = None, LEAST_CHANGE
    for k, change in zip(chain, np.abs(lengths[1::2] - lengths[::2]) / 0.1, strict=True):
        if change > least:
            best, least = k, float(change)
    if best is None:
        return None
    # A sole ahead of its ankle would make a bent leg the longest.
    after = [k for k in chain if chain.index(k) > chain.index(best)]
    if after:
        link, sole = robot.joints[after[0]].child, (0.0, 0.0, 0.0)
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, 181)
    lengths = _lengths(robot, link, sole, chain[0], np.repeat(best, 181), angles)
    return best, round(float(angles[int(lengths.argmax())]), 2)


def _lengths(
    robot: RobotDescription, link: str, sole: tuple[float, float, float],
    first: int, joints: Indices, angles: Array,
) -> Array:  # fmt: skip
    """Return the distances [m] from a leg's first joint to a place of a link, (n,), each with one joint of the standing
    robot (n,) at an angle (n,)."""
    positions = np.tile(robot.standing_position, (len(angles), 1))
    count = len(angles)
    positions[np.arange(count), joints] = angles
    poses = link_poses(
        robot, np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), positions
    )
    hip, _ = poses.of(robot.joints[first].child)
    place, rotation = poses.of(link)
    return np.asarray(np.linalg.norm(place + product(rotation, np.array(sole)) - hip, axis=1))


MASS, POINTS, HEIGHT = 5.118, 4, 0.3287
"""The robot of the defaults: kg, contact points, m."""
TIMES = ("squat_time", "thrust_time", "landing_time")
DIGITS = 2
"""Significant digits of a scaled default, so that it reads well and rounding decides nothing."""


def standing_height(robot: RobotDescription) -> float:
    """Return the height of the centre of mass above the lowest contact point as the robot stands [m], with the base
    upright.
    """
    poses = _standing_poses(robot)

    def height(link: str, place: Any) -> float:
        position, rotation = poses.of(link)
        return float((position[0] + product(rotation[0], np.array(place)))[2])

    com = sum(link.mass * height(link.name, link.com) for link in robot.links) / robot.total_mass
    link_of = {foot.name: foot.link for foot in robot.feet}
    return com - min(height(link_of[c.foot], c.position) for c in robot.contacts)


def _standing_poses(robot: RobotDescription) -> LinkPoses:
    """Return the link poses of the robot as it stands, with the base upright at the origin."""
    angles = robot.standing_position.copy()
    for k, joint in enumerate(robot.joints):
        angles[k] = robot.held.get(joint.name, angles[k])
    upright = np.array([[0.0, 0.0, 0.0, 1.0]])
    return link_poses(robot, np.zeros((1, 3)), upright, angles[None])


@dataclass(frozen=True)
class Size:
    """Size of a robot: the height of its standing centre of mass [m], and the factors on times and on the weights of
    forces.
    """

    height: float
    slow: float
    light: float


@per_robot
def size_of(robot: RobotDescription) -> Size:
    """Return the size of a robot that stands on something."""
    height = standing_height(robot)
    light = (MASS / robot.total_mass) ** 2 * len(robot.contacts) / POINTS
    return Size(height, float(np.sqrt(height / HEIGHT)), light)


def scaled_defaults(task: Parameters, robot: RobotDescription) -> dict[str, Any]:
    """Return the parameters of a ``JumpTask`` that follow from the robot, where it does not say them."""
    if not robot.contacts:
        return {}
    size = size_of(robot)
    slow, light = size.slow, size.light
    changed: dict[str, Any] = {
        name: rounded(type(task).model_fields[name].default * slow)
        for name in TIMES
        if name not in task.model_fields_set
    }
    weights: Parameters = getattr(task, "weights")  # noqa: B009 - any task's
    given_fields = weights.model_fields_set if "weights" in task.model_fields_set else set()
    lighter = {
        name: rounded(type(weights).model_fields[name].default * light)
        for name in ("force", "impulse")
        if name not in given_fields
    }
    if lighter:
        changed["weights"] = weights.model_copy(update=lighter)
    return {name: value for name, value in changed.items() if value != getattr(task, name)}


def rounded(value: float) -> float:
    """Return the value with a few significant digits."""
    return float(f"{value:.{DIGITS}g}")
