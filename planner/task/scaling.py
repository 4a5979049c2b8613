"""Scales the defaults of a task to the robot: a large robot moves more slowly and pushes harder.

The defaults of ``JumpTask`` are those of a robot of 5.118 kg on four contact points, whose centre
of mass stands at a height of 0.3287 m. For another robot the times grow with the square root of
that height, as a pendulum's do, and the weights of forces and impulses fall so that the weight
shared by all contact points costs the same. A parameter that the task sets is never changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ...runtime.language.parameters import Parameters
from .per_robot import per_robot

MASS, POINTS, HEIGHT = 5.118, 4, 0.3287
"""The robot of the defaults: kg, contact points, m."""
TIMES = ("squat_time", "thrust_time", "landing_time")
DIGITS = 2
"""Significant digits of a scaled default, so that it reads well and rounding decides nothing."""


def standing_height(robot: RobotDescription) -> float:
    """How high the centre of mass is above the lowest contact point as the robot stands [m], with
    the base upright."""
    angles = robot.standing_position.copy()
    for k, joint in enumerate(robot.joints):
        angles[k] = robot.held.get(joint.name, angles[k])
    upright = np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, np.zeros((1, 3)), upright, angles[None])

    def height(link: str, place: Any) -> float:
        position, rotation = poses.of(link)
        return float((position[0] + product(rotation[0], np.array(place)))[2])

    com = sum(link.mass * height(link.name, link.com) for link in robot.links) / robot.total_mass
    link_of = {foot.name: foot.link for foot in robot.feet}
    return com - min(height(link_of[c.foot], c.position) for c in robot.contacts)


@dataclass(frozen=True)
class Size:
    """How large a robot is: the height of its standing centre of mass [m], and by what times and
    the weights of forces are multiplied."""

    height: float
    slow: float
    light: float


@per_robot
def size_of(robot: RobotDescription) -> Size:
    """The size of a robot that stands on something."""
    height = standing_height(robot)
    light = (MASS / robot.total_mass) ** 2 * len(robot.contacts) / POINTS
    return Size(height, float(np.sqrt(height / HEIGHT)), light)


def scaled_defaults(task: Parameters, robot: RobotDescription) -> dict[str, Any]:
    """The parameters of a ``JumpTask`` that follow from the robot, where it does not say them."""
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
    said = weights.model_fields_set if "weights" in task.model_fields_set else set()
    lighter = {
        name: rounded(type(weights).model_fields[name].default * light)
        for name in ("force", "impulse")
        if name not in said
    }
    if lighter:
        changed["weights"] = weights.model_copy(update=lighter)
    return {name: value for name, value in changed.items() if value != getattr(task, name)}


def rounded(value: float) -> float:
    """The value with a few significant digits."""
    return float(f"{value:.{DIGITS}g}")
