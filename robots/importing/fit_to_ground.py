"""Adapts an imported robot to the ground: its standing pose, and shapes that reach the ground."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array
from ..link_poses import link_poses, standing_heights
from ..parts import Shape
from ..robot_description import RobotDescription
from ..standing_pose import find_standing_pose
from .capsules import coarse

CLEARANCE = 0.002
"""The least height above the ground of a shape that is no contact point [m]."""
FOOT_CLEARANCE = 0.01
"""The least height for shapes of a link with a foot, which tilts while the robot moves [m]."""


def fit_to_ground(
    robot: RobotDescription, standing_given: bool, start: Mapping[str, float]
) -> tuple[RobotDescription, list[str]]:
    """The robot with a standing pose and without shapes that reach the ground in it, and notes.

    A file's own shapes of the feet are where the contact points are: what touches the ground there
    is the contact point, and any other shape that touches it counts as a fall.
    """
    if not robot.feet:
        return robot, []
    notes = []
    if not standing_given:
        pose = find_standing_pose(robot, start)
        if pose.holds:
            robot = robot.changed(standing=pose.angles)
            notes.append("standing is not given: the pose was found")
        else:
            notes.append(
                f"no standing pose was found: contacts differ in height by {pose.level:.1g} m, soles "
                f"tilt by {pose.flatness:.1g} rad, the centre of mass is off by {pose.balance:.1g} m"
            )
    return _without_low_shapes(robot, notes), notes


def _without_low_shapes(robot: RobotDescription, notes: list[str]) -> RobotDescription:
    poses = link_poses(robot, robot.standing_position)
    ground = float(np.min(standing_heights(robot)))
    links, changed = [], []
    feet = {foot.link for foot in robot.feet}
    for link in robot.links:
        rotation, position = poses[link.name]
        room = ground + (FOOT_CLEARANCE if link.name in feet else CLEARANCE) - position[2]
        kept = [_above(shape, rotation, room) for shape in link.shapes]
        if kept != [*link.shapes]:
            changed.append(link.name)
            shapes = tuple(shape for shape in kept if shape is not None)
            link = link.model_copy(update={"shapes": shapes})
        links.append(link)
    if not changed:
        return robot
    notes.append(
        f"shapes of {', '.join(changed)} reach the ground in the standing pose and end above it: "
        "contact points stand for what touches it"
    )
    return robot.changed(links=tuple(links))


def _above(shape: Shape, rotation: Array, room: float) -> Shape | None:
    """The shape, shortened where its lower end is not above ``room`` [m] when the link is turned
    so; None where that leaves nothing."""
    ends = np.array([shape.start, shape.end])
    heights = ends @ rotation[2] - shape.radius
    low, high = int(np.argmin(heights)), int(np.argmax(heights))
    if heights[low] > room:
        return shape
    if heights[high] <= room:
        return None
    # The end stays a little apart from the other: a capsule has a length.
    share = (room - heights[low]) / (heights[high] - heights[low])
    ends[low] += min(share, 0.99) * (ends[high] - ends[low])
    start, end = (tuple(coarse(end)) for end in ends)
    if start == end:
        return None
    return Shape.model_validate({"start": start, "end": end, "radius": shape.radius})
