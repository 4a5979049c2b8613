"""The grid of a jump of one flight with given times: that of the formulations ``paper``, ``srbm``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..signals import Phase
from .errors import PlanError
from .task import GRAVITY, JumpTask

Array = NDArray[np.float64]


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
        (Phase.SQUAT, knots.squat, task.squat_time),
        (Phase.THRUST, knots.thrust, task.thrust_time),
        (Phase.FLIGHT, knots.flight, flight_time),
        (Phase.LANDING, knots.landing, task.landing_time),
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
    asked += [name for name in ("jumps", "phases") if getattr(task, name, ())]
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
