"""A plan over time as charts: what it does, and how near it comes to every limit.

Limits are dashed; the phases are shaded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import Phase
from ..checking.evidence import Evidence
from ..checking.plan_tests import allowed_motor_torque
from ..task.plan import JumpPlan
from .line_chart import Chart, Line

Array = NDArray[np.float64]


def charts_of(e: Evidence) -> list[Chart]:
    """All charts, three in a row."""
    charts = [
        com_chart(e.plan), velocity_chart(e.plan), momentum_chart(e.plan),
        force_chart(e), friction_chart(e), feet_chart(e),
        torque_chart(e), torque_share_chart(e), speed_chart(e),
    ]  # fmt: skip
    for chart in charts:
        chart.shaded += phases_of(e.plan)
    return charts


def phases_of(plan: JumpPlan) -> list[tuple[float, float, str]]:
    """From when to when each phase lasts, with its name."""
    changes = np.flatnonzero(np.diff(plan.phase)) + 1
    starts = np.concatenate([[0], changes])
    ends = np.append(changes, len(plan.time) - 1)
    return [
        (float(plan.time[start]), float(plan.time[end]), Phase(int(plan.phase[start])).name.lower())
        for start, end in zip(starts, ends, strict=True)
        if plan.time[end] > plan.time[start]
    ]


def com_chart(plan: JumpPlan) -> Chart:
    """The way of the centre of mass."""
    way = 100.0 * (plan.com - plan.com[0])
    lines = [Line(name, plan.time, way[:, k]) for k, name in enumerate(("forward", "left", "up"))]
    return Chart("centre of mass from standing [cm]", lines)


def velocity_chart(plan: JumpPlan) -> Chart:
    """Its velocity."""
    names = ("forward", "left", "up")
    lines = [Line(name, plan.time, plan.com_velocity[:, k]) for k, name in enumerate(names)]
    return Chart("its velocity [m/s]", lines)


def momentum_chart(plan: JumpPlan) -> Chart:
    """The angular momentum."""
    names = ("roll", "pitch", "yaw")
    lines = [Line(n, plan.time, plan.angular_momentum[:, k]) for k, n in enumerate(names)]
    return Chart("angular momentum about it [N m s]", lines)


def _steps(plan: JumpPlan) -> tuple[Array, NDArray[np.int64]]:
    """Both ends of every interval that lasts, for what is constant over it, and the intervals."""
    lasting = np.diff(plan.time) > 0.0
    time = np.repeat(plan.time, 2)[1:-1].reshape(-1, 2)[lasting].ravel()
    return time, np.repeat(np.flatnonzero(lasting), 2)


def force_chart(e: Evidence) -> Chart:
    """The vertical force on every contact, constant over each interval, and on all of them."""
    time, k = _steps(e.plan)
    up = e.plan.contact_force[k, :, 2]
    lines = [Line(c.name, time, up[:, n]) for n, c in enumerate(e.robot.contacts)]
    return Chart("vertical force of the ground [N]", [*lines, Line("all", time, up.sum(axis=1))])


def friction_chart(e: Evidence) -> Chart:
    """How much of its friction cone every contact's force uses; nothing where there is none."""
    time, k = _steps(e.plan)
    force = e.plan.contact_force[k]
    up = force[:, :, 2]
    most = e.plan.task.friction * np.where(up > 0.5, up, np.nan)
    share = 100.0 * np.hypot(force[:, :, 0], force[:, :, 1]) / most
    lines = [Line(c.name, time, share[:, n]) for n, c in enumerate(e.robot.contacts)]
    return Chart("friction used [% of the cone]", [*lines, _level("limit", time, 100.0)])


def feet_chart(e: Evidence) -> Chart:
    """The heights of the contact points, and of the ground under each of them."""
    s = e.replay.samples
    ground = 100.0 * (s.points[:, :, 2] - e.point_height)
    lines = [
        Line(contact.name, s.time, 100.0 * s.points[:, k, 2])
        for k, contact in enumerate(e.robot.contacts)
    ]
    for k in range(len(e.robot.contacts)):
        last = k == len(e.robot.contacts) - 1
        lines.append(Line("ground" if last else "", s.time, ground[:, k], level=True))
    return Chart("height of toes and heels [cm]", lines)


def torque_chart(e: Evidence) -> Chart:
    """The torques of the two busiest motors that differ, and what their speed allows each instant."""
    time, allowed = e.replay.samples.time, allowed_motor_torque(e, e.effort)
    lines, levels = [], []
    for k in _busiest(_torque_share(e), np.abs(e.motor_torque))[:2]:
        torque = e.motor_torque[:, k]
        lines.append(Line(_name(e, k), time, torque))
        # The limit on the side on which the motor works; braking and driving differ.
        level = np.where(torque < 0.0, -allowed[:, k], allowed[:, k])
        level[np.flatnonzero(np.diff(np.sign(level)))] = np.nan
        levels.append(Line("", time, level, level=True))
    levels[-1] = Line("allowed at that speed", levels[-1].x, levels[-1].y, level=True)
    return Chart("motor torque [N m]", [*lines, *levels])


def torque_share_chart(e: Evidence) -> Chart:
    """All motor torques as shares of what the motors can do at their speed."""
    return _motor_chart(e, "motor torque [% of what its speed allows]", 100.0 * _torque_share(e))


def speed_chart(e: Evidence) -> Chart:
    """Motor speeds as shares of the speed without load."""
    share = np.abs(e.motor_speed) / e.robot.profiles[e.plan.task.profile].no_load_speed
    return _motor_chart(e, "motor speed [% of no-load speed]", 100.0 * share)


def _torque_share(e: Evidence) -> Array:
    return np.asarray(np.abs(e.motor_torque) / np.maximum(allowed_motor_torque(e, 1.0), 1e-3))


def _motor_chart(e: Evidence, title: str, shares: Array) -> Chart:
    time, shares = e.replay.samples.time, np.minimum(shares, 150.0)
    named = _busiest(shares / 100.0, shares)[:3]
    lines = [
        Line(_name(e, k) if k in named else "", time, shares[:, k]) for k in range(shares.shape[1])
    ]
    return Chart(title, [*lines, _level("limit", time, 100.0 * e.effort)])


def _busiest(shares: Array, lines: Array) -> list[int]:
    """Motors in the order of their root mean square share, without those whose line hides behind another
    one's: of a jump straight ahead both legs do the same."""
    found: list[int] = []
    room = 0.05 * float(lines.max())
    for k in np.argsort(-(np.minimum(shares, 1.5) ** 2).mean(axis=0), kind="stable").tolist():
        if all(float(np.abs(lines[:, k] - lines[:, other]).max()) > room for other in found):
            found.append(k)
    return found


def _name(e: Evidence, motor: int) -> str:
    return e.robot.transmission.motors[motor].removesuffix("_motor")


def _level(name: str, time: Array, value: float) -> Line:
    return Line(name, np.array([time[0], time[-1]]), np.full(2, value), level=True)
