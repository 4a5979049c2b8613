"""Random jumping tasks, planned and run in closed loop in the robust trial.

Each task of ``random_tasks`` is planned from nothing, with one recipe for all, and its plan is run in
``graphs/jump.yaml`` with the robust trial once a seed; ground and expectation follow from the task.
A run lands if ``blocks.JumpScore`` says so. ``trial`` chooses another trial, such as ``uneven``. With a ``push`` the
torso gets that impulse within 10 ms, in a direction and at a moment of the flight that are drawn for each run, and what
counts as landed is what ``graphs/push_12cm.yaml`` says. What has been run is kept in ``results/jumps`` and not
run again unless the code changes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....extensions.commissioning.reach.search import JumpGraph
from ....mathematics.constants import GRAVITY
from ....planner.checking.validity import failure_text
from ....planner.library.library import PlanLibrary, shipped_folder, solve_and_check
from ....planner.solving.solve import make_problem
from ....planner.solving.solver_process import cpu_time
from ....planner.task.files import JumpTaskError, PlanError
from ....planner.task.plan import InvalidPlanError
from ....planner.task.task import JumpTask
from ....robots.description import RobotDescription, find_robot
from ....studies.batch.jobs import job_results
from ....studies.journal import Journal, Outcome, code_fingerprint
from ....studies.summary import wilson_interval
from ....studies.trials import trial_settings
from ..rows import Row
from .random_tasks import SEED, random_tasks

COUNT = 200
RUNS = range(9000, 9004)
"""The seeds of the trial that each jump is run with; nothing is tuned on them."""
FOLDER = Path("results") / "jumps"
TRIAL = "robust"
LANDED_GOAL = 0.05
"""The largest good share of planned jumps that do not land."""
MEDIAN_GOAL, MOST_GOAL, WORST_GOAL = 0.3, 1.5, 5.0
"""CPU time of planning [s]: the median's, that of 95 % of the tasks, and the worst."""


LAST_PUSH, PUSH_TIME = 0.9, 0.01
"""The share of the flight within which a push begins, and how long it lasts [s]."""


@dataclass(frozen=True)
class JumpJob:
    """A task, the seeds to run it with, where its plan goes, and what is there already; the trial,
    and the impulse of a push [N s]."""

    task: JumpTask
    seeds: tuple[int, ...]
    folder: Path
    planned: bool
    trial: str = TRIAL
    push: float = 0.0


def jumps(
    count: int = COUNT,
    seed: int = SEED,
    seeds: Sequence[int] = RUNS,
    folder: Path = FOLDER,
    harder: bool = False,
    trial: str = TRIAL,
    push: float = 0.0,
) -> list[Row]:
    """Measure the share of tasks without a plan, and what binds; of runs that do not land, with its
    95 % interval; and the CPU time of planning, from nothing to checked."""
    tasks = random_tasks(count, seed, harder)
    code = code_fingerprint()
    robot = find_robot("bruce")
    names = [f"{code}:{task.hash(robot)}" for task in tasks]
    with Journal(folder / "runs.jsonl") as journal:
        jobs, owners = [], []
        for task, name in zip(tasks, names, strict=True):
            planned = journal.outcomes.get(name)
            missing = tuple(
                s for s in seeds if f"{name}{run_key(trial, push, s)}" not in journal.outcomes
            )
            if planned is None or (planned.success and missing):
                found_before = planned is not None
                jobs.append(JumpJob(task, missing, folder / "plans", found_before, trial, push))
                owners.append(name)
        compiling = compile_functions([job.task for job in jobs], robot)
        with closing(job_results(plan_and_run, jobs)) as results:
            for result in results:
                for part, outcome in result.value or [("", Outcome(False, result.error))]:
                    journal.add(f"{owners[result.index]}{part}", outcome)
        plans = [journal.outcomes[name] for name in names]
        found = [
            (task.name, s, journal.outcomes[f"{name}{run_key(trial, push, s)}"])
            for task, name, plan in zip(tasks, names, plans, strict=True)
            if plan.success
            for s in seeds
        ]
    under = f"{trial} trial" + (f", pushed by {push:g} N s" if push else "")
    return [*_plan_rows(tasks, plans, seed), _deriving_row(compiling), _landing_row(found, under)]


def compile_functions(tasks: Sequence[JumpTask], robot: RobotDescription) -> float:
    """Compile the planner's functions for such tasks, so that the first one's time is of planning only.

    Returns:
        the processor time it took [s]; next to nothing where another run has done it.
    """
    started = cpu_time()
    first = {_kind(task): task for task in reversed(tasks)}
    for task in first.values():
        with suppress(PlanError, JumpTaskError):
            make_problem(task, robot)
    return cpu_time() - started


