"""The tree of a robot's bodies, as kernels take it, from the robot's description."""

from __future__ import annotations

import numpy as np

from ..mathematics.body_dynamics import BodyTree
from .robot_description import RobotDescription


def body_tree(robot: RobotDescription) -> BodyTree:
    """The links and joints of the robot, in the description's order of joints."""
    links = {link.name: link for link in robot.links}
    bodies = [links[robot.base], *(links[joint.child] for joint in robot.joints)]
    index = {link.name: k for k, link in enumerate(bodies)}
    joints = robot.joints
    return BodyTree(
        np.array([index[joint.parent] for joint in joints], dtype=np.int64),
        np.array([joint.origin for joint in joints], dtype=np.float64).reshape(-1, 3),
        np.array([joint.axis for joint in joints], dtype=np.float64).reshape(-1, 3),
        np.array([joint.kind == "slide" for joint in joints], dtype=np.bool_),
        np.array([link.mass for link in bodies], dtype=np.float64),
        np.array([link.com for link in bodies], dtype=np.float64),
        np.array([link.inertia for link in bodies], dtype=np.float64),
    )
