"""Draws a plan: the robot in its postures, and panels over time with its motion and its distance from every limit.

Limits are thin, grey and dashed; the phases are shaded.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...plotting import (
    COLOURS,
    FAINT,
    INK,
    Curve,
    Panel,
    Shade,
    draw_panels,
    new_figure,
    style,
    svg_text,
)
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ..checking.evidence import Evidence
from ..checking.plan_tests import allowed_motor_torque
from ..checking.replay import replay
from ..models.link_shapes import legs
from ..task.phase import Phase
from ..task.plan import PlannedJump

if TYPE_CHECKING:
    from matplotlib.axes import Axes


POSTURES = 9
"""Number of postures shown."""
COLUMNS = 3
WIDTH, POSTURES_HEIGHT, PANEL_HEIGHT = 14.0, 2.9, 2.3
"""The picture's width, and the heights of the row of postures and of a row of panels [inch]."""


def plan_picture(plan: PlannedJump, robot: RobotDescription) -> str:
    """Return the picture as SVG text."""
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


def write_picture(path: str | Path, plan: PlannedJump, robot: RobotDescription) -> Path:
    """Write the picture to an SVG file, whose folder is made if there is none."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(plan_picture(plan, robot), encoding="utf-8")
    return path


def draw_postures(axes: Axes, plan: PlannedJump, robot: RobotDescription) -> None:
    """Draw the robot from its right side at several instants, side by side, to scale.

    Every posture has its centre of mass above its own time. The ground is drawn as it is where the
    robot stands, or last stood.
    """
    knots = [plan.knot_at(float(time)) for time in posture_times(plan)]
    q = plan.position[knots]
    poses = link_poses(robot, q[:, :3], q[:, 3:7], q[:, 7:])
    places = plan.task.places()
    low = min(0.0, *(standing.z for standing in places)) - 0.04
    high = max(0.62, float(plan.position[:, 2].max()) + 0.25)
    spacing = (high - low) * (WIDTH - 0.4) / (POSTURES_HEIGHT - 0.3) / len(knots)
    for number, knot in enumerate(knots):
        aside = number * spacing - float(plan.com[knot, 0])
        flown = sum(plan.time[knot] >= touchdown for touchdown in plan.touchdown_times)
        ground = (number + np.array([-0.45, 0.45])) * spacing
        heights = places[flown].height(ground - aside, places[flown].y)
        axes.plot(ground, heights, color=FAINT, linewidth=0.8, gid=f"ground-{number}")
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


def posture_times(plan: PlannedJump) -> Array:
    """Return the instants [s] that show the whole motion: more of them about the thrust and in the flight."""
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


OTHER = "#b4bdc6"
"""The colour of motors that have no name in a panel."""
MOST_SHARE = 150.0
"""Shares of what a motor can do are drawn up to here [%]."""


def plan_panels(e: Evidence) -> list[Panel]:
    """Return all panels of a plan, three in a row; the last row labels x."""
    shades = phases_of(e.plan)
    rows = [
        com_lines(e.plan), velocity_lines(e.plan), momentum_lines(e.plan),
        force_lines(e), friction_lines(e), feet_lines(e),
        torque_lines(e), torque_share_lines(e), speed_lines(e),
    ]  # fmt: skip
    last = len(rows) - 3
    return [
        Panel(title, lines, "time [s]" if number >= last else "", None, shades)
        for number, (title, lines) in enumerate(rows)
    ]


def phases_of(plan: PlannedJump) -> list[Shade]:
    """Return the start and end of each phase [s], with its name."""
    changes = np.flatnonzero(np.diff(plan.phase)) + 1
    starts = np.concatenate([[0], changes])
    ends = np.append(changes, len(plan.time) - 1)
    names = [Phase(int(plan.phase[start])).name.lower() for start in starts]
    return [
        Shade(float(plan.time[start]), float(plan.time[end]), name, name)
        for start, end, name in zip(starts, ends, names, strict=True)
        if plan.time[end] > plan.time[start]
    ]


def com_lines(plan: PlannedJump) -> tuple[str, list[Curve]]:
    """Return the path of the centre of mass, from where it stands at first."""
    path = 100.0 * (plan.com - plan.com[0])
    lines = [Curve(name, plan.time, path[:, k]) for k, name in enumerate(("forward", "left", "up"))]
    return "centre of mass, from standing [cm]", lines


def velocity_lines(plan: PlannedJump) -> tuple[str, list[Curve]]:
    """Return the velocity of the centre of mass."""
    names = ("forward", "left", "up")
    lines = [Curve(name, plan.time, plan.com_velocity[:, k]) for k, name in enumerate(names)]
    return "velocity of the centre of mass [m/s]", lines


def momentum_lines(plan: PlannedJump) -> tuple[str, list[Curve]]:
    """Return the angular momentum about the centre of mass."""
    names = ("roll", "pitch", "yaw")
    lines = [Curve(n, plan.time, plan.angular_momentum[:, k]) for k, n in enumerate(names)]
    return "angular momentum about the centre of mass [N m s]", lines


def force_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return the vertical force on every contact point, and the sum of all; constant over each interval."""
    time, k = _interval_ends(e.plan)
    up = e.plan.contact_force[k, :, 2]
    lines = [Curve(c.name, time, up[:, n]) for n, c in enumerate(e.robot.contacts)]
    return "vertical contact force [N]", [*lines, Curve("all", time, up.sum(axis=1))]


