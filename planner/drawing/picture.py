"""Draws a plan: the robot in its postures, and panels with the loads on its motors and feet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...plotting import COLOURS, FAINT, INK, draw_panels, new_figure, style, svg_text
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ..checking.clearance import legs
from ..checking.evidence import Evidence
from ..checking.replay import replay
from ..task.plan import JumpPlan
from .plan_charts import plan_panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes


POSTURES = 9
"""How many postures are shown."""
COLUMNS = 3
WIDTH, POSTURES_HEIGHT, PANEL_HEIGHT = 14.0, 2.9, 2.3
"""The picture's width, and the heights of the row of postures and of a row of panels [inch]."""


def plan_picture(plan: JumpPlan, robot: RobotDescription) -> str:
    """The picture as SVG text."""
    evidence = Evidence(plan, robot, replay(plan, robot))
    panels = plan_panels(evidence)
    rows = -(-len(panels) // COLUMNS)
    figures, jumps = evidence.figures(), len(plan.flights)
    title = (
        f"{plan.task.name}: {f'{jumps} jumps, ' if jumps > 1 else ''}rise {100 * figures['rise_m']:.1f} cm, flight "
        f"{1000 * plan.flight_time:.0f} ms, {figures['peak_motor_torque_N_m']:.1f} N m and "
        f"{figures['peak_motor_speed_rad_s']:.1f} rad/s at most"
    )
    with style():
        figure = new_figure(WIDTH, 0.5 + POSTURES_HEIGHT + rows * PANEL_HEIGHT, title)
        grid = figure.add_gridspec(
            1 + rows, COLUMNS, height_ratios=[POSTURES_HEIGHT, *[PANEL_HEIGHT] * rows]
        )
        draw_postures(figure.add_subplot(grid[0, :]), plan, robot)
        places = [
            figure.add_subplot(grid[1 + k // COLUMNS, k % COLUMNS]) for k in range(len(panels))
        ]
        draw_panels(list(zip(places, panels, strict=True)))
        return svg_text(figure)


def write_picture(path: str | Path, plan: JumpPlan, robot: RobotDescription) -> Path:
    """Write the picture to an SVG file, whose folder is made if there is none."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(plan_picture(plan, robot), encoding="utf-8")
    return path


def draw_postures(axes: Axes, plan: JumpPlan, robot: RobotDescription) -> None:
    """Draw the robot from its right side at several instants, side by side, to scale.

    Every posture has its centre of mass above its own time. The ground is drawn at the height of
    the place where the robot stands, or last stood.
    """
    knots = [plan.knot_at(float(time)) for time in posture_times(plan)]
    q = plan.position[knots]
    poses = link_poses(robot, q[:, :3], q[:, 3:7], q[:, 7:])
    levels = [standing.z for standing in plan.task.places()]
    low = min(0.0, *levels) - 0.04
    high = max(0.62, float(plan.position[:, 2].max()) + 0.25)
    spacing = (high - low) * (WIDTH - 0.4) / (POSTURES_HEIGHT - 0.3) / len(knots)
    for number, knot in enumerate(knots):
        aside = number * spacing - float(plan.com[knot, 0])
        flown = sum(plan.time[knot] >= touchdown for touchdown in plan.touchdown_times)
        ground = [(number - 0.45) * spacing, (number + 0.45) * spacing]
        axes.plot(ground, [levels[flown]] * 2, color=FAINT, linewidth=0.8)
        base, turn = (part[number] for part in poses.of(robot.base))
        top = base + turn @ np.array([0.02, 0.0, 0.2])
        for index, chain in reversed(list(enumerate(legs(robot)))):
            joints = [poses.of(link)[0][number] for link in chain]
            foot, rotation = (part[number] for part in poses.of(chain[-1]))
            ends = [
                foot + rotation @ np.array(contact.position)
                for contact in robot.contacts
                if robot.feet[index].name == contact.foot
            ]
            points = np.array([top, base, *joints, *ends, foot])
            axes.plot(
                points[:, 0] + aside, points[:, 2], color=COLOURS[index % len(COLOURS)],
                linewidth=2.2, solid_capstyle="round", gid=f"posture-{number}-leg-{index}",
            )  # fmt: skip
        axes.plot(
            number * spacing, float(plan.com[knot, 2]), "o", color="#fdd835", markersize=6,
            markeredgecolor=INK, markeredgewidth=0.7, gid=f"centre-of-mass-{number}",
        )  # fmt: skip
        axes.text(number * spacing, low, f"{plan.time[knot]:.2f} s", ha="center", va="top", size=8)
    axes.set_xlim(-0.5 * spacing, (len(knots) - 0.5) * spacing)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.set_axis_off()


def posture_times(plan: JumpPlan) -> Array:
    """Instants [s] that show the whole motion: more of them about the thrust and in the flight."""
    if plan.later_flights:
        return np.linspace(0.0, plan.time[-1], POSTURES)
    lift_off, touchdown = plan.lift_off_time, plan.touchdown_time
    return np.unique(
        np.concatenate(
            [
                [0.0, plan.time[-1]],
                np.linspace(0.5 * lift_off, lift_off, 3),
                np.linspace(lift_off, touchdown, POSTURES - 5),
                [0.5 * (touchdown + plan.time[-1])],
            ]
        )
    )
