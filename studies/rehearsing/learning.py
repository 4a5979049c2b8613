"""Learns from a robot's own jumps what the next one needs, from one run at a time.

What a run says of itself is compared with its plan, by the robot's own estimates and never by a simulator's
truth, so a recording of a real robot will do:

- how far the middle of the feet moved from its planned place, which is corrected by the velocity. The
  estimator is a few centimetres off after a flight, because it cannot change what it has already said; a
  robot that rests before and after knows better (``moved_feet``);
- the time without contact says how fast it left the ground, which the velocity corrects, too;
- the torso's roll and pitch after touchdown, the middle between their extremes, and its heading, which
  are corrected by the angular momentum at lift-off.

The answer of a landing to a correction is that of ``studies/rehearsing/landing``, which learns the same from
many simulated worlds. What is learnt is kept as ``planner/library/learnt`` says, and ``blocks.JumpPlan``
takes it into use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import inverse, product
from ...mathematics.rotations import wrap
from ...planner.library.learnt import LARGEST, Lesson, launch_of
from ...planner.library.rehearsed import Vector
from ...planner.task.plan import PlannedJump
from .landing import AFTER, LEARNT, angles_of, response
from .lift_off import LEVER

BEFORE = 0.1
"""Time before lift-off in which the feet stand where they stood at the start [s]."""
STANDING = 10
"""Ticks before the plan begins to move."""
FURTHER = 1.4
"""A change of the velocity at lift-off moves the feet by more than the flight alone says: the centre of
mass has moved in the thrust already, and the landing places the feet ahead of it."""
SHORTER = 0.041
"""Difference of the planned flight and the time without contact [s] where a jump is as high as planned:
contacts end late and begin early, because feet are drawn up before they land. Over twelve tasks of BRUCE from 2 to
18 cm, ahead, back, aside, turned, up and down, it is 35 to 47 ms in the robust trial."""
SPEED_OF_TIME = 3.3
"""Change of vertical velocity at lift-off with a change of this time [m/s^2]: for BRUCE 0.05 m/s
with 15 ms. A ball's would be g / 2."""
SETTLED = 0.15
"""Time after touchdown from which on the feet stand in their new place [s]."""
MOST_TILT = 0.35
"""Largest tilt from which a lesson is drawn [rad]; a larger one shows only that it was too large."""
RUNGS = (0.02, 0.05, 0.08, 0.12)
"""Rises of the jumps in place that come before the requested one [m]."""
Signals = Callable[[str], Array]
"""The values of a signal in every tick, by its name."""


def ladder(asked: Mapping[str, float], rise: float) -> list[dict[str, float]]:
    """Return smaller jumps: in place, as high as the ``RUNGS`` and as asked, then half as far and
    turned."""
    found = [{"rise": rung} for rung in RUNGS if rung < rise - 0.005]
    half = {
        name: 0.5 * asked[name] for name in ("distance_x", "distance_y", "twist") if name in asked
    }
    if half:
        found += [{"rise": rise}, {"rise": rise, **half}]
    return found


def lesson_of(
    signals: Signals, plan: PlannedJump, mass: float, applied: tuple[Vector, Vector],
    measured_place: tuple[float, float] | None = None,
) -> Lesson | None:  # fmt: skip
    """Return the lesson of one run; ``None`` where its task cannot be learnt, such as a row of
    jumps, or it never flew and landed.

    Args:
        signals: of the run.
        plan: what the robot was to do.
        mass: of the robot [kg].
        applied: the learnt corrections that this run had, of velocity and angular momentum.
        measured_place: by how much the feet moved, ahead and to the left [m], where somebody has
            measured it; by default the robot's estimate.
    """
    launch = launch_of(plan.task) if len(plan.task.hops()) == 1 else None
    missed = None if launch is None else landing_error(signals, measured_place)
    if launch is None or missed is None:
        return None
    answer = response(plan, mass)
    answer[:2] *= FURTHER
    needed = np.zeros(6)
    needed[LEARNT] = product(inverse(answer), missed)
    needed[2] = speed_error(signals)
    needed = np.array(applied[0] + applied[1]) - needed
    unit = mass * LEVER * float(plan.com[0, 2])
    limit = LARGEST * np.array([1.0] * 3 + [unit] * 3)
    x, y, z, kx, ky, kz = np.clip(needed, -limit, limit).round(5).tolist()
    ahead, left, roll, pitch, yaw = missed.round(5).tolist()
    return Lesson(
        plan.task.name, launch, (x, y, z), (kx, ky, kz), (ahead, left), (roll, pitch, yaw)
    )


