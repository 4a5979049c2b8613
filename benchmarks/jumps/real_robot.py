"""Jumps of simulated robots as a bench finds them: untold, calibrated, and learning from jump to jump.

Each seed draws one robot by ``graphs/trials/real.yaml``. What a calibration would tell the controller comes from
the simulator's own draws, with errors of the size that a calibration is meant to reach (``studies/oracle``).
A robot that learns (``studies/jump_learning``) makes smaller jumps first, and then each jump several times with
fresh noise; it sees its own estimates alone. A run lands if ``blocks.JumpScore`` says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from typing import Any

from ...planner.library.learnt import LearntJumps, launch_of
from ...planner.library.library import PlanLibrary, shipped_folder
from ...planner.library.rehearsed import ZERO
from ...planner.task.plan import PlannedJump
from ...planner.task.task import make_task
from ...robots.description import find_robot
from ...runtime.graph import Graph
from ...studies.batch.jobs import job_results
from ...studies.expansion import load_cell
from ...studies.jump_learning import lesson_of
from ...studies.oracle import CALIBRATED, told_values
from ...studies.summary import wilson_interval
from ..rows import Row

SEEDS = range(97500, 97520)
"""The robots; nothing is tuned on them."""
LADDER = ({"rise": 0.02}, {"rise": 0.05}, {"rise": 0.08})
"""The smaller jumps before each series."""
SERIES: Mapping[str, Mapping[str, float]] = {
    "in place 12 cm": {"rise": 0.12},
    "ahead 20 cm": {"rise": 0.12, "distance_x": 0.2},
}
"""The jumps that are counted, as changes of ``graphs/jump.yaml``'s task."""
TIMES = 5
"""How often a robot that learns makes each of them."""
MISSED_GOAL = 0.05
"""The largest good share of robots that do not land."""
_NOISES = 1000


@dataclass(frozen=True)
class RobotJob:
    """A robot by its seed; whether its controller is told of it, and whether it learns."""

    seed: int
    told: bool
    learns: bool


def real_robot(seeds: Sequence[int] = SEEDS) -> list[Row]:
    """Rows: for each jump the share that lands, untold, calibrated, and learning, the first and last time."""
    arms = {
        "nothing told": (False, False),
        "calibrated": (True, False),
        "learning, nothing told": (False, True),
        "calibrated and learning": (True, True),
    }
    jobs = [RobotJob(seed, *arm) for arm in arms.values() for seed in seeds]
    landed: dict[tuple[bool, bool], list[list[list[bool]]]] = {arm: [] for arm in arms.values()}
    with closing(job_results(jumps_of, jobs)) as results:
        for result in results:
            if result.error:
                raise RuntimeError(result.error)
            job = jobs[result.index]
            landed[job.told, job.learns].append(result.value)
    rows = []
    for number, name in enumerate(SERIES):
        for title, arm in arms.items():
            robots = [runs[number] for runs in landed[arm]]
            rows.append(_row(f"{name}, {title}", robots, arm[1]))
    return rows


def jumps_of(job: RobotJob) -> list[list[bool]]:
    """Which jumps of a robot land, one list for each of the ``SERIES``."""
    learnt = LearntJumps("bruce")
    found, count = [], 0
    for asked in SERIES.values():
        landed: list[bool] = []
        tasks = [*(LADDER if job.learns else ()), *[asked] * (TIMES if job.learns else 1)]
        for task in tasks:
            count += 1
            plan = planned(frozenset(task.items()))
            correction = learnt.correction(launch_of(plan.task)) if job.learns else (ZERO, ZERO)
            graph = graph_of(job, task, count)
            velocity, momentum = map(list, correction)
            result = graph.changed(
                {"targets.velocity_correction": velocity, "targets.momentum_correction": momentum}
            ).run(log=job.learns)
            if task is asked:
                landed.append(result.success)
            if job.learns:
                mass = find_robot("bruce").total_mass
                lesson = lesson_of(result.signal, plan, mass, correction)
                learnt = learnt if lesson is None else learnt.with_lesson(lesson)
        found.append(landed)
    return found


def graph_of(job: RobotJob, task: Mapping[str, float], number: int) -> Graph:
    """The graph of a robot's jump, with noise of its own."""
    graphs = shipped_folder()
    include = [graphs / "trials/real.yaml", graphs / "controllers/late_sensors.yaml"]
    sets: dict[str, Any] = {
        "plan.task": dict(task), "robot.seed": job.seed, "robot.noise_seed": _NOISES * job.seed + number,
    }  # fmt: skip
    graph = load_cell(graphs / "jump.yaml", include, sets, graphs / "bench.yaml")
    return graph.changed(told_values(graph, CALIBRATED, seed=job.seed)) if job.told else graph


@cache
def planned(task: frozenset[tuple[str, float]]) -> PlannedJump:
    """The plan of a task of BRUCE, given by its items."""
    return PlanLibrary(find_robot("bruce"), None).plan(make_task({"name": "jump", **dict(task)}))[0]


def _row(what: str, robots: Sequence[Sequence[bool]], learns: bool) -> Row:
    last = [runs[-1] for runs in robots]
    low, high = wilson_interval(sum(last), len(last))
    times = [sum(run[k] for run in robots) for k in range(len(robots[0]))]
    told = f"{sum(last)} of {len(last)} robots, 95 % interval {low:.2f} to {high:.2f}, trial real"
    if learns:
        told += f"; jumps 1 to {len(times)}: {', '.join(map(str, times))}"
    return Row(f"do not land {what}", 1.0 - sum(last) / len(last), "", goal=MISSED_GOAL, note=told)
