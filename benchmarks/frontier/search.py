"""The search along one direction of the frontier: what is tried next, given the results so far.

A direction is a ray of tasks of one to three lines. Rung ``k`` asks for ``k`` times the direction's
``step``; everything else that a task says is the same on all rungs, and what it leaves unsaid is
chosen by the planner's usual recipe. A pair goes in two directions at once, each by the same share
of its ``GOALS``, so that its value is a share in per cent.

How far up a ladder something works is found with few tries. Both searches are generators: they yield
the rung to try, are sent whether it works, and return the highest that does, 0 for none. So they know
nothing of what a try is, and what is already known can be answered at once. Plans and runs are made
in processes of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...planner.checking.plan_tests import active_limits
from ...planner.checking.validity import InvalidPlanError
from ...planner.library.library import PlanLibrary, solve_and_check
from ...planner.solving.solver_process import cpu_time
from ...planner.task.files import JumpTaskError, PlanError
from ...planner.task.task import JumpTask, make_task
from ...robots.description import find_robot
from ...studies.journal import Outcome
from ..jumps.jumps import JumpJob, plan_and_run, run_once
from ..jumps.random_tasks import why_not

GOALS = {
    "up": 0.25, "ahead": 0.60, "back": 0.30, "aside": 0.35, "turn": math.radians(120.0),
    "step up": 0.12, "step down": 0.35,
}  # fmt: skip
"""What 100 % of each direction is in a pair [m, rad]: what is wanted of BRUCE at a rate of 95 %."""
LOOSEST: Mapping[str, Any] = {"effort": 1.0, "margins": None, "foot_clearance": 0.02}
"""What a task says besides for the theoretical bound: all of the motors' torque and speed, no
margins but the 5 mrad at the joints without which no plan is valid, and feet that rise by 2 cm."""


@dataclass(frozen=True)
class Direction:
    """A ray of tasks.

    Attributes:
        name: what it is called.
        what: what the value is and what else the tasks say, in words.
        values: what a task with a value [the unit below, in SI] says.
        step: between two rungs, in SI units.
        shown: how many of ``unit`` are one SI unit.
        unit: in which people read the value.
        start: the rung at which the search begins, near where success was last seen to end.
        most: the last rung.
    """

    name: str
    what: str
    values: Callable[[float], dict[str, float]]
    step: float
    shown: float
    unit: str
    start: int
    most: int

    def value(self, rung: int) -> float:
        """A rung's value in ``unit``."""
        return round(rung * self.step * self.shown, 6)

    def task(self, rung: int) -> JumpTask:
        """The task on a rung, as a user would ask for it."""
        return make_task({"name": f"{self.name} {self.value(rung):g}", **self._said(rung)})

    def loosest(self, rung: int) -> JumpTask:
        """The same with all that the motors have and without margins: for the theoretical bound."""
        name = f"{self.name} {self.value(rung):g} at most"
        return make_task({"name": name, **self._said(rung), **LOOSEST})

    def _said(self, rung: int) -> dict[str, float]:
        return {key: round(value, 9) for key, value in self.values(rung * self.step).items()}


def _length(name: str, what: str, values: Callable[[float], dict[str, float]],
            step_cm: float, start: int, most: int) -> Direction:  # fmt: skip
    return Direction(name, what, values, 0.01 * step_cm, 100.0, "cm", start, most)


def _pair(
    name: str, what: str, values: Callable[[float], dict[str, float]], start: int
) -> Direction:
    return Direction(name, what, values, 0.1, 100.0, "%", start, 20)


