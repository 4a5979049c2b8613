"""Searches for the nearest task that can be planned, where the given task cannot.

The search changes one parameter at a time between the given value and a modest one, by bisection over round
values. It takes several solves, so only commands whose user waits for an answer call it; loading or running a
graph never does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ...robots.description import RobotDescription
from ..checking.binding import what_binds
from ..checking.validity import InvalidPlanError
from ..solving.bounded import cpu_time
from ..task.errors import PlanError, TaskError
from ..task.plan import JumpPlan
from ..task.task import JumpTask
from .library import SCALES, Solver, solve_and_check

MOST_SOLVES = 10
MOST_SECONDS = 6.0
"""Processor time after which no further solve is begun [s]."""


@dataclass(frozen=True)
class Axis:
    """A parameter that may be changed: a modest value, the steps of the search, and how people
    write it: ``shown`` per SI unit, in ``unit``."""

    modest: float
    step: float
    shown: float
    unit: str

    def text(self, value: float) -> str:
        """A value with its unit."""
        return f"{round(value * self.shown, 6):g} {self.unit}".strip()


DEGREE = math.pi / 180.0
AXES = {
    "rise": Axis(0.08, 0.005, 100.0, "cm"),
    "take_off_speed": Axis(1.2, 0.05, 1.0, "m/s"),
    "distance_x": Axis(0.0, 0.01, 100.0, "cm"),
    "distance_y": Axis(0.0, 0.01, 100.0, "cm"),
    "twist": Axis(0.0, 2.0 * DEGREE, 1.0 / DEGREE, "deg"),
    "landing_height": Axis(0.0, 0.005, 100.0, "cm"),
    "foot_clearance": Axis(0.02, 0.0025, 1000.0, "mm"),
    "leg_clearance": Axis(0.01, 0.0025, 1000.0, "mm"),
    "friction": Axis(0.7, 0.025, 1.0, ""),
    "effort": Axis(1.0, 0.025, 1.0, ""),
}
"""The parameters that may be changed."""

FIRST = {
    "apex": ("rise", "take_off_speed"),
    "motor torque": ("rise", "take_off_speed", "effort"),
    "motor torque at speed": ("rise", "take_off_speed", "effort"),
    "motor speed": ("rise", "take_off_speed", "effort"),
    "held joints": ("rise", "take_off_speed", "effort"),
    "friction": ("distance_x", "distance_y", "friction"),
    "footholds": ("distance_x", "distance_y", "twist", "landing_height"),
    "ground clearance": ("foot_clearance", "landing_height"),
    "leg clearance": ("twist", "leg_clearance"),
}
"""By constraint family, which parameters are tried first."""


@dataclass(frozen=True)
class NearestFeasible:
    """What was found.

    Attributes:
        parameter: which one was changed.
        asked, value: what was asked for and what can be planned, in SI units.
        beyond: the value nearest to it that could not be planned.
        solves, cpu_s: what the search cost.
        plan: the valid plan of the changed task.
        binds: what of the robot that plan uses to the full.
    """

    parameter: str
    asked: float
    value: float
    beyond: float
    solves: int
    cpu_s: float
    plan: JumpPlan
    binds: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """One line for people, with a value to paste."""
        axis = AXES[self.parameter]
        binds = f"; what binds: {', '.join(self.binds)}" if self.binds else ""
        return (
            f"{self.parameter}: {axis.text(self.asked)} is beyond the robot; the nearest that can be "
            f"planned is {self.parameter}: {axis.text(self.value)}; {axis.text(self.beyond)} cannot"
            f"{binds} ({self.solves} solves, {self.cpu_s:.1f} s)"
        )


def nearest_feasible(
    task: JumpTask,
    robot: RobotDescription,
    *,
    family: str = "",
    solve: Solver | None = None,
    seconds: float = MOST_SECONDS,
    progress: Callable[[str], None] = lambda _: None,
) -> NearestFeasible | None:
    """Search for a task that differs in one parameter and has a valid plan; ``None`` if a short
    search finds none.

    ``family`` is the constraint family that could not be met; it decides what is tried first.
    ``progress`` is told what is being tried.
    """
    search = _Search(task, robot, solve, seconds, progress)
    for parameter in candidates(task, family):
        found = search.along(parameter)
        if found is not None:
            return found
        if search.spent:
            break
    return None


def candidates(task: JumpTask, family: str) -> list[str]:
    """The parameters that the task sets to something else than a modest value: those that the
    constraint speaks of, then those that are furthest from modest."""
    far: dict[str, float] = {}
    for name in AXES:
        values = values_towards(task, name)
        if len(values) > 1:
            far[name] = abs(values[-1] - values[0]) / SCALES[name]
    first = [name for name in FIRST.get(family, ()) if name in far]
    return list(dict.fromkeys([*first, *sorted(far, key=lambda name: -far[name])]))


def values_towards(task: JumpTask, parameter: str) -> list[float]:
    """From the modest value to what is asked for, in round steps; empty where the task leaves the
    parameter as it is."""
    asked, axis = getattr(task, parameter), AXES[parameter]
    if asked is None or asked == JumpTask.model_fields[parameter].default:
        return []
    modest = axis.modest
    if parameter == "rise":
        modest += max(0.0, task.landing_height)
    way = asked - modest
    count = math.ceil(abs(way) / axis.step - 1e-6)
    sign = math.copysign(1.0, way)
    return [*(round(modest + sign * k * axis.step, 9) for k in range(count)), asked]


def _only_from_near(solve: Solver | None, start: JumpPlan | None) -> Solver:
    """The planner, which gives up soon where it has a plan to start from."""
    from ..solving.solve import solve_jump

    def make(task: JumpTask, robot: RobotDescription, warm_start: JumpPlan | None) -> JumpPlan:
        if solve is not None:
            return solve(task, robot, warm_start)
        return solve_jump(task, robot, warm_start=warm_start, quick=start is not None)

    return make


class _Search:
    """The solves so far, and the bound on them."""

    def __init__(
        self,
        task: JumpTask,
        robot: RobotDescription,
        solve: Solver | None,
        seconds: float,
        progress: Callable[[str], None],
    ) -> None:
        self._task, self._robot, self._solve = task, robot, solve
        self._seconds, self._progress = seconds, progress
        self._started = cpu_time()
        self._solves = 0

    @property
    def cpu(self) -> float:
        """Processor time so far [s]."""
        return cpu_time() - self._started

    @property
    def spent(self) -> bool:
        """Whether no further solve is begun."""
        return self._solves >= MOST_SOLVES or self.cpu > self._seconds

    def along(self, parameter: str) -> NearestFeasible | None:
        """The best value of one parameter; ``None`` where even the modest one has no plan."""
        values = values_towards(self._task, parameter)
        plan = self._try(parameter, values[0], None)
        if plan is None:
            return None
        good, bad = 0, len(values) - 1
        while bad - good > 1 and not self.spent:
            middle = (good + bad) // 2
            better = self._try(parameter, values[middle], plan)
            if better is None:
                bad = middle
            else:
                good, plan = middle, better
        return NearestFeasible(
            parameter, values[-1], values[good], values[bad], self._solves, self.cpu, plan,
            what_binds(plan, self._robot),
        )  # fmt: skip

    def _try(self, parameter: str, value: float, start: JumpPlan | None) -> JumpPlan | None:
        """A valid plan with that value, or ``None``."""
        self._progress(f"{parameter}: {AXES[parameter].text(value)}")
        self._solves += 1
        task = self._task.model_copy(update={parameter: value})
        try:
            return solve_and_check(task, self._robot, start, _only_from_near(self._solve, start))
        except (PlanError, InvalidPlanError, TaskError):
            return None
