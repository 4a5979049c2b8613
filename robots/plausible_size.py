"""Check that a robot's size and mass go together: lengths in millimetres, or masses in grams, do not.

The measure is the density of a ball around the standing robot, which is mostly air between limbs. With lengths a thousand
times too large it falls to a billionth.
"""

from __future__ import annotations

import math

import numpy as np

from ..files.problems import listing
from ..mathematics.arrays import Array
from .kinematics import link_poses_in_base
from .robot_description import RobotDescription

LEAST, MOST = 0.1, 8000.0
"""kg/m^3; a robot outside is thinner than a tenth of the air around it, or as dense as steel. Those of ``example-robot-data``
have 0.7 (a humanoid with large inertias) to 54 kg/m^3, but a pendulum whose masses have no size."""

DENSEST = 22_600.0
"""kg/m^3, osmium's."""


def ball_density(robot: RobotDescription) -> tuple[float, float]:
    """Return half the diagonal [m] of the box around the standing robot, and its mass over the volume of a ball of that
    radius [kg/m^3]: infinite where all of it is in one point.
    """
    poses = link_poses_in_base(robot, robot.standing_position)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for link in robot.links:
        rotation, origin = poses[link.name]
        for place, radius in _extremes(robot, link.name):
            middle = origin + rotation @ place
            low, high = np.minimum(low, middle - radius), np.maximum(high, middle + radius)
    reach = 0.5 * float(np.linalg.norm(high - low))
    volume = 4.0 / 3.0 * math.pi * reach**3
    return reach, robot.total_mass / volume if volume > 0.0 else math.inf


def _extremes(robot: RobotDescription, name: str) -> list[tuple[Array, float]]:
    """Return the places [m, link frame] and radii of what a link is known to fill: its joint, its shapes, and its mass,
    as a ball of its radius of gyration.
    """
    link = robot.link(name)
    found = [(np.zeros(3), 0.0)]
    for shape in link.shapes:
        found += [(np.array(corner), shape.radius) for corner in shape.corners]
    if link.mass > 0.0:
        gyration = math.sqrt(max(0.0, 0.5 * sum(link.inertia[:3])) / link.mass)
        found.append((np.array(link.com), gyration))
    return found


def wrong_size(robot: RobotDescription) -> tuple[str, ...]:
    """Return what is wrong with size and mass together, in one sentence; none where nothing seems to be."""
    reach, density = ball_density(robot)
    if LEAST <= density <= MOST:
        return too_dense(robot)
    unit = (
        "lengths in millimetres, or inertias in kg mm^2?"
        if density < LEAST
        else "masses in grams, or lengths in kilometres?"
    )
    said = (
        f"{robot.total_mass:.3g} kg in a ball of {reach:.3g} m radius are {density:.2g} kg/m^3, and robots have "
        f"{LEAST:g} to {MOST:g}: {unit}"
    )
    return (said, *too_dense(robot))


def too_dense(robot: RobotDescription) -> tuple[str, ...]:
    """Return a sentence on links whose mass is more than their inertia allows; none where there are none.

    Of all bodies of a mass and a largest density a solid ball of that density has the least sum of principal moments, so a
    body is somewhere as dense as the solid ball of its mass and its sum of moments.
    """
    found = []
    for link in robot.links:
        moments = sum(link.inertia[:3])
        if link.mass > 0.0 and moments > 0.0:
            radius = math.sqrt(5.0 / 6.0 * moments / link.mass)
            density = link.mass / (4.0 / 3.0 * math.pi * radius**3)
            if density > DENSEST:
                found.append(f"{link.name} ({link.mass:.3g} kg, {density:.1g} kg/m^3)")
    if not found:
        return ()
    said = (
        f"the inertia of {listing(found, 4)} is that of a body denser than any material, {DENSEST:g} kg/m^3: a mass in grams, or "
        "inertia in other units?"
    )
    return (said,)
