"""Rehearses a plan in drawn worlds and learns what makes it land upright and in its place.

What a robot misses at lift-off (``studies/rehearsing/lift_off``) is not all: the law of the flight, an early
touchdown, and a plan that itself lands leaning tilt the torso in much the same way in every world of
a jump at the motors' limit. So the graph runs the plan with a few seeds in the robust trial, and the
means over these runs are learnt away with the corrections of ``blocks.BalanceTarget``:

- the torso's tilt after touchdown, in roll and pitch the middle between its extremes, and its
  heading at touchdown, with the angular momentum;
- the place of the feet, with the horizontal velocity.

The apex is left as it is: a robot that jumps higher comes down with faster feet, and on soft ground
the middle of a foot then touches. A try is kept if more runs land, or as many with more room left; see ``Touchdown.used``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import inverse, product
from ...mathematics.rotations import wrap
from ...planner.library.rehearsed import ZERO, Deviation, Rehearsed, Vector
from ...planner.task.plan import PlannedJump
from ...runtime.graph import load
from ...runtime.running.run_result import RunResult
from .lift_off import LiftOff, deviation, in_all_worlds, missed_at_lift_off, parts_of

TRIAL = "robust"
SEEDS = tuple(range(7001, 7013))
TRIES = 5
"""Corrections that are tried after the run without any."""
LEARNT = [0, 1, 3, 4, 5]
"""Indices that are learnt of the velocity and the angular momentum in one array: all but the upward
velocity."""
GAIN = 0.8
"""Share of the mean error that a try corrects; half of it after a try that did not help."""
LARGEST = 0.08
"""The largest correction along each axis [m/s]; of the momentum this speed at the lever arm."""
GYRATION = (0.22, 0.22, 0.15)
"""Radius of gyration about each axis [heights of the centre of mass] of a robot whose legs keep
their feet in place: an angular momentum turns BRUCE by so much until touchdown."""
LEAST_SHARE = 0.5
"""Of a momentum that is spread over more than about 200 deg of turn less than this share tilts one
way; the correction is then its inverse at most."""
LOST = 2.0
"""The share used by a run that fell or never landed; no run counts as more."""
AFTER = 0.15
"""Time after touchdown in which the extremes of the tilt are searched [s]."""


@dataclass(frozen=True)
class Touchdown:
    """One run as far as its landing.

    Attributes:
        lift_off: by how much it missed the plan, and whether the run succeeded.
        error: place ahead and to the left [m], roll, pitch and heading [rad], all as actual
            minus planned, with a level torso as planned; (5,), or ``None`` without a touchdown.
        used: the larger share used of what the score allows, of the tilt and of the place.
    """

    lift_off: LiftOff
    error: Array | None
    used: float


Measure = Callable[[Vector, Vector], Sequence[Touchdown]]
"""Runs a plan with a velocity and a momentum correction, once with every seed."""


def response(plan: PlannedJump, mass: float) -> Array:
    """Compute the matrix (5, 5) from changes of the values ``LEARNT`` to the errors of a
    ``Touchdown``.

    A velocity moves the landing by itself times the flight. An angular momentum k turns the robot
    at k / (m r^2) with r from ``GYRATION``; in roll and pitch it turns a robot that has the heading
    psi about Rz(-psi) k in its own axes.
    """
    start, end = plan.lift_off_time, plan.touchdown_time
    flight = end - start
    inertia = mass * (np.array(GYRATION) * float(plan.com[0, 2])) ** 2
    headings = np.unwrap(angles_of(plan.position[:, 3:7])[:, 2])
    heading = np.interp(np.linspace(start, end, 33), plan.time, headings)
    cos, sin = float(np.cos(heading).mean()), float(np.sin(heading).mean())
    size = float(np.hypot(cos, sin))
    share = max(LEAST_SHARE, size) / max(1e-9, size)
    found = np.eye(5)
    found[:2] *= flight
    found[2:4, 2:4] = share * np.array([[cos, sin], [-sin, cos]])
    found[2:] *= flight / inertia[:, None]
    return found


def angles_of(quaternions: Array) -> Array:
    """Compute roll, pitch and heading [rad] of quaternions x, y, z, w, (..., 4) to (..., 3)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, heading], axis=-1)


