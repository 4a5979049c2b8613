"""A robot's links as Rerun draws them: solid capsules, or their wires for a second robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import Link, RobotDescription, Shape

Array = NDArray[np.float64]


def shapes_of(robot: RobotDescription, link: Link) -> list[Shape]:
    """What to draw for a link: its collision shapes, or else bones to the joints it carries."""
    if link.shapes:
        return list(link.shapes)
    ends = [joint.origin for joint in robot.joints if joint.parent == link.name]
    return [Shape(start=(0.0, 0.0, 0.0), end=end, radius=0.01) for end in ends]


def capsules(shapes: Sequence[Shape], color: int, *, wires: bool = False) -> Any:
    """Rerun's capsules, which reach from their origin along +z, turned to lie on ``shapes``."""
    import rerun as rr

    starts = np.array([shape.start for shape in shapes]).reshape(-1, 3)
    spans = np.array([shape.end for shape in shapes]).reshape(-1, 3) - starts
    lengths = np.linalg.norm(spans, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[shape.radius for shape in shapes],
        translations=starts,
        quaternions=np.array([quaternion_from_z(span) for span in spans]).reshape(-1, 4),
        colors=[color] * len(shapes),
        line_radii=[0.0006] * len(shapes),
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
