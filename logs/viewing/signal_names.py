"""Names for the elements of a field in legends: joints, contact points, axes."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..file.format import RecordedField

MOST_NAMES = 24
"""Legends longer than this help nobody."""


def names_along(
    field: RecordedField, size: int | str, length: int, robot: RobotDescription | None
) -> list[str]:
    """The names along one axis of a field: the robot's own for its dimensions, x y z for three."""
    if robot is not None:
        joints = [joint.name for joint in robot.joints]
        known = {
            # as many motors as joints, but a motor may turn two of them
            "n_joints": list(robot.transmission.motors) if "motor" in field.field_name else joints,
            "n_contacts": [contact.name for contact in robot.contacts],
            "n_feet": [foot.name for foot in robot.feet],
        }
        if size in known:
            return known[str(size)]
    if length in (3, 4):
        return list("xyzw"[:length])
    return [str(k) for k in range(length)]


def element_names(field: RecordedField, robot: RobotDescription | None) -> list[str]:
    """One name for every element in C order, or none at all where there would be too many."""
    if not field.shape:
        return [field.field_name]
    axes = [
        names_along(field, size, length, robot)
        for size, length in zip(field.dimensions, field.shape, strict=True)
    ]
    names = [" ".join(parts) for parts in product(*axes)]
    return names if len(names) <= MOST_NAMES else []


AXES = np.array([0xEF5350FF, 0x66BB6AFF, 0x42A5F5FF], np.uint32)
"""x, y and z are red, green and blue wherever they are drawn."""


def axis_colors(field: RecordedField) -> NDArray[np.uint32] | None:
    """The colours of a vector's three lines; ``None`` where the viewer may choose."""
    return AXES if field.shape == (3,) else None
