"""The limits of a field by the robot's description, which are drawn as lines into its plot."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..file.format import Header, RecordedField


def limits_of(field: RecordedField, header: Header) -> list[tuple[str, float]]:
    """The limits of a field's elements, each with its name; equal ones are given once.

    Joint angles have the joints' limits, where these have any. Motor torques and speeds have the
    limits of the actuator profile in use. Joint torques have what these motors give at most
    through the transmission.
    """
    robot = header.robot
    if robot is None or "n_joints" not in field.dimensions or not robot.joints:
        return []
    if field.unit == "rad":
        return _once(
            (f"{joint.name} {side}", value)
            for joint in robot.joints
            for side, value in zip(("least", "most"), joint.limits or (), strict=False)
        )
    motors, of_motor = robot.motors, "motor" in field.field_name
    if field.unit == "N m" and of_motor:
        return _both("peak torque", motors.peak_torque.tolist())
    if field.unit == "N m":
        peaks = np.abs(robot.joint_to_motor.T) @ motors.peak_torque
        return _both("peak torque", peaks.tolist())
    if field.unit == "rad/s" and of_motor:
        return _both("no-load speed", motors.no_load_speed.tolist())
    return []


def _both(name: str, values: list[float]) -> list[tuple[str, float]]:
    """Each value with both signs."""
    signed = (
        (f"{sign}{name}", factor * v) for v in values for sign, factor in (("+", 1), ("-", -1))
    )
    return _once(signed)


def _once(named: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    """Each value once, with the name it had first. What is not finite limits nothing."""
    found: dict[float, tuple[str, float]] = {}
    for name, value in named:
        if np.isfinite(value):
            found.setdefault(round(value, 9), (name, value))
    return list(found.values())
