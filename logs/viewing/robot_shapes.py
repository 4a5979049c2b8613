"""The links of a robot as Rerun draws them: solid capsules, or outlines for a second robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import Link, RobotDescription, Shape
from ...robots.kinematics import link_poses

USUAL_REACH = 0.4
"""The reach [m] of the robot that the sizes of marks and lines are given for."""


def shapes_of(robot: RobotDescription, link: Link) -> list[Shape]:
    """What is drawn for a link: its collision shapes, or else bones from its origin.

    The bones go to the joints that the link carries and to its contact points.
    """
    if link.shapes:
        return list(link.shapes)
    feet = [foot.name for foot in robot.feet if foot.link == link.name]
    ends = [joint.origin for joint in robot.joints if joint.parent == link.name]
    ends += [contact.position for contact in robot.contacts if contact.foot in feet]
    radius = 0.025 * reach_of(robot)
    return [Shape(start=(0.0, 0.0, 0.0), end=end, radius=radius) for end in ends]


def reach_of(robot: RobotDescription) -> float:
    """The largest distance of a link's origin from the base's in the standing pose [m].

    It is the measure of how large things are drawn; 0.1 m for a robot of one link.
    """
    base, turn = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, base, turn, robot.standing_position[None])
    return max(0.1, float(np.linalg.norm(poses.position[0], axis=1).max()))


def scale_of(robot: RobotDescription) -> float:
    """How large marks, lines and arrows are drawn, as a factor of what suits BRUCE."""
    return reach_of(robot) / USUAL_REACH


def eye_controls(
    robot: RobotDescription | None, distance: float = 1.0, follow: str | None = None
) -> Any:
    """An eye to the right and in front of a standing robot, ``distance`` times the usual way off.

    With ``follow`` it keeps its place beside that entity, which moves along with the robot.
    """
    import rerun.blueprint as rrb

    size = 3.2 * (reach_of(robot) if robot is not None else USUAL_REACH)
    position = tuple(distance * size * part for part in (0.6, -0.8, 0.4))
    height = eye_height(robot) if robot is not None else 0.25 * size
    return rrb.EyeControls3D(
        position=position, look_target=(0.0, 0.0, height), tracking_entity=follow
    )


def eye_height(robot: RobotDescription) -> float:
    """The height [m] at which the camera looks: that of the base in the standing pose."""
    return 0.85 * reach_of(robot)


def capsules(
    shapes: Sequence[Shape], color: int, *, wires: bool = False, line_radius: float = 0.0006
) -> Any:
    """Rerun's capsules for ``shapes``, in the link's frame; with ``wires`` only their outlines.

    A capsule of Rerun's reaches from its origin along +z, so each is turned.
    """
    import rerun as rr

    starts = np.array([shape.start for shape in shapes]).reshape(-1, 3)
    spans = np.array([shape.end for shape in shapes]).reshape(-1, 3) - starts
    lengths = np.linalg.norm(spans, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[shape.radius for shape in shapes],
        translations=starts,
        quaternions=np.array([quaternion_from_z(span) for span in spans]).reshape(-1, 4),
        # an array of 32-bit colours: a list of four numbers could be one colour's red, green, blue
        # and alpha
        colors=np.full(len(shapes), color, np.uint32),
        line_radii=np.full(len(shapes), line_radius),
        fill_mode="majorwireframe" if wires else "solid",
    )


def quaternion_from_z(direction: Array) -> Array:
    """The shortest rotation x, y, z, w from +z to ``direction``, which need not be a unit vector."""
    length = float(np.linalg.norm(direction))
    if length < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = direction / length
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])  # straight down: any half turn will do
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / float(np.linalg.norm(quaternion))
