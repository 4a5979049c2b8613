"""Draws a plan over time in panels: its motion, and its distance from every limit.

Limits are thin, grey and dashed; the phases are shaded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...plotting import Line, Panel, Shade
from ..checking.evidence import Evidence
from ..checking.plan_tests import allowed_motor_torque
from ..task.plan import JumpPlan

OTHER = "#b4bdc6"
"""The colour of motors that have no name in a panel."""
MOST_SHARE = 150.0
"""Shares of what a motor can do are drawn up to here [%]."""


def plan_panels(e: Evidence) -> list[Panel]:
    """All panels of a plan, three in a row; the last row says what x is."""
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


def phases_of(plan: JumpPlan) -> list[Shade]:
    """From when to when each phase lasts [s], with its name."""
    changes = np.flatnonzero(np.diff(plan.phase)) + 1
    starts = np.concatenate([[0], changes])
    ends = np.append(changes, len(plan.time) - 1)
    names = [Phase(int(plan.phase[start])).name.lower() for start in starts]
    return [
        Shade(float(plan.time[start]), float(plan.time[end]), name, name)
        for start, end, name in zip(starts, ends, names, strict=True)
        if plan.time[end] > plan.time[start]
    ]


def com_lines(plan: JumpPlan) -> tuple[str, list[Line]]:
    """The path of the centre of mass, from where it stands at first."""
    path = 100.0 * (plan.com - plan.com[0])
    lines = [Line(name, plan.time, path[:, k]) for k, name in enumerate(("forward", "left", "up"))]
    return "centre of mass, from standing [cm]", lines


def velocity_lines(plan: JumpPlan) -> tuple[str, list[Line]]:
    """The velocity of the centre of mass."""
    names = ("forward", "left", "up")
    lines = [Line(name, plan.time, plan.com_velocity[:, k]) for k, name in enumerate(names)]
    return "velocity of the centre of mass [m/s]", lines


def momentum_lines(plan: JumpPlan) -> tuple[str, list[Line]]:
    """The angular momentum about the centre of mass."""
    names = ("roll", "pitch", "yaw")
    lines = [Line(n, plan.time, plan.angular_momentum[:, k]) for k, n in enumerate(names)]
    return "angular momentum about the centre of mass [N m s]", lines


def force_lines(e: Evidence) -> tuple[str, list[Line]]:
    """The vertical force on every contact point, and the sum of all; constant over each interval."""
    time, k = _interval_ends(e.plan)
    up = e.plan.contact_force[k, :, 2]
    lines = [Line(c.name, time, up[:, n]) for n, c in enumerate(e.robot.contacts)]
    return "vertical contact force [N]", [*lines, Line("all", time, up.sum(axis=1))]


def friction_lines(e: Evidence) -> tuple[str, list[Line]]:
    """How much of its friction cone the force on every contact point uses; no line without force."""
    time, k = _interval_ends(e.plan)
    force = e.plan.contact_force[k]
    up = force[:, :, 2]
    most = e.plan.task.friction * np.where(up > 0.5, up, np.nan)
    share = 100.0 * np.hypot(force[:, :, 0], force[:, :, 1]) / most
    lines = [Line(c.name, time, share[:, n]) for n, c in enumerate(e.robot.contacts)]
    return "friction used [% of the cone]", [*lines, _limit(time, 100.0)]


def feet_lines(e: Evidence) -> tuple[str, list[Line]]:
    """The heights of the contact points, and of the ground under each of them."""
    s = e.replay.samples
    ground = 100.0 * (s.points[:, :, 2] - e.point_height)
    lines = [
        Line(contact.name, s.time, 100.0 * s.points[:, k, 2])
        for k, contact in enumerate(e.robot.contacts)
    ]
    for k in range(len(e.robot.contacts)):
        last = k == len(e.robot.contacts) - 1
        lines.append(Line("ground" if last else "", s.time, ground[:, k], limit=True))
    return "height of the contact points [cm]", lines


def torque_lines(e: Evidence) -> tuple[str, list[Line]]:
    """The torques of the two motors that work hardest, and what their speed allows at each instant.

    Of two motors that do the same, as the legs' do in a jump straight ahead, one is shown.
    """
    time, allowed = e.replay.samples.time, allowed_motor_torque(e, e.effort)
    lines, limits = [], []
    for k in _busiest(_torque_share(e), np.abs(e.motor_torque))[:2]:
        torque = e.motor_torque[:, k]
        lines.append(Line(_name(e, k), time, torque))
        # The limit on the side on which the motor works; braking and driving differ.
        limit = np.where(torque < 0.0, -allowed[:, k], allowed[:, k])
        limit[np.flatnonzero(np.diff(np.sign(limit)))] = np.nan
        limits.append(Line("", time, limit, limit=True))
    limits[-1] = Line("limit at its speed", limits[-1].x, limits[-1].y, limit=True)
    return "motor torque [N m]", [*lines, *limits]


def torque_share_lines(e: Evidence) -> tuple[str, list[Line]]:
    """All motor torques as shares of what the motors can do at their speed."""
    lines = _motor_lines(e, 100.0 * _torque_share(e))
    return "motor torque [% of the limit at its speed]", lines


def speed_lines(e: Evidence) -> tuple[str, list[Line]]:
    """Motor speeds as shares of the speed without load."""
    share = np.abs(e.motor_speed) / e.plan.task.equipped(e.robot).motors.no_load_speed
    return "motor speed [% of the no-load speed]", _motor_lines(e, 100.0 * share)


def _interval_ends(plan: JumpPlan) -> tuple[Array, NDArray[np.int64]]:
    """The times of both ends of every interval that has a length, and the interval's number.

    Lines of what is constant over each interval have these points.
    """
    lasting = np.diff(plan.time) > 0.0
    time = np.repeat(plan.time, 2)[1:-1].reshape(-1, 2)[lasting].ravel()
    return time, np.repeat(np.flatnonzero(lasting), 2)


def _torque_share(e: Evidence) -> Array:
    """The motor torques as shares of what the motors can do at their speed, (samples, n_motors)."""
    return np.asarray(np.abs(e.motor_torque) / np.maximum(allowed_motor_torque(e, 1.0), 1e-3))


def _motor_lines(e: Evidence, shares: Array) -> list[Line]:
    """The three motors that work hardest with their names, all others grey below them, the limit."""
    time, shares = e.replay.samples.time, np.minimum(shares, MOST_SHARE)
    named = _busiest(shares / 100.0, shares)[:3]
    others = [k for k in range(shares.shape[1]) if k not in named]
    lines = [Line("", time, shares[:, k], OTHER) for k in others]
    lines += [Line(_name(e, k), time, shares[:, k]) for k in named]
    limit = Line("limit", time, 100.0 * e.effort[:, 0], limit=True)
    return [*lines, limit]


def _busiest(shares: Array, lines: Array) -> list[int]:
    """The motors in the order of their root mean square share, the largest first.

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


def _limit(time: Array, value: float) -> Line:
    """A limit that does not change."""
    return Line("limit", np.array([time[0], time[-1]]), np.full(2, value), limit=True)
