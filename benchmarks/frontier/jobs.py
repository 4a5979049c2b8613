"""What the frontier's search asks for, done in a process of its own: plans, and runs of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...planner.checking.plan_tests import active_limits
from ...planner.checking.validity import InvalidPlanError
from ...planner.library.library import PlanLibrary, solve_and_check
from ...planner.solving.solver_process import cpu_time
from ...planner.task.files import PlanError, TaskError
from ...planner.task.task import JumpTask
from ...robots.description import find_robot
from ...studies.journal import Outcome
from ..jumps.jumps import JumpJob, plan_and_run, run_once
from ..jumps.random_tasks import why_not

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
    except (InvalidPlanError, PlanError, TaskError) as error:
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
