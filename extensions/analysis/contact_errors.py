"""False and missed contacts, one by one, and what each did to the estimate of the base.

A contact is false while the estimator counts with a point that carries no load, and missed while it does not
count with one that does. What it did is found exactly: the estimator alone runs once more on its recorded
inputs, in which this one contact is as it was in truth, and the two estimates are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...logs.replay.replay import KeptRun, replay
from ...logs.replay.stand_in import StandIn
from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from .deviations import Deviation, stretches
from .robot_run import RobotRun

SHORTEST = 0.02
"""Contacts that are wrong for less [s] are switches that bounce."""
LONG = 0.04
"""A detector holds a contact for 20 ms after its switch has opened; from here on [s] it is no such wait."""
HEIGHT, SPEED, TILT = 0.002, 0.03, 0.005
"""Smallest effects on the estimate for which a brief wrong contact counts [m, m/s, rad]."""
LOAD = 3.0
"""A point with less [N] need not close its switch."""
LATER = 0.05
"""The effect is seen so long [s] after the contact is right again: an estimator that learns of it then has
taken it into account."""


@dataclass(frozen=True)
class ContactError:
    """A contact that the estimator took for another.

    Attributes:
        point: the name of the contact point.
        false: whether the estimator counted with it and it carried no load; else it missed it.
        first, last: rows of the run.
        begin, duration: when it began, and how long it lasted [s].
        load: the mean load on it meanwhile [N].
        height, forward, left: what it added to the estimated position of the base [m].
        velocity: and to the estimated velocity, forward, left and up [m/s].
        tilt: the angle by which it tilted the estimate [rad].
    """

    point: str
    false: bool
    first: int
    last: int
    load: float
    begin: float
    duration: float
    height: float = 0.0
    forward: float = 0.0
    left: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tilt: float = 0.0

    @property
    def effect(self) -> str:
        """Effect on the estimate, in words."""
        x, y, z = self.velocity
        return (
            f"height {1e3 * self.height:+.1f} mm, place {1e3 * self.forward:+.1f}, "
            f"{1e3 * self.left:+.1f} mm, velocity {x:+.3f}, {y:+.3f}, {z:+.3f} m/s, tilt {np.degrees(self.tilt):.2f} deg"
        )

    @property
    def matters(self) -> bool:
        """True if it lasted long or changed the estimate."""
        moved = max(abs(self.height), abs(self.forward), abs(self.left))
        return (
            self.duration >= LONG or moved > HEIGHT or self.tilt > TILT
            or float(np.linalg.norm(self.velocity)) > SPEED
        )  # fmt: skip

    def as_deviation(self, run: RobotRun) -> Deviation:
        """Return the same as a link of the chain."""
        end = float(run.time[self.last])
        name = f"{'false' if self.false else 'missed'} contact of {self.point}"
        if not self.false:
            name += f" with a load of {self.load:.3g} N"
        return Deviation(
            "contact", name, self.begin, end, run.phase_at(self.first), 1e3 * self.duration, end, 1e3 * LONG,
            "ms",
            self.effect,
        )  # fmt: skip


def contact_errors(run: RobotRun) -> list[ContactError]:
    """Return all false and missed contacts, by when they begin, each with what it did to the estimate."""
    found = sorted(_errors(run), key=lambda error: (error.first, error.point))
    return [_with_effect(run, error) for error in found]


def _errors(run: RobotRun) -> Iterator[ContactError]:
    if not run.contacts:
        return
    counted = run(run.contacts, "active")
    force = np.linalg.norm(run(run.truth, "contact_force"), axis=2)
    for k, contact in enumerate(run.robot.contacts):
        active, touched = counted[:, k], run.touched[:, k]
        missed = ~active & touched & (force[:, k] > LOAD)
        for false, wrong in ((True, active & ~touched), (False, missed)):
            for first, last in stretches(wrong):
                duration = (last - first + 1) * run.period
                if duration >= SHORTEST - 1e-9:
                    load, begin = float(force[first : last + 1, k].mean()), float(run.time[first])
                    yield ContactError(contact.name, false, first, last, load, begin, duration)


def _with_effect(run: RobotRun, error: ContactError) -> ContactError:
    """Return the error with its effect: the recorded estimate less the one with the true contact; without it
    where the estimator's code is not aloft's, which is not run to look at a run."""
    if issubclass(run.run.graph.block(run.estimator).block_type, StandIn):
        return error
    view = run.run.bus.view
    start, _ = run.run.bus.byte_range(f"{run.contacts}.active")  # a byte for each point
    start += [contact.name for contact in run.robot.contacts].index(error.point)
    rows = run.rows.copy()
    rows[error.first : error.last + 1, start] = not error.false
    seen = min(error.last + round(LATER / run.period), len(rows) - 1)
    kept = KeptRun(
        run.run.graph, run.run.bus, run.run.state, run.run.ticks, rows,
        {tick: run.run.keyframe(tick) for tick in run.run.keyframes}, tuple(run.run.changes),
    )  # fmt: skip
    ticks = run.run.ticks
    done = replay(
        kept, run=[run.estimator], first_tick=int(ticks[error.first]),
        last_tick=int(ticks[seen]) + 1, keep=True,
    )  # fmt: skip

    def change(field: str) -> Array:
        recorded = view(run.rows[seen : seen + 1], f"{run.base}.{field}")[0]
        with_truth = view(done.rows[-1:], f"{run.base}.{field}")[0]
        return np.array([recorded, with_truth])

    (was, other), velocity = change("position"), change("linear_velocity")
    up = matrices_of_quaternions(change("orientation"))[:, 2]
    x, y, z = (velocity[0] - velocity[1]).tolist()
    return replace(
        error, height=float(was[2] - other[2]), forward=float(was[0] - other[0]),
        left=float(was[1] - other[1]), velocity=(x, y, z),
        tilt=float(np.linalg.norm(np.cross(up[0], up[1]))),
    )  # fmt: skip
