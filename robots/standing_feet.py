"""Where the feet of a standing robot are, and on which side of it."""

from __future__ import annotations

import math

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import product
from .description import RobotDescription
from .kinematics import link_poses


def standing_feet(robot: RobotDescription) -> Array:
    """The sole centres (n_feet, 3) [m] from the centre of mass, of a robot in its standing pose."""
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


def foot_sides(feet: Array) -> tuple[float, ...]:
    """For every foot 1 on the left of the base, -1 on the right, 0 in the middle (1 mm)."""
    return tuple(math.copysign(1.0, y) if abs(y) > 1e-3 else 0.0 for y in feet[:, 1].tolist())
