"""A summary of a description as plain data, for people who look at a robot and for programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from .limb import foot_shape
from .reading import ReadRobot
from .robot_description import RobotDescription

SHAPES = {0: "point", 1: "line", 2: "flat"}


def report(read: ReadRobot) -> dict[str, Any]:
    """Everything that ``aloft robot show`` prints."""
    robot = read.description
    carrier = {joint.child: joint for joint in robot.joints}
    depth = {robot.base: 0}
    for joint in robot.joints:
        depth[joint.child] = depth[joint.parent] + 1
    links = []
    for link in _branch_by_branch(robot):
        mounted = carrier.get(link)
        links.append({
            "link": link,
            "depth": depth[link],
            "mass_kg": robot.link(link).mass,
            "shapes": len(robot.link(link).shapes),
            "joint": mounted.name if mounted else "",
            "kind": mounted.kind if mounted else robot.base_joint,
            "axis": list(mounted.axis) if mounted else [],
            "limits": list(mounted.limits) if mounted and mounted.limits else None,
            "stands_at": _angle(robot, mounted.name) if mounted else None,
            "held": mounted.name in robot.held if mounted else False,
        })  # fmt: skip
    return {
        "name": robot.name,
        "text": robot.text,
        "file": str(read.path),
        "model_file": str(read.model_file) if read.model_file else None,
        "base": robot.base,
        "base_joint": robot.base_joint,
        "mass_kg": robot.total_mass,
        "dimensions": dict(robot.dimensions),
        "links": links,
        "profile": robot.motors.profile,
        "profiles": list(robot.profiles),
        "motors": _motors(robot),
        "feet": [
            {
                "foot": foot.name,
                "kind": SHAPES[int(foot_shape(robot, k)[0])],
                "link": foot.link,
                "contacts": [c.name for c in robot.contacts if c.foot == foot.name],
            }
            for k, foot in enumerate(robot.feet)
        ],
        "sensors": {
            "encoders": len(robot.joints),
            "imu": robot.sensors.imu,
            "switches": len(robot.contacts) if robot.sensors.switches else 0,
        },
        "points": list(robot.points),
        "missing": missing(read),
    }


def missing(read: ReadRobot) -> list[str]:
    """What a description lacks or assumes, each with what to write."""
    robot = read.description
    found = list(read.notes)
    if robot.base_joint != "fixed" and not robot.feet:
        found.append(
            "there are no feet, so the robot can be simulated but not stand or jump; write them "
            "under feet: [{name: NAME, at: LINK, radius: METRES}], or let aloft robot import guess"
        )
    if not np.any(robot.motors.rotor_inertia):
        found.append("rotor inertia is zero; write rotor_inertia under profiles")
    if not np.any(robot.motors.friction) and not np.any(robot.motors.damping):
        found.append("joints have no friction; write friction and damping under profiles")
    bare = [link.name for link in robot.links if not link.shapes]
    if len(bare) == len(robot.links):
        found.append("no link has a shape, so nothing but contact points can touch anything")
    return found


def _branch_by_branch(robot: RobotDescription) -> list[str]:
    return [robot.base, *(joint.child for joint in robot.joints)]


def _angle(robot: RobotDescription, joint: str) -> float:
    return {**robot.standing, **robot.held}.get(joint, 0.0)


def _motors(robot: RobotDescription) -> list[dict[str, Any]]:
    motors, rows = robot.motors, []
    for k, name in enumerate(robot.transmission.motors):
        gears = robot.joint_to_motor[k]
        joints = [
            joint.name for joint, gear in zip(robot.joints, gears, strict=True) if gear != 0.0
        ]
        rows.append({
            "motor": name,
            "joints": joints,
            "peak_torque": float(motors.peak_torque[k]),
            "corner_speed": float(motors.corner_speed[k]),
            "no_load_speed": float(motors.no_load_speed[k]),
            "continuous_torque": float(motors.continuous_torque[k]),
            "rotor_inertia": float(motors.rotor_inertia[k]),
            "friction": float(motors.friction[k]),
            "damping": float(motors.damping[k]),
        })  # fmt: skip
    return rows
