"""The search along one direction of the frontier: the next try, given the results so far.

How far up a ladder something works is found with few tries. The searches are generators: they yield
the rung to try, are sent whether it works, and return the highest that does, 0 for none. So they know
nothing of what a try is, and what is already known can be answered at once. Plans and runs are made
in processes of their own.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from ....planner.checking.plan_tests import active_limits
from ....planner.checking.validity import failure_text
from ....planner.library.library import PlanLibrary, solve_and_check
from ....planner.solving.solver_process import cpu_time
from ....planner.task.files import JumpTaskError, PlanError
from ....planner.task.plan import InvalidPlanError
from ....planner.task.task import JumpTask
from ....robots.description import find_robot
from ....robots.robot_description import RobotDescription
from ....runtime.graph import load
from ....studies.journal import Outcome
from .directions import Direction

FAILURES = 2
"""After so many rungs in a row that fail the walk goes no further."""


def furthest(start: int, most: int, good: int = 0) -> Generator[int, bool, int]:
    """Find the last rung before one that fails, by strides that double, and then by bisection.

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
    """Find the highest rung that works, walking outwards from ``start`` to ``most`` one by one
    until ``FAILURES`` in a row fail; then, if none has worked, inwards to the first that does."""
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
"""Least number of runs of a rung; then it ends once it can no longer reach ``RATE``."""
FIRST_LOOK = 10
"""Number of runs below which a rung ends at once when it can no longer reach ``RATE``."""


@dataclass(frozen=True)
class Effort:
    """The effort spent on a direction.

    Attributes:
        runs: of a rung.
        planned_cpu, theory_cpu: s; after so much processor time no further solve is begun in the search
            for what is planned, and for the theoretical bound.
        runs_cpu: s; the same for the runs in the search for what lands.
        quick: whether the ladder is climbed from further down, as nobody knows where it ends, and what
            lands is looked for by bisection, not rung by rung.
    """

    runs: int
    planned_cpu: float
    theory_cpu: float
    quick: bool = False
    runs_cpu: float = math.inf


@dataclass(frozen=True)
class JumpGraph:
    """The graph in which a robot jumps, by ``plan.task``: ``robot`` is its name or its file, ``settings``
    are overrides that name it in the graph and choose the trial."""

    robot: str
    path: Path
    settings: Mapping[str, Any]

    def run(self, task: JumpTask, plans: Path, seed: int) -> Outcome:
        """Make one run of a task that is planned in a folder."""
        given = task.model_dump(mode="json", exclude_unset=True)
        sets = {"plan.task": given, "plan.library": str(plans.absolute()), "robot.seed": seed}
        result = load(self.path, {**self.settings, **sets}).run(log=False)
        return Outcome(result.success, result.reason, result.run_hash, result.to_json()["metrics"])


@dataclass(frozen=True)
class PlanJob:
    """A task to be planned from the plan of ``near`` (from nothing without it), kept in ``folder``."""

    robot: str
    task: JumpTask
    folder: Path
    near: JumpTask | None = None


@dataclass(frozen=True)
class RunJob:
    """A planned task to be run with those ``seeds``, of which ``of`` are wanted in all; so many
    ``done`` and ``failed`` before."""

    graph: JumpGraph
    task: JumpTask
    folder: Path
    seeds: tuple[int, ...]
    of: int
    done: int = 0
    failed: int = 0


def enough(done: int, failed: int, of: int) -> bool:
    """Tell whether a rung needs no more runs: all are done, or too many of them failed."""
    allowed = of - required(of)
    return done >= of or (failed > allowed and (of < FIRST_LOOK or done >= LEAST_RUNS))


def required(runs: int) -> int:
    """Return the number of runs that have to land."""
    return next(k for k in range(runs + 1) if k >= RATE * runs - 1e-9)


@lru_cache(maxsize=4)
def _robot(name: str) -> RobotDescription:
    return find_robot(name)


def make_plan(job: PlanJob) -> Outcome:
    """Plan the task and keep a valid plan; metrics ``cpu_s`` and, for a plan, ``binds``: the limits
    of the robot that it uses to the full."""
    robot = _robot(job.robot)
    library = PlanLibrary(robot, job.folder, ())
    started = cpu_time()
    try:
        near = None if job.near is None else library.find(job.near)
        plan = solve_and_check(job.task, robot, near)
    except (InvalidPlanError, PlanError, JumpTaskError) as error:
        return Outcome(False, failure_text(error), metrics={"cpu_s": cpu_time() - started})
    spent = cpu_time() - started
    library.add(plan)
    return Outcome(True, "", metrics={"cpu_s": spent, "binds": list(active_limits(plan, robot))})