def friction_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return the share of its friction cone that the force on every contact point uses; no line without force."""
    time, k = _interval_ends(e.plan)
    force = e.plan.contact_force[k]
    up = force[:, :, 2]
    most = e.plan.task.friction * np.where(up > 0.5, up, np.nan)
    share = 100.0 * np.hypot(force[:, :, 0], force[:, :, 1]) / most
    lines = [Curve(c.name, time, share[:, n]) for n, c in enumerate(e.robot.contacts)]
    return "friction used [% of the cone]", [*lines, _limit(time, 100.0)]


def feet_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return the heights of the contact points, and of the ground under each of them."""
    s = e.replay.samples
    ground = 100.0 * (s.points[:, :, 2] - e.point_height)
    lines = [
        Curve(contact.name, s.time, 100.0 * s.points[:, k, 2])
        for k, contact in enumerate(e.robot.contacts)
    ]
    for k in range(len(e.robot.contacts)):
        last = k == len(e.robot.contacts) - 1
        lines.append(Curve("ground" if last else "", s.time, ground[:, k], limit=True))
    return "height of the contact points [cm]", lines


def torque_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return the torques of the two motors that work hardest, and what their speed allows at each instant.

    Of two motors that do the same, as the legs' do in a jump straight ahead, one is shown.
    """
    time, allowed = e.replay.samples.time, allowed_motor_torque(e, e.effort)
    lines, limits = [], []
    for k in _busiest(_torque_share(e), np.abs(e.motor_torque))[:2]:
        torque = e.motor_torque[:, k]
        lines.append(Curve(_name(e, k), time, torque))
        # The limit on the side on which the motor works; braking and driving differ.
        limit = np.where(torque < 0.0, -allowed[:, k], allowed[:, k])
        limit[np.flatnonzero(np.diff(np.sign(limit)))] = np.nan
        limits.append(Curve("", time, limit, limit=True))
    limits[-1] = Curve("limit at its speed", limits[-1].x, limits[-1].y, limit=True)
    return "motor torque [N m]", [*lines, *limits]


def torque_share_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return all motor torques as shares of what the motors can do at their speed."""
    lines = _motor_lines(e, 100.0 * _torque_share(e))
    return "motor torque [% of the limit at its speed]", lines


def speed_lines(e: Evidence) -> tuple[str, list[Curve]]:
    """Return the motor speeds as shares of the speed without load."""
    share = np.abs(e.motor_speed) / e.plan.task.equipped(e.robot).motors.no_load_speed
    return "motor speed [% of the no-load speed]", _motor_lines(e, 100.0 * share)


def _interval_ends(plan: PlannedJump) -> tuple[Array, NDArray[np.int64]]:
    """Return the times of both ends of every interval that has a length, and the interval's number.

    Lines of what is constant over each interval have these points.
    """
    lasting = plan.lasting
    time = np.repeat(plan.time, 2)[1:-1].reshape(-1, 2)[lasting].ravel()
    return time, np.repeat(lasting, 2)


def _torque_share(e: Evidence) -> Array:
    """Return the motor torques as shares of what the motors can do at their speed, (samples, n_motors)."""
    return np.asarray(np.abs(e.motor_torque) / np.maximum(allowed_motor_torque(e, 1.0), 1e-3))


def _motor_lines(e: Evidence, shares: Array) -> list[Curve]:
    """Return the three motors that work hardest with their names, all others grey below them, the limit."""
    time, shares = e.replay.samples.time, np.minimum(shares, MOST_SHARE)
    named = _busiest(shares / 100.0, shares)[:3]
    others = [k for k in range(shares.shape[1]) if k not in named]
    lines = [Curve("", time, shares[:, k], OTHER) for k in others]
    lines += [Curve(_name(e, k), time, shares[:, k]) for k in named]
    limit = Curve("limit", time, 100.0 * e.effort[:, 0], limit=True)
    return [*lines, limit]


def _busiest(shares: Array, lines: Array) -> list[int]:
    """Return the motors in the order of their root mean square share, the largest first.

    A motor whose line is hidden behind the line of one before it is left out: in a jump straight
    ahead both legs do the same.
    """
    found: list[int] = []
    room = 0.05 * float(lines.max())
    for k in np.argsort(-(np.minimum(shares, 1.5) ** 2).mean(axis=0), kind="stable").tolist():
        if all(float(np.abs(lines[:, k] - lines[:, other]).max()) > room for other in found):
            found.append(k)
    return found


def _name(e: Evidence, motor: int) -> str:
    return e.robot.transmission.motors[motor].removesuffix("_motor")


def _limit(time: Array, value: float) -> Curve:
    """Return a limit that does not change."""
    return Curve("limit", np.array([time[0], time[-1]]), np.full(2, value), limit=True)
