"""A plan as a picture: the robot in its postures, and how hard its motors and feet work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ..checking.clearance import legs
from ..checking.evidence import Evidence
from ..checking.replay import replay
from ..task.plan import JumpPlan
from .line_chart import COLOURS, page
from .plan_charts import charts_of

Array = NDArray[np.float64]

WIDTH, STRIP, CHART = 1080.0, 210.0, 230.0
"""The page's width and the heights of the postures and of a row of charts [px]."""
POSTURES = 9


def plan_picture(plan: JumpPlan, robot: RobotDescription) -> str:
    """The picture as SVG text."""
    evidence = Evidence(plan, robot, replay(plan, robot))
    each = WIDTH / 3.0
    parts = [postures(plan, robot)]
    for number, chart in enumerate(charts_of(evidence)):
        row, column = divmod(number, 3)
        parts.append(chart.svg(column * each, 36.0 + STRIP + row * CHART, each, CHART))
    figures, jumps = evidence.figures(), len(plan.flights)
    title = (
        f"{plan.task.name}: {f'{jumps} jumps, ' if jumps > 1 else ''}rise {100 * figures['rise_m']:.1f} cm, flight "
        f"{1000 * plan.flight_time:.0f} ms, {figures['peak_motor_torque_N_m']:.1f} N m and "
        f"{figures['peak_motor_speed_rad_s']:.1f} rad/s at most"
    )
    return page(title, parts, WIDTH, 36.0 + STRIP + 3.0 * CHART)


def write_picture(path: str | Path, plan: JumpPlan, robot: RobotDescription) -> Path:
    """Write the picture to an SVG file."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(plan_picture(plan, robot), encoding="utf-8")
    return path


def postures(plan: JumpPlan, robot: RobotDescription) -> str:
    """The robot from its right side at instants in the order of time, each in its own place."""
    times = posture_times(plan)
    knots = [plan.knot_at(float(time)) for time in times]
    q = plan.position[knots]
    poses = link_poses(robot, q[:, :3], q[:, 3:7], q[:, 7:])
    low, high = -0.02, max(0.62, float(plan.position[:, 2].max()) + 0.25)
    levels = [standing.z for standing in plan.task.places()]
    deepest = min(0.0, *levels)
    scale = (STRIP - 20.0) / (high - low - deepest)
    bottom = 30.0 + STRIP - 20.0 + scale * deepest
    place = WIDTH / len(knots)
    out = []
    for number, knot in enumerate(knots):
        centre = (number + 0.5) * place - scale * float(plan.com[knot, 0])

        def point(p: Array, centre: float = centre) -> str:
            return f"{centre + scale * float(p[0]):.1f},{bottom - scale * float(p[2]):.1f}"

        flown = sum(plan.time[knot] >= touchdown for touchdown in plan.touchdown_times)
        level = bottom - scale * levels[flown]
        left = number * place + 6.0
        out.append(
            f'<line x1="{left:.1f}" y1="{level:.1f}" x2="{left + place - 12:.1f}" y2="{level:.1f}" '
            'stroke="#999999"/>'
        )
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
            line = " ".join(map(point, [top, base, *joints, *ends, foot]))
            out.append(
                f'<polyline points="{line}" fill="none" stroke="{COLOURS[index]}" '
                'stroke-width="2.5" stroke-linejoin="round"/>'
            )
        x, y = point(plan.com[knot]).split(",")
        out.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="#fdd835" stroke="#444444"/>')
        out.append(
            f'<text x="{(number + 0.5) * place:.1f}" y="{30 + STRIP:.1f}" text-anchor="middle">'
            f"{plan.time[knot]:.2f} s</text>"
        )
    return "\n".join(out)


def posture_times(plan: JumpPlan) -> Array:
    """Instants that show the whole motion [s]."""
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
