"""Writes the short YAML that a URDF or MJCF file needs beside it, as far as it can be found."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..robot_description import RobotDescription
from ..validation.faults import number, vector


def yaml_text(
    file: str, robot: RobotDescription, feet: list[dict[str, Any]], notes: list[str]
) -> str:
    """The YAML's text.

    Args:
        file: what the YAML's key ``file`` says.
        robot: as it was read with these feet.
        feet: that were guessed, as ``guess_feet`` gives them.
        notes: what the file lacks, which become comments.
    """
    lines = [
        f"# What {Path(file).name} does not say of the robot. Everything here was guessed or found by",
        "# `aloft robot import`: look at each part, correct it, and write where its numbers are from.",
        f"file: {file}",
        f"name: {robot.name}",
        'text: ""',
        f"base_joint: {robot.base_joint}",
        "",
    ]
    lines += [f"# {note}." for note in notes]
    lines += ["", *_feet(feet), "", *_profile(robot), "", *_sensors(robot)]
    if feet:
        lines += ["", *_angles("standing", robot.standing)]
    lines += [
        "",
        "# Joints that stand still at an angle while the robot is at work: arms, a waist.",
    ]
    lines.append("held: {}")
    return "\n".join(lines) + "\n"


def _feet(feet: list[dict[str, Any]]) -> list[str]:
    if not feet:
        return [
            "# No feet were found: nothing reaches down. Without any, leave this out.",
            "feet: []",
        ]
    lines = [
        "# GUESSED: the ends of the limbs that reach lowest. `at` is a link of the file, `ball` the",
        "# centre of a ball foot in its frame, `points` the lowest points of a sole.",
        "feet:",
    ]
    for foot in feet:
        lines.append(f"  - name: {foot['name']}")
        lines.append(f"    at: {foot['at']}")
        if "ball" in foot and any(foot["ball"]):
            lines.append(f"    ball: {vector(foot['ball'])}")
        if "points" in foot:
            lines.append("    points:")
            lines += [f"      - {vector(point)}" for point in foot["points"]]
        lines.append(f"    radius: {number(foot['radius'])}")
    return lines


def _profile(robot: RobotDescription) -> list[str]:
    rated = robot.profiles["rated"]
    keys = ("peak_torque", "corner_speed", "no_load_speed", "continuous_torque")
    lines = [
        "# From the file: peak torques (effort limits) and no-load speeds (speed limits). ASSUMED: the",
        "# torque falls from 0.6 of the no-load speed on, and two fifths of it can be held for long.",
        "# MISSING where zero: rotor inertia at the gearbox output, friction, damping. A value given",
        "# here counts for all motors; `motors: {NAME or PATTERN: {peak_torque: ...}}` for some.",
        "profiles:",
        "  rated:",
    ]
    values = {key: getattr(rated, key) for key in keys}
    if rated.motors:
        lines.append("    # " + ", ".join(f"{key}: {number(v)}" for key, v in values.items()))
    else:
        lines += [f"    {key}: {number(value)}" for key, value in values.items()]
    for key in ("rotor_inertia", "friction", "damping"):
        lines.append(f"    {key}: {number(getattr(rated, key))}")
    return lines


def _sensors(robot: RobotDescription) -> list[str]:
    text = f"{{imu: {str(robot.sensors.imu).lower()}, switches: {str(robot.sensors.switches).lower()}}}"
    return [
        "# ASSUMED: an IMU at the base's origin, and a switch in every contact point.",
        f"sensors: {text}",
    ]


def _angles(key: str, angles: Mapping[str, float]) -> list[str]:
    lines = ["# Found: soles on one level, the centre of mass over their middle.", f"{key}:"]
    return lines + [f"  {name}: {round(angle, 9):.9g}" for name, angle in angles.items()]
