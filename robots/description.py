"""Finds the description of a robot by name, or reads it from a file."""

from __future__ import annotations

from pathlib import Path

from .parts import (
    ActuatorProfile,
    ContactPoint,
    Foot,
    Joint,
    Link,
    Look,
    Mesh,
    MotorRating,
    Motors,
    Sensors,
    Shape,
    Transmission,
    Vector3,
)
from .reading import find, read
from .robot_description import BASE_VELOCITIES, RobotDescription
from .validation import RobotError, RobotFault

__all__ = [
    "BASE_VELOCITIES",
    "ActuatorProfile",
    "ContactPoint",
    "Foot",
    "Joint",
    "Link",
    "Look",
    "Mesh",
    "MotorRating",
    "Motors",
    "RobotDescription",
    "RobotError",
    "RobotFault",
    "Sensors",
    "Shape",
    "Transmission",
    "Vector3",
    "find_robot",
    "read_description",
]


def find_robot(name: str, folder: Path | None = None) -> RobotDescription:
    """The description called ``name``: a shipped robot, or a file relative to ``folder``.

    The file is a description in YAML, or a URDF or MJCF file with a short YAML of the same name
    beside it for what these formats lack, or such a YAML that names its URDF or MJCF ``file``.

    Raises:
        LookupError: there is none; the message names those that exist.
        RobotError: the file cannot be read, or describes no robot; it carries every fault.
    """
    return find(name, folder)


def read_description(path: Path) -> RobotDescription:
    """The robot that a file describes, of the kinds that ``find_robot`` takes.

    Raises:
        RobotError: the file cannot be read, or describes no robot; it carries every fault.
    """
    return read(path).description
