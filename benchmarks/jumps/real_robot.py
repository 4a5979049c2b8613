"""Jumps of simulated robots as a bench finds them: untold, calibrated, and learning from jump to jump.

Each seed draws one robot by ``graphs/trials/real.yaml``. It is calibrated by ``aloft robot calibrate``, from its own
motion alone; or the controller is told what the simulator drew, with errors of the size that a calibration is
meant to reach (``studies/oracle``). A robot that learns (``studies/jump_learning``) makes smaller jumps first, and then each jump several times with
fresh noise; it sees its own estimates alone. A run lands if ``blocks.JumpScore`` says so.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

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
ARMS: Mapping[str, tuple[Literal["nothing", "calibration", "draws"], bool]] = {
    "nothing told": ("nothing", False),
    "calibrated": ("calibration", False),
    "learning, nothing told": ("nothing", True),
    "calibrated and learning": ("calibration", True),
    "told within the calibration's goals, learning": ("draws", True),
}
TIMES = 5
"""How often a robot that learns makes each of them."""
MISSED_GOAL = 0.05
"""The largest good share of robots that do not land."""
FOLDER = Path("results") / "real_robot"
"""Where the fragments of calibrations go."""
_NOISES = 1000


@dataclass(frozen=True)
class RobotJob:
    """A robot by its seed; where what its controller is told of it comes from, and whether it learns."""

    seed: int
    told: Literal["nothing", "calibration", "draws"]
    learns: bool


def real_robot(seeds: Sequence[int] = SEEDS) -> list[Row]:
    """Rows: for each jump the share that lands, untold, calibrated, and learning, the first and last time."""
    jobs = [RobotJob(seed, *arm) for seed in seeds for arm in ARMS.values()]
    landed: dict[tuple[str, bool], list[list[list[bool]]]] = {arm: [] for arm in ARMS.values()}
    with closing(job_results(jumps_of, jobs)) as results:
        for result in results:
            if result.error:
                raise RuntimeError(result.error)
            job = jobs[result.index]
            landed[job.told, job.learns].append(result.value)
    rows = []
    for number, name in enumerate(SERIES):
        for title, arm in ARMS.items():
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
    if job.told == "calibration":
        include.append(calibrated(job.seed))
    sets: dict[str, Any] = {
        "plan.task": dict(task), "robot.seed": job.seed, "robot.noise_seed": _NOISES * job.seed + number,
    }  # fmt: skip
    graph = load_cell(graphs / "jump.yaml", include, sets, graphs / "bench.yaml")
    if job.told == "draws":
        return graph.changed(told_values(graph, CALIBRATED, seed=job.seed))
    return graph


@cache
def calibrated(seed: int) -> Path:
    """The fragment that a calibration of the robot writes. Raises ``CalledProcessError``."""
    folder = FOLDER.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"robot_{seed}.yaml"
    graph = str(shipped_folder() / "calibrate.yaml")
    words = ["robot", "calibrate", graph, "--set", f"robot.seed={seed}", "--out", str(file)]
    subprocess.run([sys.executable, "-m", "aloft", *words], check=True, capture_output=True)
    return file


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
