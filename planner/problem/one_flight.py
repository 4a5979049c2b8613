"""The grid of a jump of one flight with given times: that of the formulations ``paper``, ``srbm``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ..models.exact_dynamics import ExactDynamics, joint_motion
from ..task.errors import PlanError
from ..task.task import JumpTask


@dataclass(frozen=True)
class Grid:
    """Intervals of squat, thrust, flight and landing.

    Attributes:
        phases: of every interval.
        steps: the intervals' lengths [s].
        flight: the knots in flight, lift-off to the one before touchdown.
    """

    phases: tuple[Phase, ...]
    steps: Array
    flight: range

    @property
    def times(self) -> Array:
        """The time of every knot [s]."""
        return np.concatenate([[0.0], np.cumsum(self.steps)])


def uniform_grid(task: JumpTask, flight_time: float) -> Grid:
    """Intervals of equal length within every phase, as the paper's fixed dt.

    Raises:
        PlanError: the task asks for what only ``formulation: full`` can do.
    """
    refuse_what_only_full_can(task)
    knots = task.knots
    parts = (
        (Phase.SQUAT, knots.squat, task.squat_time or 0.0),
        (Phase.THRUST, knots.thrust, task.thrust_time or 0.0),
        (Phase.FLIGHT, knots.flight, flight_time),
        (Phase.LANDING, knots.landing, task.landing_time or 0.0),
    )
    phases = [phase for phase, count, _ in parts for _ in range(count)]
    steps = np.concatenate([np.full(count, time / count) for _, count, time in parts])
    before = knots.squat + knots.thrust
    return Grid(tuple(phases), steps, range(before, before + knots.flight))


def refuse_what_only_full_can(task: JumpTask) -> None:
    """Raise ``PlanError`` for impacts, free times, several jumps and other sequences of contacts."""
    asked = []
    if task.impact:
        asked.append("impact")
    for name in ("squat_time", "thrust_time", "landing_time"):
        if getattr(task, name) is None:
            asked.append(f"{name}: free")
    asked += [name for name in ("jumps", "repeat", "phases") if getattr(task, name) is not None]
    if asked:
        raise PlanError(
            f"{task.name}: formulation {task.formulation!r} plans one flight with given times and "
            f"feet that arrive at rest; it has no {', '.join(asked)}; use formulation: full",
            family="formulation",
        )


def ballistic_flight(task: JumpTask, *, backward_steps: int = 0) -> tuple[float, float]:
    """Vertical take-off speed [m/s] and flight time [s] from standing height to standing height.

    ``backward_steps`` is the number of steps of the paper's integration, which falls a little
    faster than the exact parabola: g T^2 (1 + 1/n) / 2.
    """
    fall = 0.5 * GRAVITY * (1.0 + (1.0 / backward_steps if backward_steps else 0.0))
    height, time = task.landing_height, task.flight_time
    if task.rise is not None:
        up = math.sqrt(2.0 * GRAVITY * task.rise)
    elif task.take_off_speed is not None:
        up = task.take_off_speed
    else:
        duration = time or math.sqrt(2.0 * max(0.15, height + 0.1) / GRAVITY) * 2.0
        return height / duration + fall * duration, duration
    if time is None:
        inside = up * up - 4.0 * fall * height
        if inside < 0.0:
            raise PlanError(
                f"{task.name}: the jump does not reach ground that is {height:g} m higher; "
                "ask for a greater rise",
                family="apex",
            )
        time = (up + math.sqrt(inside)) / (2.0 * fall)
    return up, time


def joint_torques(
    dynamics: ExactDynamics, time: Array, position: Array, velocity: Array, force: Array
) -> Array:
    """The torques [N m] that a planned motion needs in the middle of its intervals, (N, n_joints),
    by exact inverse dynamics under the planned contact forces (N, n_contacts, 3); zero at impacts."""
    torque = np.zeros((len(time), velocity.shape[1] - 6))
    for k in map(int, np.flatnonzero(np.diff(time) > 0.0)):
        motion = joint_motion(position, velocity, time, k)
        half = 0.5 * motion.duration
        _, q, v = dynamics.integrate(position[k], velocity[k], motion, force[k], half)[0]
        torque[k] = dynamics.joint_torque(q, v, motion.at(half)[2], force[k])
    torque[-1] = torque[-2]
    return torque
