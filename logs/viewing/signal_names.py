"""Names for the elements of a field (joints, contact points, axes) and the unit in a plot's title."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.robot_description import RobotDescription
from ..file.format import RecordedField

MOST_NAMES = 48
"""Largest number of elements of a matrix that has names, and so a plot: more are unreadable."""

MOST_NUMBERS = 16
"""Numbers of one field in a text; of a longer one the first, and the count."""

BASE_NAMES = {
    "floating": ("base x", "base y", "base z", "base roll", "base pitch", "base yaw"),
    "planar": ("base x", "base z", "base pitch"),
    "fixed": (),
}
"""The base's elements of a generalised velocity, by how the base is held; joints come after them."""

GENERALISED_UNITS = {
    "velocity": "m/s, rad/s",
    "acceleration": "m/s^2, rad/s^2",
    "nonlinear_effects": "N, N m",
}
"""The units of fields with ``n_velocities`` elements, whose elements have two different units: first
that of the base's translation, then that of the base's rotation and of the joints."""


def names_along(
    field: RecordedField, size: int | str, length: int, robot: RobotDescription | None
) -> list[str]:
    """Return the names along one axis of a field.

    They are the robot's own names for its dimensions; x, y, z (and w) for three or four elements
    of a vector; linear and angular x, y, z for six; else numbers.
    """
    if robot is not None:
        known = dict(robot.element_names)
        known["n_velocities"] = (*BASE_NAMES[robot.base_joint], *known["n_joints"])
        if (
            "motor" in field.field_name
        ):  # as many motors as joints, but a motor may turn two of them
            known["n_joints"] = robot.transmission.motors
        if size in known:
            return list(known[str(size)])
    # a size that a graph gives makes axes only of what is in a frame: three gains are no x, y, z
    vector = isinstance(size, int) or field.frame is not None
    if vector and length in (3, 4):
        return list("xyzw"[:length])
    if vector and length == 6:
        return [f"{kind} {axis}" for kind in ("linear", "angular") for axis in "xyz"]
    return [str(k) for k in range(length)]


def element_names(field: RecordedField, robot: RobotDescription | None) -> list[str]:
    """Return one name for every element in C order, or none at all for a large matrix."""
    if not field.shape:
        return [field.field_name]
    axes = [
        names_along(field, size, length, robot)
        for size, length in zip(field.dimensions, field.shape, strict=True)
    ]
    names = [" ".join(parts) for parts in product(*axes)]
    if len(axes) == 1 and field.unit and robot is not None:
        units = [unit_of_element(field, robot, k) for k in range(len(names))]
        names = [
            name if unit == field.unit else f"{name} [{unit}]"
            for name, unit in zip(names, units, strict=True)
        ]
    return names if len(axes) == 1 or len(names) <= MOST_NAMES else []


def unit_of(field: RecordedField) -> str:
    """Return the unit of a field as a plot's title says it; empty where there is none."""
    if field.unit in (None, "", "1"):
        return GENERALISED_UNITS.get(field.field_name, "") if is_generalised(field) else ""
    return str(field.unit)


def unit_of_element(field: RecordedField, robot: RobotDescription | None, element: int) -> str:
    """Return the unit of one element of a field, given by its place in C order.

    A field has one unit for all joints, which is that of those that turn; of a joint that slides, and of
    a motor that moves it, m stands for rad and N for N m.
    """
    unit = unit_of(field)
    if robot is None:
        return unit
    if tuple(field.dimensions) == ("n_joints",) and element < len(robot.joints):
        of_motor = "motor" in field.field_name
        joint = robot.joints[element]
        return robot.motor_unit(element, unit) if of_motor else joint.unit(unit)
    if field.unit or not is_generalised(field) or ", " not in unit:
        return unit
    moves = {"floating": 3, "planar": 2, "fixed": 0}[robot.base_joint]
    joint_number = element - len(BASE_NAMES[robot.base_joint])
    if joint_number >= 0:
        return robot.joints[joint_number].unit(unit.split(", ")[1])
    return unit.split(", ")[0 if element < moves else 1]


def is_generalised(field: RecordedField) -> bool:
    """Tell whether a field has one element for each of the robot's generalised velocities."""
    return tuple(field.dimensions) == ("n_velocities",)


AXES = np.array([0xEF5350FF, 0x66BB6AFF, 0x42A5F5FF], np.uint32)
"""x, y and z are red, green and blue wherever they are drawn."""


def axis_colors(field: RecordedField) -> NDArray[np.uint32] | None:
    """Return the colours of a vector's three lines; ``None`` where the viewer may choose."""
    return AXES if field.shape == (3,) else None


def value_text(value: NDArray[Any], unit: str = "") -> str:
    """Return the numbers of a field as a short text."""
    flat = np.ravel(value)
    texts = [f"{x:.6g}" if flat.dtype.kind == "f" else str(x) for x in flat[:MOST_NUMBERS].tolist()]
    text = ", ".join(texts) if flat.size != 1 else texts[0]
    if flat.size > MOST_NUMBERS:
        text += f", ... ({flat.size} in all)"
    if flat.size != 1:
        text = f"[{text}]"
    return f"{text} {unit}".rstrip()
