"""Searches for the nearest task that can be planned, where the given task cannot.

The search changes one parameter at a time between the given value and a modest one, in strides and then by bisection over
round values. It begins at the farthest value that a kept plan of a similar task has, else at the modest one. Where that finds nothing, because more than one is beyond the robot, all that say how far the jump goes
change together, each by the same share of its way. It takes several solves, so only commands whose user waits
for an answer call it; loading or running a graph never does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ...robots.description import RobotDescription
from ..checking.plan_tests import active_limits
from ..solving.solver_process import cpu_time
from ..task.files import JumpTaskError, PlanError
from ..task.plan import InvalidPlanError, PlannedJump
from ..task.task import JumpTask
from .library import SCALES, PlanLibrary, Solver, solve_and_check

MOST_SOLVES = 14
MOST_SECONDS, LEAST_SECONDS = 6.0, 2.0
"""Processor time after which no further solve is begun [s]; and where the task itself took long."""
ALTOGETHER = 8.5
"""s of processor time after which no further solve is begun, with what the task itself took."""
STRIDES, FIRST_STRIDES = 8, 4
"""Least numbers of steps on the way to the wanted values, from a kept plan's value and from a modest one."""
SINGLE = 2
"""Number of parameters that are changed on their own before all are changed together."""
TOGETHER = ("rise", "take_off_speed", "distance_x", "distance_y", "twist", "landing_height")
UPWARDS = ("rise", "take_off_speed", "landing_height")
SHARES = 20
"""Steps of the way from a modest jump to the given one where all change together."""