def run_rung(job: RunJob) -> list[tuple[int, Outcome]]:
    """Make the runs in the graph's trial, by seed in order, until there are ``enough``."""
    done, failed, found = job.done, job.failed, list[tuple[int, Outcome]]()
    for seed in job.seeds:
        if enough(done, failed, job.of):
            break
        started = cpu_time()
        outcome = job.graph.run(job.task, job.folder, seed)
        outcome.metrics["cpu_s"] = cpu_time() - started
        done, failed = done + 1, failed + (not outcome.success)
        found.append((seed, outcome))
    return found


def do(job: PlanJob | RunJob) -> Outcome | list[tuple[int, Outcome]]:
    """Do one job of either kind."""
    return make_plan(job) if isinstance(job, PlanJob) else run_rung(job)


@dataclass(frozen=True)
class Ask:
    """A try on a rung: ``recipe`` and ``loosest`` are plans, ``run`` is the runs of the former;
    ``near`` is the task from whose plan a solve may start."""

    kind: str
    rung: int
    near: JumpTask | None = None


@dataclass
class Tries:
    """The tries along a direction by rung, and the end of each search. ``planned_ended``,
    ``reached_ended`` and ``theory_ended`` are false where the effort's time stopped the search,
    which might go further."""

    direction: Direction
    recipe: dict[int, Outcome] = field(default_factory=dict)
    runs: dict[int, list[Outcome]] = field(default_factory=dict)
    loosest: dict[int, Outcome] = field(default_factory=dict)
    planned: int = 0
    reached: int = 0
    theory: int = 0
    planned_ended: bool = True
    reached_ended: bool = True
    theory_ended: bool = True


def explore(tries: Tries, effort: Effort) -> Generator[Ask, None, None]:
    """Yield the tries along one direction, one after the other; the result of each is in ``tries``
    before the next is asked for."""
    way = tries.direction
    search = furthest(max(1, way.start // 2) if effort.quick else way.start, way.most)
    rung = next(search)
    try:
        while _spent(tries.recipe.values()) < effort.planned_cpu:
            yield Ask("recipe", rung)
            tries.planned = max([k for k, v in tries.recipe.items() if v.success], default=0)
            rung = search.send(tries.recipe[rung].success)
        tries.planned_ended = False
    except StopIteration as end:
        tries.planned = end.value
    if tries.planned:
        start = min(way.start, tries.planned)
        walk = (furthest if effort.quick else outward)(start, tries.planned)
        rung = next(walk)
        try:
            while _spent(of_runs(tries)) < effort.runs_cpu:
                if rung not in tries.recipe:
                    yield Ask("recipe", rung)
                good = False
                if tries.recipe[rung].success:
                    yield Ask("run", rung)
                    landed = sum(run.success for run in tries.runs[rung])
                    good = landed >= required(effort.runs)
                    tries.reached = max(tries.reached, rung if good else 0)
                rung = walk.send(good)
            tries.reached_ended = False
        except StopIteration as end:
            tries.reached = end.value
    tries.theory = tries.planned  # its plan keeps the looser limits as well
    near = way.task(tries.planned) if tries.planned else None
    search = furthest(tries.planned + 1, way.most, tries.planned)
    try:
        rung = next(search)
        while _spent(tries.loosest.values()) < effort.theory_cpu:
            yield Ask("loosest", rung, near)
            if tries.loosest[rung].success:
                tries.theory, near = rung, way.loosest(rung)
            rung = search.send(tries.loosest[rung].success)
        tries.theory_ended = False
    except StopIteration as end:
        tries.theory = end.value


def of_runs(tries: Tries) -> list[Outcome]:
    """Return the outcomes of all runs along a direction."""
    return [run for runs in tries.runs.values() for run in runs]


def _spent(outcomes: Iterable[Outcome]) -> float:
    return sum(float(outcome.metrics.get("cpu_s", 0.0)) for outcome in outcomes)