DIRECTIONS: tuple[Direction, ...] = (
    _length("up", "the rise", lambda v: {"rise": v}, 1.0, 22, 50),
    _length("ahead", "the distance; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_x": v}, 5.0, 10, 24),
    _length("back", "the distance; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_x": -v}, 2.5, 11, 32),
    _length("aside", "the distance to the left; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_y": v}, 2.5, 12, 32),
    Direction("turn", "the turn to the left; rise 12 cm",
              lambda v: {"rise": 0.12, "twist": v}, math.radians(10.0), 180.0 / math.pi, "deg", 8, 27),
    _length("step up", "the step's height; 20 cm ahead, rise 6 cm above the step",
            lambda v: {"rise": 0.06 + v, "distance_x": 0.20, "landing_height": v}, 1.0, 8, 30),
    _length("step down", "the step's height; 25 cm ahead, rise 8 cm",
            lambda v: {"rise": 0.08, "distance_x": 0.25, "landing_height": -v}, 5.0, 5, 12),
    _pair("ahead and up", "the share of 60 cm ahead and of a rise of 25 cm",
          lambda s: {"rise": s * GOALS["up"], "distance_x": s * GOALS["ahead"]}, 6),
    _pair("ahead and turn", "the share of 60 cm ahead and of a turn by 120 deg; rise 12 cm",
          lambda s: {"rise": 0.12, "distance_x": s * GOALS["ahead"], "twist": s * GOALS["turn"]}, 6),
    _pair("aside and turn", "the share of 35 cm to the left and of a turn by 120 deg; rise 12 cm",
          lambda s: {"rise": 0.12, "distance_y": s * GOALS["aside"], "twist": s * GOALS["turn"]}, 6),
    _pair("step up and ahead",
          "the share of a step of 12 cm and of 60 cm ahead; rise 6 cm above the step",
          lambda s: {"rise": 0.06 + s * GOALS["step up"], "distance_x": s * GOALS["ahead"],
                     "landing_height": s * GOALS["step up"]}, 5),
)  # fmt: skip
"""All directions, in the order in which they are told."""


FAILURES = 2
"""After so many rungs in a row that fail the walk goes no further."""


def furthest(start: int, most: int, good: int = 0) -> Generator[int, bool, int]:
    """The last rung before one that fails, by strides that double, and then by bisection.

    It takes for granted that the rungs up to ``good`` work, and that what fails once fails from
    there on. It begins with ``start``, in ``good`` + 1 to ``most``.
    """
    bad, stride, rung = most + 1, 1, start
    while bad - good > 1:
        works = yield rung
        if works:
            good = rung
        else:
            bad = rung
        if bad > most:
            rung = min(good + stride, most)
        elif not works and stride < bad - good:
            rung = bad - stride
        else:
            rung = (good + bad) // 2
        stride *= 2
    return good


def outward(start: int, most: int) -> Generator[int, bool, int]:
    """The highest rung that works, walking outwards from ``start`` to ``most`` one by one until
    ``FAILURES`` in a row fail; then, if none has worked, inwards to the first that does."""
    reached, failures, rung = 0, 0, start
    while rung <= most and failures < FAILURES:
        if (yield rung):
            reached, failures = rung, 0
        else:
            failures += 1
        rung += 1
    rung = start - 1
    while not reached and rung > 0:
        if (yield rung):
            reached = rung
        rung -= 1
    return reached


RATE = 0.95
"""The share of a rung's runs that have to land."""
LEAST_RUNS = 4
"""So many runs a rung gets at least; then it ends once it can no longer reach ``RATE``."""
FIRST_LOOK = 10
"""With fewer runs wanted than these a rung ends at once when it can no longer reach ``RATE``."""


@dataclass(frozen=True)
class PlanJob:
    """A task to be planned from the plan of ``near`` (from nothing without it), kept in ``folder``."""

    task: JumpTask
    folder: Path
    near: JumpTask | None = None


@dataclass(frozen=True)
class RunJob:
    """A planned task to be run with those ``seeds``, of which ``of`` are wanted in all; so many
    ``done`` and ``failed`` before."""

    task: JumpTask
    folder: Path
    seeds: tuple[int, ...]
    of: int
    done: int = 0
    failed: int = 0


def enough(done: int, failed: int, of: int) -> bool:
    """Whether a rung needs no more runs: all are done, or too many of them failed."""
    allowed = of - required(of)
    return done >= of or (failed > allowed and (of < FIRST_LOOK or done >= LEAST_RUNS))


def required(runs: int) -> int:
    """How many of so many runs have to land."""
    return next(k for k in range(runs + 1) if k >= RATE * runs - 1e-9)


