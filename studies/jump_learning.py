"""Learns from a robot's own jumps what the next one needs, from one run at a time.

What a run says of itself is compared with its plan, by the robot's own estimates and never by a simulator's
truth, so a recording of a real robot will do:

- how far the middle of the feet moved from its planned place, which is corrected by the velocity;
- the torso's roll and pitch after touchdown, the middle between their extremes, and its heading, which
  are corrected by the angular momentum at lift-off.

The answer of a landing to a correction is that of ``studies/landing_rehearsal``, which learns the same from
many simulated worlds. What is learnt is kept as ``planner/library/learnt`` says, and ``blocks.JumpPlan``
takes it into use.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import inverse, product
from ..planner.library.learnt import LARGEST, Lesson, launch_of
from ..planner.library.rehearsed import Vector
from ..planner.task.plan import PlannedJump
from .landing_rehearsal import AFTER, LEARNT, angles_of, response
from .rehearsal import LEVER

BEFORE = 0.1
"""s before lift-off in which the feet stand where they stood at the start."""
SETTLED = 0.15
"""s after touchdown from which on the feet stand in their new place."""
MOST_TILT = 0.35
"""A tilt [rad] beyond this says no more than that it was too much."""
Signals = Callable[[str], Array]
"""The values of a signal in every tick, by its name."""


def lesson_of(
    signals: Signals, plan: PlannedJump, mass: float, applied: tuple[Vector, Vector],
    measured_place: tuple[float, float] | None = None,
) -> Lesson | None:  # fmt: skip
    """What one run teaches; ``None`` where its task cannot be learnt, or it never flew and landed.

    Args:
        signals: of the run.
        plan: what the robot was to do.
        mass: of the robot [kg].
        applied: the learnt corrections that this run had, of velocity and angular momentum.
        measured_place: by how much the feet moved, ahead and to the left [m], where somebody has
            measured it; by default the robot's estimate.
    """
    launch = launch_of(plan.task)
    missed = None if launch is None else landing_error(signals, measured_place)
    if launch is None or missed is None:
        return None
    needed = np.zeros(6)
    needed[LEARNT] = product(inverse(response(plan, mass)), missed)
    needed = np.array(applied[0] + applied[1]) - needed
    unit = mass * LEVER * float(plan.com[0, 2])
    limit = LARGEST * np.array([1.0] * 3 + [unit] * 3)
    x, y, z, kx, ky, kz = np.clip(needed, -limit, limit).round(5).tolist()
    ahead, left, roll, pitch, yaw = missed.round(5).tolist()
    return Lesson(
        plan.task.name, launch, (x, y, z), (kx, ky, kz), (ahead, left), (roll, pitch, yaw)
    )


def landing_error(signals: Signals, measured_place: tuple[float, float] | None) -> Array | None:
    """Actual minus planned: place ahead and to the left [m], roll, pitch and heading [rad], (5,).

    The torso is planned to be level. ``None`` without a flight and a landing.
    """
    time = np.asarray(signals("plan.reference.time"), np.float64)
    lifted = float(signals("plan.reference.lift_off_time")[0])
    landed = float(signals("plan.reference.touchdown_time")[0])
    loaded = np.asarray(signals("contacts.state.active").any(axis=1), np.bool_)
    flying = int(np.searchsorted(time, 0.5 * (lifted + landed)))
    start = int(np.searchsorted(time, lifted - BEFORE))
    if flying >= len(time) or loaded[flying] or not loaded[flying:].any():
        return None
    first = flying + int(np.argmax(loaded[flying:]))
    if time[-1] < time[first] + SETTLED:
        return None
    until, settled = (int(np.searchsorted(time, time[first] + late)) for late in (AFTER, SETTLED))
    angles = angles_of(np.asarray(signals("estimator.base.orientation"), np.float64))
    planned = angles_of(np.asarray(signals("plan.reference.orientation"), np.float64))
    after = angles[first:until]
    roll, pitch = 0.5 * (after.min(axis=0) + after.max(axis=0))[:2]
    due = min(int(np.searchsorted(time, landed)), len(time) - 1)
    ahead, left = _moved(signals("plan.reference.foot_position"), start, due)
    if measured_place is None:
        x, y = _moved(signals("dynamics.terms.foot_position"), start, settled)
        turned = float(angles[0, 2] - planned[0, 2])  # where the robot looked at the start
        cos, sin = np.cos(turned), np.sin(turned)
        measured_place = (cos * x + sin * y, cos * y - sin * x)
    yaw = float((angles[first, 2] - angles[0, 2]) - (planned[due, 2] - planned[0, 2]))
    yaw = float(np.arctan2(np.sin(yaw), np.cos(yaw)))
    tilt = np.clip([roll, pitch, yaw], -MOST_TILT, MOST_TILT)
    return np.array([measured_place[0] - ahead, measured_place[1] - left, *tilt])


def _moved(feet: Array, start: int, end: int) -> tuple[float, float]:
    """By how much the middle of the feet (ticks, feet, 3) moves between two ticks [m]."""
    x, y, _ = (np.asarray(feet[end]) - np.asarray(feet[start])).mean(axis=0)
    return float(x), float(y)
