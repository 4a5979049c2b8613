"""What bounds a field, as far as the robot's description says: drawn as lines into its plot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..file.format import Header, RecordedField


def limits_of(field: RecordedField, header: Header) -> list[tuple[str, float]]:
    """The bounds of a field's elements, each with its name; equal ones once.

    Joint angles have the joints' limits; motor torques and speeds those of the actuators that the
    graph says the robot has; joint torques what these motors give at most through the transmission.
    """
    robot = header.robot
    if robot is None or "n_joints" not in field.dimensions:
        return []
    if field.unit == "rad" and len(robot.joints):
        named = [
            (f"{joint.name} {side}", value)
            for joint in robot.joints
            for side, value in zip(("least", "most"), joint.limits or (), strict=False)
        ]
        return _once(named)
    motors, motor = _robot_in_use(header, robot).motors, "motor" in field.field_name
    if field.unit == "N m" and motor:
        return _both("peak torque", motors.peak_torque)
    if field.unit == "N m":
        return _both("peak torque", np.abs(robot.joint_to_motor.T) @ motors.peak_torque)
    if field.unit == "rad/s" and motor:
        return _both("no-load speed", motors.no_load_speed)
    return []


def _robot_in_use(header: Header, robot: RobotDescription) -> RobotDescription:
    """The robot with the actuator profile of the run. Before version 0.2 a parameter of some block
    named the profile."""
    said = {str(value) for value in header.parameters.values()}
    earlier = [name for name in robot.profiles if name in said]
    return robot.with_profile(earlier[0]) if earlier and not robot.profile else robot


def _both(name: str, values: NDArray[np.float64]) -> list[tuple[str, float]]:
    """Every value that occurs, upwards and downwards."""
    different = sorted(set(values.tolist()))
    return [
        (f"{sign}{name}", factor * value)
        for value in different
        for sign, factor in (("+", 1), ("-", -1))
    ]


def _once(named: list[tuple[str, float]]) -> list[tuple[str, float]]:
    """Each value once, with the name it had first."""
    found: dict[float, str] = {}
    for name, value in named:
        found.setdefault(round(value, 9), name)
    return [(name, value) for value, name in found.items()]
