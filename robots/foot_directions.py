"""Where the feet of a robot point as it stands, from which it is found how they are turned."""

from __future__ import annotations

import numpy as np

from ..mathematics.arrays import Array, Flags1D
from .kinematics import standing_feet
from .limb import FootKind, foot_shape
from .robot_description import RobotDescription


def standing_directions(robot: RobotDescription) -> tuple[Array, Flags1D]:
    """The direction of every foot as the robot stands, (n_feet, 2), and which of them are points, (n_feet,).

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