def flight(signals: Signals) -> tuple[Array, float, float, NDArray[np.bool_], int]:
    """Return the plan's time in every tick, its lift-off and touchdown [s], whether any point was
    loaded in every tick, and the tick in the middle of the planned flight."""
    time = np.asarray(signals("plan.reference.time"), np.float64)
    lifted = float(signals("plan.reference.lift_off_time")[0])
    landed = float(signals("plan.reference.touchdown_time")[0])
    loaded = np.asarray(signals("contacts.state.active").any(axis=1), np.bool_)
    return time, lifted, landed, loaded, int(np.searchsorted(time, 0.5 * (lifted + landed)))


def landing_error(signals: Signals, measured_place: tuple[float, float] | None) -> Array | None:
    """Compute actual minus planned: place ahead and to the left [m], roll, pitch and heading [rad],
    (5,).

    The torso is planned to be level. ``None`` without a flight and a landing.
    """
    time, lifted, landed, loaded, flying = flight(signals)
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
        com = np.asarray(signals("plan.reference.com"), np.float64)
        moving = int(np.argmax(np.abs(com - com[0]).max(axis=1) > 1e-6))
        resting = max(0, moving - STANDING)
        x, y, _ = moved_feet(signals, resting, settled, float(time[1] - time[0]))
        turned = float(angles[0, 2] - planned[0, 2])  # where the robot looked at the start
        cos, sin = np.cos(turned), np.sin(turned)
        measured_place = (cos * x + sin * y, cos * y - sin * x)
    yaw = wrap(float((angles[first, 2] - angles[0, 2]) - (planned[due, 2] - planned[0, 2])))
    tilt = np.clip([roll, pitch, yaw], -MOST_TILT, MOST_TILT)
    return np.array([measured_place[0] - ahead, measured_place[1] - left, *tilt])


def speed_error(signals: Signals) -> float:
    """Compute actual minus planned vertical velocity at lift-off [m/s], of a run that flew and
    landed."""
    time, lifted, landed, loaded, flying = flight(signals)
    ticks = int(np.argmax(loaded[flying:])) + int(np.argmax(loaded[:flying][::-1]))
    without_contact = ticks * float(time[1] - time[0])
    return SPEED_OF_TIME * (without_contact + SHORTER - (landed - lifted))


def moved_feet(signals: Signals, start: int, end: int, period: float) -> Array:
    """Integrate the motion of the middle of the feet between two ticks in both of which they stand
    [m, world], (3,).

    The specific force is integrated twice, in the axes of the estimated orientation. At both ends the
    estimator knows the velocity from the legs; what the first integral misses of the last one is the mean
    error of the acceleration, and taken away.
    """
    rotation = rotation_matrices(np.asarray(signals("estimator.base.orientation"), np.float64))
    force = np.asarray(signals("robot.imu.specific_force"), np.float64)
    speed = np.asarray(signals("estimator.base.linear_velocity"), np.float64)
    acceleration = product(rotation[start + 1 : end + 1], force[start + 1 : end + 1, :, None])[
        ..., 0
    ]
    velocity = speed[start] + period * np.cumsum(acceleration, axis=0)
    share = np.arange(1, len(velocity) + 1)[:, None] / len(velocity)
    velocity += share * (speed[end] - velocity[-1])
    feet = np.asarray(signals("dynamics.terms.foot_position"), np.float64).mean(axis=1)
    beside = feet - np.asarray(signals("ahead.base.position"), np.float64)
    return np.asarray(period * velocity.sum(axis=0) + beside[end] - beside[start])


def rotation_matrices(quaternions: Array) -> Array:
    """Convert quaternions x, y, z, w, (n, 4), to matrices (n, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _moved(feet: Array, start: int, end: int) -> tuple[float, float]:
    """Return the motion of the middle of the feet (ticks, feet, 3) between two ticks [m]."""
    x, y, _ = (np.asarray(feet[end]) - np.asarray(feet[start])).mean(axis=0)
    return float(x), float(y)
