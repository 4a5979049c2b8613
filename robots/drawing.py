"""A robot as a drawing: its links and capsules in the standing pose, from the side and in front."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..mathematics.arrays import Array
from ..plotting import COLOURS, FAINT, INK, image, new_figure, style, svg_text
from .link_poses import contact_centres, link_poses, standing_com, standing_heights
from .robot_description import RobotDescription

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Poses = Mapping[str, tuple[Array, Array]]

VIEWS = (("from the right", 0, 1.0), ("from behind", 1, -1.0))
"""The views: title, the base's axis that is horizontal in the picture, and its sign there."""
WIDTH, HEIGHT = 9.0, 5.5
"""The picture's size [inch]."""
ROUND = np.linspace(0.0, np.pi, 13)
"""The directions of the corners of a capsule's end."""


def draw_robot(robot: RobotDescription, path: Path) -> Path:
    """Draw the robot in its standing pose to a PNG or SVG file, whose folder must exist.

    Capsules are as thick as they are, each limb in a colour of its own; dots are joints, rings the
    rubber of contact points, the cross is the centre of mass.

    Raises:
        ValueError: the file's name ends in neither ``.png`` nor ``.svg``.
    """
    if path.suffix not in (".png", ".svg"):
        raise ValueError(f"a picture is a .png or .svg file, not {path.name}")
    poses = link_poses(robot, robot.standing_position)
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
            start, end = (seen(place + turn @ np.array(at)) for at in (shape.start, shape.end))
            outline = _outline(start, end, shape.radius)
            axes.fill(*outline.T, facecolor=colours[link.name], edgecolor="white", alpha=0.55)
    for joint in robot.joints:
        ends = np.array([seen(poses[joint.parent][1]), seen(poses[joint.child][1])])
        axes.plot(*ends.T, color=INK, linewidth=1.2)
        axes.plot(*ends[1], marker="o", markersize=3.0, color=INK)
    centres, links = contact_centres(robot), {foot.name: foot.link for foot in robot.feet}
    for contact, centre in zip(robot.contacts, centres, strict=True):
        turn, place = poses[links[contact.foot]]
        middle = seen(place + turn @ centre)
        axes.fill(*_outline(middle, middle, contact.radius).T, fill=False, edgecolor=INK)
    if robot.contacts:
        axes.axhline(float(standing_heights(robot).min()), color=FAINT, linewidth=1.0)
    axes.plot(*seen(standing_com(robot)), marker="x", markersize=8.0, color=INK)


def _limb_colours(robot: RobotDescription) -> dict[str, str]:
    """The base is grey, and every limb, with all that it carries, has a colour of its own."""
    colours, limbs = {robot.base: FAINT}, 0
    for joint in robot.joints:
        if joint.parent == robot.base:
            colours[joint.child] = COLOURS[limbs % len(COLOURS)]
            limbs += 1
        else:
            colours[joint.child] = colours[joint.parent]
    return colours


def _outline(start: Array, end: Array, radius: float) -> Array:
    """The corners (n, 2) of a capsule's outline from ``start`` to ``end``."""
    along = end - start
    angle = np.arctan2(along[1], along[0])
    far, near = ROUND - 0.5 * np.pi + angle, ROUND + 0.5 * np.pi + angle
    return np.concatenate([
        end + radius * np.stack([np.cos(far), np.sin(far)], axis=1),
        start + radius * np.stack([np.cos(near), np.sin(near)], axis=1),
    ])  # fmt: skip