def learn_landing(
    measure: Measure, answer: Array, momentum_unit: float, *, tries: int = TRIES, seeds: Sequence[int] = SEEDS,
    on_try: Callable[[str], None] = lambda text: None,
) -> Rehearsed:  # fmt: skip
    """Learn the corrections with which a plan lands.

    Args:
        measure: runs the plan.
        answer: how the errors of a landing answer a correction, from ``response``.
        momentum_unit: the angular momentum [N m s] that counts as much as 1 m/s.
        tries: how many corrections are tried at most.
        seeds: those that ``measure`` uses, for the record.
        on_try: is told what is being done.
    """
    unit = np.array([1.0] * 3 + [momentum_unit] * 3)
    on_try("landings without a correction")
    runs = measure(ZERO, ZERO)
    before = best = runs
    correction, gain, kept = np.zeros(6), GAIN, 0
    back = inverse(answer)
    for number in range(1, tries + 1):
        # A robot that stumbled says nothing of how the others land.
        errors = [run.error for run in best if run.error is not None and run.used < LOST]
        if not errors:
            break
        step = np.zeros(6)
        step[LEARNT] = product(back, np.mean(errors, axis=0))
        changed = np.clip(correction - gain * step, -LARGEST * unit, LARGEST * unit).round(5)
        landed, used = _quality(best)
        on_try(f"correction {number} of {tries}; {landed} of {len(best)} land, {used:.0%} used")
        found = measure(*parts_of(changed))
        better = _quality(found)
        if (-better[0], better[1]) < (-landed, used):
            correction, best, kept = changed, found, kept + 1
        else:
            gain *= 0.5
    (first, most), (last, least) = _quality(before), _quality(best)
    if kept:
        reason = (
            f"{last} instead of {first} of {len(best)} landings; they use {least:.0%} instead of "
            f"{most:.0%} of the tilt or place that is allowed, in the mean"
        )
    else:
        reason = f"no correction of {tries} tried lands more often, or with more room left"
    velocity, momentum = parts_of(correction)
    return Rehearsed(
        velocity, momentum, _at_lift_off(before, unit), _at_lift_off(best, unit), tuple(seeds),
        TRIAL, reason,
    )  # fmt: skip


def _quality(runs: Sequence[Touchdown]) -> tuple[int, float]:
    """Return the number of runs that landed, and the mean share used."""
    return sum(run.lift_off.landed for run in runs), float(np.mean([run.used for run in runs]))


def _at_lift_off(runs: Sequence[Touchdown], unit: Array) -> Deviation:
    return deviation([run.lift_off for run in runs], unit)


def rehearse_landing(
    path: Path, overrides: Sequence[str], parameters: dict[str, str], answer: Array,
    momentum_unit: float, *, on_try: Callable[[str], None] = lambda text: None,
) -> Rehearsed:  # fmt: skip
    """Rehearse the landing of a graph's plan on all processors; see ``learn_landing``.

    Args:
        path, overrides: the graph that will run the plan. Its trial and seed are replaced.
        parameters: from ``corrected_parameters``.
        answer: from ``response``.
        momentum_unit: the angular momentum [N m s] that counts as much as 1 m/s.

    Raises:
        LoadError: the graph may not run.
        AloftError: a run could not be made.
    """
    measure = in_all_worlds(path, overrides, parameters, TRIAL, SEEDS, run_landing, "the landing")
    return learn_landing(measure, answer, momentum_unit, on_try=on_try)


def run_landing(job: tuple[Path, Sequence[str]]) -> Touchdown:
    """Run a graph once as far as its landing."""
    path, overrides = job
    graph = load(path, overrides)
    allowed: Any = graph.checked.block("score").params
    result = graph.run()
    result.raise_if_failed()
    return touchdown_of(result, allowed)


def touchdown_of(result: RunResult, allowed: Any) -> Touchdown:
    """Measure a run's errors at its landing.

    Args:
        allowed: the parameters of its ``blocks.JumpScore``.
    """
    missed, metrics = missed_at_lift_off(result), result.metrics
    lift_off = LiftOff(missed, result.success)
    if missed is None or "jump_distance_x_m" not in metrics:
        return Touchdown(lift_off, None, LOST)
    time = np.asarray(result.signal("plan.reference.time"), np.float64)
    lifted = float(result.signal("plan.reference.lift_off_time")[0])
    landed = float(result.signal("plan.reference.touchdown_time")[0])
    loaded = np.asarray(result.signal("robot.truth.contact_touched").any(axis=1), np.bool_)
    flying = int(np.searchsorted(time, 0.5 * (lifted + landed)))
    first = flying + int(np.argmax(loaded[flying:]))
    until = int(np.searchsorted(time, time[first] + AFTER))
    angles = angles_of(np.asarray(result.signal("robot.truth.base_orientation"), np.float64))
    planned = angles_of(np.asarray(result.signal("plan.reference.orientation"), np.float64))
    after = angles[first : max(until, first + 1)]
    roll, pitch = 0.5 * (after.min(axis=0) + after.max(axis=0))[:2]
    due = min(int(np.searchsorted(time, landed)), len(time) - 1)
    turned = float(angles[first, 2] - planned[due, 2])
    heading = wrap(turned)
    x, y = (float(metrics[f"jump_distance_{axis}_m"]) for axis in "xy")
    goal = allowed.distance if allowed.distance is not None else [x, y]
    off = np.array([x - goal[0], y - goal[1]])
    tilt = np.radians(float(metrics["peak_tilt_deg"])) / allowed.peak_tilt
    place = float(np.abs(off).max()) / allowed.distance_tolerance
    error = np.array([*off, roll, pitch, heading])
    return Touchdown(lift_off, error, min(LOST, max(float(tilt), place)))