@dataclass(frozen=True)
class SearchedParameter:
    """A parameter that may be changed: a modest value, the steps of the search, and how people
    write it: ``shown`` per SI unit, in ``unit``."""

    modest: float
    step: float
    shown: float
    unit: str

    def text(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{round(value * self.shown, 6):g} {self.unit}".strip()


DEGREE = math.pi / 180.0
AXES = {
    "rise": SearchedParameter(0.08, 0.005, 100.0, "cm"),
    "take_off_speed": SearchedParameter(1.2, 0.05, 1.0, "m/s"),
    "distance_x": SearchedParameter(0.0, 0.01, 100.0, "cm"),
    "distance_y": SearchedParameter(0.0, 0.01, 100.0, "cm"),
    "twist": SearchedParameter(0.0, 2.0 * DEGREE, 1.0 / DEGREE, "deg"),
    "landing_height": SearchedParameter(0.0, 0.005, 100.0, "cm"),
    "foot_clearance": SearchedParameter(0.02, 0.0025, 1000.0, "mm"),
    "leg_clearance": SearchedParameter(0.01, 0.0025, 1000.0, "mm"),
    "friction": SearchedParameter(0.7, 0.025, 1.0, ""),
    "effort": SearchedParameter(1.0, 0.025, 1.0, ""),
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
"""Parameters that are tried first, by constraint family."""


@dataclass(frozen=True)
class NearestFeasible:
    """Nearest task that can be planned.

    Attributes:
        parameter: which one was changed.
        asked, value: what was asked for and what can be planned, in SI units.
        beyond: the value nearest to it that could not be planned.
        solves, cpu_s: what the search cost.
        plan: the valid plan of the changed task.
        binds: what of the robot that plan uses to the full.
        others: parameters that were changed together with it, each with what was asked for, what
            can be planned, and what could not.
    """

    parameter: str
    asked: float
    value: float
    beyond: float
    solves: int
    cpu_s: float
    plan: PlannedJump
    binds: tuple[str, ...] = ()
    others: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """One line for people, with a value to paste."""
        ways = {self.parameter: (self.asked, self.value, self.beyond), **self.others}
        asked, value, beyond = (
            ", ".join(f"{name}: {AXES[name].text(way[i])}" for name, way in ways.items())
            for i in range(3)
        )
        if not self.others:
            beyond = AXES[self.parameter].text(self.beyond)
        are = "together are" if self.others else "is"
        binds = f"; what binds: {', '.join(self.binds)}" if self.binds else ""
        return (
            f"{asked} {are} beyond the robot; the nearest that can be planned is {value}; {beyond} "
            f"cannot{binds} ({self.solves} solves, {self.cpu_s:.1f} s)"
        )


def nearest_feasible(
    task: JumpTask,
    robot: RobotDescription,
    *,
    family: str = "",
    solve: Solver | None = None,
    seconds: float = MOST_SECONDS,
    progress: Callable[[str], None] = lambda _: None,
    library: PlanLibrary | None = None,
) -> NearestFeasible | None:
    """Search for a task that differs in one parameter and has a valid plan; ``None`` if a short
    search finds none.

    ``family`` is the constraint family that could not be met; it decides what is tried first.
    ``progress`` is told what is being tried, and plans of ``library`` say where to begin.
    """
    search = _FeasibleSearch(task, robot, solve, seconds, progress, library)
    tried = candidates(task, family)
    ways = continuation_path(task)
    for parameter in tried[:SINGLE] if ways else tried:
        found = search.along([{parameter: value} for value in values_towards(task, parameter)])
        if found is not None:
            return found
        if search.spent or (ways and search.cpu > seconds / 3.0):
            break
    for way in ways:
        found = search.along(way)
        if found is not None:
            return found
    return None


def continuation_path(task: JumpTask) -> list[list[dict[str, float]]]:
    """Return the way from a modest jump to the wanted one: onto a step with its height and the rise only, as the robot
    cannot jump up close to a step; then with all parameters that set how far it goes. Empty where the task sets fewer
    than two of them to something else.
    """
    far = [name for name in TOGETHER if name in AXES and len(values_towards(task, name)) > 1]
    up = [name for name in far if name in UPWARDS] if task.landing_height > 0.0 else []
    groups = [names for names in (up, far) if len(names) > 1]
    return [_way(task, names) for names in groups[: 1 if up == far else 2]]


def _way(task: JumpTask, names: list[str]) -> list[dict[str, float]]:
    far = {name: AXES[name].modest for name in names}
    found = []
    for k in range(SHARES + 1):
        point = {}
        for name, modest in far.items():
            step, way = AXES[name].step, getattr(task, name) - modest
            round_way = step * round(way * k / SHARES / step)
            point[name] = getattr(task, name) if k == SHARES else round(modest + round_way, 9)
        found.append(point)
    return found


def seconds_left(spent: float) -> float:
    """Return the time that a search may take [s] after a task that took so much processor time [s]."""
    return max(LEAST_SECONDS, min(MOST_SECONDS, ALTOGETHER - spent))


def candidates(task: JumpTask, family: str) -> list[str]:
    """Return the parameters that the task sets to something else than a modest value: those that the constraint speaks
    of, then those that are furthest from modest.
    """
    far: dict[str, float] = {}
    for name in AXES:
        values = values_towards(task, name)
        if len(values) > 1:
            far[name] = abs(values[-1] - values[0]) / SCALES[name]
    first = [name for name in FIRST.get(family, ()) if name in far]
    return list(dict.fromkeys([*first, *sorted(far, key=lambda name: -far[name])]))


def values_towards(task: JumpTask, parameter: str) -> list[float]:
    """Return the values from the modest to the wanted one, in round steps; empty where the task leaves the parameter as
    it is.
    """
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


def _quick(solve: Solver | None, near: bool) -> Solver:
    """Return the planner, which gives up soon. From a near plan, too, it tries from nothing by itself."""
    from ..solving.solve import solve_jump

    def make(
        task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
    ) -> PlannedJump:
        if solve is not None:
            return solve(task, robot, warm_start)
        if near and warm_start is None:
            raise PlanError("what is not found from near is not looked for again")
        return solve_jump(task, robot, warm_start=warm_start, quick=True)

    return make


class _FeasibleSearch:
    """The solves so far, and the bound on them."""

    def __init__(
        self,
        task: JumpTask,
        robot: RobotDescription,
        solve: Solver | None,
        seconds: float,
        progress: Callable[[str], None],
        library: PlanLibrary | None,
    ) -> None:
        self._task, self._robot, self._solve, self._library = task, robot, solve, library
        self._seconds, self._progress = seconds, progress
        self._started = cpu_time()
        self._solves = 0

    @property
    def cpu(self) -> float:
        """Processor time so far [s]."""
        return cpu_time() - self._started

    @property
    def spent(self) -> bool:
        """True if no further solve is begun."""
        return self._solves >= MOST_SOLVES or self.cpu > self._seconds

    def along(self, way: list[dict[str, float]]) -> NearestFeasible | None:
        """Return the best point of a way from modest to the wanted values; ``None`` where even the modest one has no
        plan, or no time is left to try it.
        """
        begin, plan = self._kept(way)
        if plan is None:
            begin = 0
            plan = None if self._solves and self.spent else self._try(way[0], None)
        if plan is None:
            return None
        good, bad = begin, len(way) - 1
        # The solver does not follow a long step, though its end is feasible; least of all from a kept
        # plan, which is near the robot's limits.
        most = max(1, (bad - good) // (STRIDES if begin else FIRST_STRIDES))
        while bad - good > 1 and not self.spent:
            middle = good + max(1, min(most, (bad - good) // 2))
            better = self._try(way[middle], plan)
            if better is None:
                bad = middle
            else:
                good, plan = middle, better
        ends = {name: (way[-1][name], way[good][name], way[bad][name]) for name in way[0]}
        first, *others = ends
        return NearestFeasible(
            first, *ends[first], self._solves, self.cpu, plan, active_limits(plan, self._robot),
            {name: ends[name] for name in others},
        )  # fmt: skip

    def _kept(self, way: list[dict[str, float]]) -> tuple[int, PlannedJump | None]:
        """Return the point of a way that a kept plan of a similar task goes up to, or where that has no plan one at
        three quarters of it, and a plan there, which is the kept one or starts from it; else ``None``. With little time
        left, three quarters come first.
        """
        parameter, *others = way[0]
        if self._library is None or others or self.spent:
            return 0, None
        modest = way[0][parameter]
        near = self._library.farthest(self._task, parameter, modest)
        if near is None:
            return 0, None
        most = abs(getattr(near.task, parameter) - modest) + 1e-9
        index = sum(abs(point[parameter] - modest) <= most for point in way) - 1
        there = self._task.model_copy(update=way[index])
        if index and there.hash(self._robot) == near.task.hash(self._robot):
            return index, near
        # Where the task itself took nearly all of the time, a sure answer comes before a near one: no
        # machine may be too slow for any.
        begins = (index, 3 * index // 4)
        for begin in dict.fromkeys(begins if self._seconds > MOST_SECONDS / 2.0 else begins[::-1]):
            plan = self._try(way[begin], near) if begin and not self.spent else None
            if plan is not None:
                return begin, plan
        return 0, None

    def _try(self, values: Mapping[str, float], start: PlannedJump | None) -> PlannedJump | None:
        """Return a valid plan with those values, or ``None``."""
        self._progress(", ".join(f"{name}: {AXES[name].text(x)}" for name, x in values.items()))
        self._solves += 1
        task = self._task.model_copy(update=dict(values))
        make = _quick(self._solve, start is not None)
        try:
            return solve_and_check(task, self._robot, start, make, refine=False)
        except (PlanError, InvalidPlanError, JumpTaskError):
            return None
