"""What bounds a field, as far as the robot's description says: drawn as lines into its plot."""

from __future__ import annotations

import numpy as np

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
    names = {str(value) for value in header.parameters.values()}
    profile = next((p for name, p in robot.profiles.items() if name in names), None)
    if profile is None:
        return []
    motor = "motor" in field.field_name
    if field.unit == "N m" and motor:
        return _both("peak torque", [profile.peak_torque])
    if field.unit == "N m":
        peaks = np.abs(robot.joint_to_motor.T).sum(axis=1) * profile.peak_torque
        return _both("peak torque", sorted(set(peaks.tolist())))
    if field.unit == "rad/s" and motor:
        return _both("no-load speed", [profile.no_load_speed])
    return []


def _both(name: str, values: list[float]) -> list[tuple[str, float]]:
    return [(f"{sign}{name}", factor * v) for v in values for sign, factor in (("+", 1), ("-", -1))]


def _once(named: list[tuple[str, float]]) -> list[tuple[str, float]]:
    """Each value once, with the name it had first."""
    found: dict[float, str] = {}
    for name, value in named:
        found.setdefault(round(value, 9), name)
    return [(name, value) for value, name in found.items()]