def make_plan(job: PlanJob) -> Outcome:
    """Whether the task has a valid plan, which is then kept; metrics ``cpu_s`` and, for a plan,
    ``binds``: what of the robot it uses to the full."""
    robot = find_robot("bruce")
    library = PlanLibrary(robot, job.folder, ())
    started = cpu_time()
    try:
        near = None if job.near is None else library.find(job.near)
        plan = solve_and_check(job.task, robot, near)
    except (InvalidPlanError, PlanError, JumpTaskError) as error:
        return Outcome(False, why_not(error), metrics={"cpu_s": cpu_time() - started})
    spent = cpu_time() - started
    library.add(plan)
    return Outcome(True, "", metrics={"cpu_s": spent, "binds": list(active_limits(plan, robot))})


def run_rung(job: RunJob) -> list[tuple[int, Outcome]]:
    """The runs by seed in the robust trial, in order, until there are ``enough``."""
    done, failed, found = job.done, job.failed, list[tuple[int, Outcome]]()
    planned = JumpJob(job.task, (), job.folder, True)
    plan_and_run(planned)  # plans it again if somebody removed its plan
    for seed in job.seeds:
        if enough(done, failed, job.of):
            break
        outcome = run_once(planned, seed)
        done, failed = done + 1, failed + (not outcome.success)
        found.append((seed, outcome))
    return found


def do(job: PlanJob | RunJob) -> Outcome | list[tuple[int, Outcome]]:
    """One job of either kind."""
    return make_plan(job) if isinstance(job, PlanJob) else run_rung(job)


MOST_CPU, FIRST_LOOK_CPU = 90.0, 15.0
"""s; after so much processor time no further solve is begun in a search along one direction; the
second with fewer runs a rung than ``FIRST_LOOK``."""


@dataclass(frozen=True)
class Ask:
    """A try on a rung: ``recipe`` and ``loosest`` are plans, ``run`` is the runs of the former;
    ``near`` is the task from whose plan a solve may start."""

    kind: str
    rung: int
    near: JumpTask | None = None


@dataclass
class Tries:
    """What was tried along a direction by its rung, and where each search ended. ``planned_ended``
    and ``theory_ended`` are false where ``MOST_CPU`` stopped the search, which might go further."""

    direction: Direction
    recipe: dict[int, Outcome] = field(default_factory=dict)
    runs: dict[int, list[Outcome]] = field(default_factory=dict)
    loosest: dict[int, Outcome] = field(default_factory=dict)
    planned: int = 0
    reached: int = 0
    theory: int = 0
    planned_ended: bool = True
    theory_ended: bool = True


def explore(tries: Tries, runs: int) -> Generator[Ask, None, None]:
    """The tries along one direction, one after the other; what each found is in ``tries`` before
    the next is asked for."""
    way = tries.direction
    most = MOST_CPU if runs >= FIRST_LOOK else FIRST_LOOK_CPU
    search = furthest(way.start, way.most)
    rung = next(search)
    try:
        while _spent(tries.recipe) < most:
            yield Ask("recipe", rung)
            tries.planned = max([k for k, v in tries.recipe.items() if v.success], default=0)
            rung = search.send(tries.recipe[rung].success)
        tries.planned_ended = False
    except StopIteration as end:
        tries.planned = end.value
    if tries.planned:
        walk = outward(min(way.start, tries.planned), tries.planned)
        rung = next(walk)
        try:
            while True:
                if rung not in tries.recipe:
                    yield Ask("recipe", rung)
                good = False
                if tries.recipe[rung].success:
                    yield Ask("run", rung)
                    landed = sum(run.success for run in tries.runs[rung])
                    good = landed >= required(runs)
                rung = walk.send(good)
        except StopIteration as end:
            tries.reached = end.value
    tries.theory = tries.planned  # its plan keeps the looser limits as well
    near = way.task(tries.planned) if tries.planned else None
    search = furthest(tries.planned + 1, way.most, tries.planned)
    try:
        rung = next(search)
        while _spent(tries.loosest) < most:
            yield Ask("loosest", rung, near)
            if tries.loosest[rung].success:
                tries.theory, near = rung, way.loosest(rung)
            rung = search.send(tries.loosest[rung].success)
        tries.theory_ended = False
    except StopIteration as end:
        tries.theory = end.value


def _spent(outcomes: dict[int, Outcome]) -> float:
    return sum(float(outcome.metrics.get("cpu_s", 0.0)) for outcome in outcomes.values())
