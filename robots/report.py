"""A robot's description for people who look at it: a summary as plain data, and a drawing of the standing pose."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..mathematics.arrays import Array
from ..plotting import COLOURS, FAINT, INK, image, new_figure, style, svg_text
from .description import ReadRobot
from .kinematics import contact_centres, link_poses_in_base, standing_com, standing_heights
from .limb import foot_shape
from .robot_description import RobotDescription

if TYPE_CHECKING:
    from matplotlib.axes import Axes


RATING_UNITS = {
    "peak_torque": "N m", "corner_speed": "rad/s", "no_load_speed": "rad/s",
    "continuous_torque": "N m", "rotor_inertia": "kg m^2", "friction": "N m",
    "damping": "N m s/rad",
}  # fmt: skip
"""The units of a motor's ratings where it turns its joints."""
SHAPES = {0: "point", 1: "line", 2: "flat"}


def report(read: ReadRobot) -> dict[str, Any]:
    """Return the content of ``aloft robot show``."""
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
            "unit": mounted.unit("rad") if mounted else "",
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
        "thrusters": [
            {"thruster": name, **each.model_dump(mode="json")}
            for name, each in robot.thrusters.items()
        ],
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
            "mounted": {
                name: f"{part.kind} on {part.link}" for name, part in robot.sensors.mounted.items()
            },
        },
        "points": list(robot.points),
        "missing": missing(read),
    }


def missing(read: ReadRobot) -> list[str]:
    """Return what a description lacks or assumes, each with what to write."""
    robot = read.description
    found = list(read.notes)
    if robot.base_joint != "fixed" and not robot.feet and not robot.thrusters:
        found.append(
            "there are no feet, so the robot can be simulated but not stand or jump; write them "
            "under feet: [{name: NAME, at: LINK, radius: METRES}], or let aloft robot import guess"
        )
    if robot.joints and not np.any(robot.motors.rotor_inertia):
        found.append("rotor inertia is zero; write rotor_inertia under profiles")
    if robot.joints and not np.any(robot.motors.friction) and not np.any(robot.motors.damping):
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
            "units": {key: robot.motor_unit(k, unit) for key, unit in RATING_UNITS.items()},
            "peak_torque": float(motors.peak_torque[k]),
            "corner_speed": float(motors.corner_speed[k]),
            "no_load_speed": float(motors.no_load_speed[k]),
            "continuous_torque": float(motors.continuous_torque[k]),
            "rotor_inertia": float(motors.rotor_inertia[k]),
            "friction": float(motors.friction[k]),
            "damping": float(motors.damping[k]),
        })  # fmt: skip
    return rows


Poses = Mapping[str, tuple[Array, Array]]

VIEWS = (("from the right", 0, 1.0), ("from behind", 1, -1.0))
"""The views: title, the base's axis that is horizontal in the picture, and its sign there."""
WIDTH, HEIGHT = 9.0, 5.5
"""The picture's size [inch]."""
AROUND = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
"""The directions of the points of a shape's outline [rad]."""


def draw_robot(robot: RobotDescription, path: Path) -> Path:
    """Draw the robot in its standing pose to a PNG or SVG file, whose folder must exist.

    Shapes are as thick as they are, each limb in a colour of its own; dots are joints, rings the
    rubber of contact points, the cross is the centre of mass.

    Raises:
        ValueError: the file's name ends in neither ``.png`` nor ``.svg``.
    """
    if path.suffix not in (".png", ".svg"):
        raise ValueError(f"a picture is a .png or .svg file, not {path.name}")
    poses = link_poses_in_base(robot, robot.standing_position)
    with style():
        figure = new_figure(WIDTH, HEIGHT, f"{robot.name}, {robot.total_mass:.4g} kg, as it stands")
        for column, (title, axis, sign) in enumerate(VIEWS):
            axes = figure.add_subplot(1, 2, column + 1)
            axes.set_title(title)
            _draw(axes, robot, poses, axis, sign)
            axes.set_aspect("equal", "datalim")
            axes.set_xlabel(f"{'-' if sign < 0.0 else ''}{'xy'[axis]} [m]")
        if path.suffix == ".svg":
            path.write_text(svg_text(figure), encoding="utf-8")
        else:
            image(figure).save(path)
    return path


def _draw(axes: Axes, robot: RobotDescription, poses: Poses, axis: int, sign: float) -> None:
    def seen(place: Array) -> Array:
        return np.array([sign * place[axis], place[2]])

    colours = _limb_colours(robot)
    for link in robot.links:
        turn, place = poses[link.name]
        for shape in link.shapes:
            corners = np.array([seen(place + turn @ np.array(at)) for at in shape.corners])
            outline = _outline(corners, shape.radius)
            axes.fill(*outline.T, facecolor=colours[link.name], edgecolor="white", alpha=0.55)
    for joint in robot.joints:
        ends = np.array([seen(poses[joint.parent][1]), seen(poses[joint.child][1])])
        axes.plot(*ends.T, color=INK, linewidth=1.2)
        axes.plot(*ends[1], marker="o", markersize=3.0, color=INK)
    centres, links = contact_centres(robot), {foot.name: foot.link for foot in robot.feet}
    for contact, centre in zip(robot.contacts, centres, strict=True):
        turn, place = poses[links[contact.foot]]
        middle = seen(place + turn @ centre)
        axes.fill(*_outline(middle[None], contact.radius).T, fill=False, edgecolor=INK)
    if robot.contacts:
        axes.axhline(float(standing_heights(robot).min()), color=FAINT, linewidth=1.0)
    axes.plot(*seen(standing_com(robot)), marker="x", markersize=8.0, color=INK)


def _limb_colours(robot: RobotDescription) -> dict[str, str]:
    """Return the colours of the links: grey for the base, one for every limb with all that it carries."""
    colours, limbs = {robot.base: FAINT}, 0
    for joint in robot.joints:
        if joint.parent == robot.base:
            colours[joint.child] = COLOURS[limbs % len(COLOURS)]
            limbs += 1
        else:
            colours[joint.child] = colours[joint.parent]
    return colours


def _outline(corners: Array, radius: float) -> Array:
    """Return the outline (n, 2) of a shape with these corners (m, 2) that reaches beyond them by ``radius``."""
    ahead = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=1)
    return np.asarray(corners[(corners @ ahead.T).argmax(axis=0)] + radius * ahead)