def _kind(task: JumpTask) -> tuple[bool, ...]:
    """Tell which functions a task needs: whether it leaves the plane, and has a step."""
    return bool(task.distance_y or task.twist), bool(task.landing_height)


def plan_and_run(job: JumpJob) -> list[tuple[str, Outcome]]:
    """Plan and run one task; return the outcome of its plan under an empty key, then of each run
    under its ``run_key``."""
    robot = find_robot("bruce")
    library = PlanLibrary(robot, job.folder, ())
    found = []
    if not job.planned or library.path_of(job.task) is None:
        started = cpu_time()
        reason = ""
        try:
            library.add(solve_and_check(job.task, robot))
        except (InvalidPlanError, PlanError, JumpTaskError) as error:
            reason = failure_text(error)
        found.append(("", Outcome(not reason, reason, metrics={"cpu_s": cpu_time() - started})))
        if reason:
            return found
    keys = {seed: run_key(job.trial, job.push, seed) for seed in job.seeds}
    return found + [(key, run_once(job, seed)) for seed, key in keys.items()]


def run_key(trial: str, push: float, seed: int) -> str:
    """Return the key under which a run is kept, behind its task's key."""
    return f":{trial}:{push:g}:{seed}"


def run_once(job: JumpJob, seed: int) -> Outcome:
    """Make one run of a planned task."""
    jumping = pushed_jumps(job, seed) if job.push else bruce_jumps(job.trial)
    return jumping.run(job.task, job.folder, seed)


def bruce_jumps(trial: str = TRIAL) -> JumpGraph:
    """Return the graph in which BRUCE jumps, in a trial."""
    return JumpGraph("bruce", shipped_folder() / "jump.yaml", trial_settings(trial))


def pushed_jumps(job: JumpJob, seed: int) -> JumpGraph:
    """Return the same graph with a push in the flight, in a direction and at a moment drawn by task
    and seed."""
    rng = np.random.default_rng([seed, *job.task.name.encode()])
    rise, drop = job.task.rise or 0.0, job.task.landing_height or 0.0
    flight = sum(math.sqrt(2.0 * max(h, 0.0) / GRAVITY) for h in (rise, rise - drop))
    push = {
        "push.force": job.push / PUSH_TIME,
        "push.duration": PUSH_TIME,
        "push.angle": float(rng.uniform(0.0, 2.0 * math.pi)),
        "push.delay": float(rng.uniform(0.0, LAST_PUSH)) * flight,
    }
    return JumpGraph(
        "bruce", shipped_folder() / "push_12cm.yaml", {**trial_settings(job.trial), **push}
    )


def _plan_rows(tasks: Sequence[JumpTask], plans: Sequence[Outcome], seed: int) -> list[Row]:
    refused = [(task.name, plan.reason) for task, plan in zip(tasks, plans, strict=True)
               if not plan.success]  # fmt: skip
    seconds = [plan.metrics["cpu_s"] for plan in plans if "cpu_s" in plan.metrics]
    told = "; ".join(f"{name} ({reason})" for name, reason in refused)
    what = f"{len(tasks)} tasks of seed {seed}" + (f"; refused: {told}" if told else "")
    median, most, worst = (float(np.quantile(seconds, q)) for q in (0.5, 0.95, 1.0))
    return [
        Row("random jumps that are refused, with what binds", len(refused) / len(tasks), "", note=what),
        Row("random jumps, planning, median CPU", median, "s", goal=MEDIAN_GOAL),
        Row("random jumps, planning, 95 % of them within", most, "s", goal=MOST_GOAL),
        Row("random jumps, planning, worst", worst, "s", goal=WORST_GOAL),
    ]  # fmt: skip


def _deriving_row(seconds: float) -> Row:
    return Row(
        "random jumps, deriving the planner's functions once on a machine, CPU", seconds, "s",
        note="not in the times of planning; next to nothing where they are kept already",
    )  # fmt: skip


def _landing_row(found: Sequence[tuple[str, int, Outcome]], under: str) -> Row:
    failed = [(name, seed, outcome.reason) for name, seed, outcome in found if not outcome.success]
    n = len(found)
    low, high = wilson_interval(n - len(failed), n)
    by_task = Counter(name for name, _, _ in failed)
    told = "; ".join(f"{name}: {times}" for name, times in by_task.items())
    return Row(
        "planned random jumps that do not land",
        len(failed) / n if n else None,
        "",
        goal=LANDED_GOAL,
        note=f"{n - len(failed)} of {n} runs land, 95 % interval {low:.3f} to {high:.3f}, {under}"
        + (f"; failures by task: {told}" if told else ""),
    )
