"""The part of a run that figures need: its outcome, and some signals at every tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...runtime.language.errors import AloftError
from ...studies.execution import outcome_of
from ...studies.expansion import Job, seeded_graph
from ...studies.journal import Outcome

TRUTH: tuple[str, ...] = (
    "base_position", "base_orientation", "joint_position", "joint_velocity", "com", "com_velocity",
    "angular_momentum", "contact_position", "contact_force", "contact_touched",
)  # fmt: skip
REFERENCE = ("com", "com_velocity", "angular_momentum", "orientation", "phase")
SIGNALS = (
    *(f"robot.truth.{name}" for name in TRUTH),
    *(f"plan.reference.{name}" for name in REFERENCE),
    "robot.joints.torque",
    "landing.feet.landing",
    "push.push.force",
)
SHORTEST_FLIGHT = 0.02
"""Without load for less [s] is no flight."""


@dataclass(frozen=True)
class Trace:
    """A run: its outcome, and its signals by their names, (ticks, ...)."""

    task: str
    seed: int
    outcome: Outcome
    time: Array
    signals: Mapping[str, Array]

    def truth(self, name: str) -> Array:
        """Return a signal that only the simulator knows."""
        return self.signals[f"robot.truth.{name}"]

    def plan(self, name: str) -> Array:
        """Return a signal of the planned motion."""
        return self.signals[f"plan.reference.{name}"]

    @property
    def flight(self) -> slice | None:
        """The ticks of the first flight, from the first without load; ``None`` without one."""
        loaded: list[bool] = np.atleast_1d(self.truth("contact_touched").any(axis=1)).tolist()
        start: int | None = None
        for tick, standing in enumerate([*loaded, True]):
            if not standing:
                start = tick if start is None else start
            elif start is not None:
                if self.time[min(tick, len(self.time) - 1)] - self.time[start] >= SHORTEST_FLIGHT:
                    return slice(start, tick)
                start = None
        return None

    @property
    def flight_times(self) -> tuple[float, float] | None:
        """Lift-off and touchdown [s]."""
        ticks = self.flight
        if ticks is None:
            return None
        return float(self.time[ticks.start]), float(self.time[min(ticks.stop, len(self.time) - 1)])

    @property
    def feet(self) -> Array:
        """The middle of each foot's contact points [m, world], (ticks, n_feet, 3)."""
        points = self.truth("contact_position")
        return np.asarray(points.reshape(len(points), -1, 2, 3).mean(axis=2))


def make_trace(task_and_job: tuple[str, Job]) -> Trace:
    """Make a run and keep what figures need, in the process that does the work.

    Raises:
        AloftError: the run broke, or the process was told to stop.
    """
    task, work = task_and_job
    result = seeded_graph(work).run()
    outcome = outcome_of(result)
    if outcome.error:
        raise AloftError(f"{task}: {outcome.error}")
    known = set(result.signals())
    kept: dict[str, Any] = {
        name: np.ascontiguousarray(result.signal(name)) for name in SIGNALS if name in known
    }
    return Trace(task, work.seed, outcome, result.time, kept)


def pitch_and_roll(quaternions: Array) -> tuple[Array, Array]:
    """Compute pitch about y and roll about x [rad] of quaternions x, y, z, w (n, 4): yaw, pitch,
    roll."""
    x, y, z, w = np.moveaxis(np.asarray(quaternions, float), -1, 0)
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return pitch, roll
