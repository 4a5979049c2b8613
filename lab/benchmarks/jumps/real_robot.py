"""Jumps of simulated robots as a bench finds them: untold, calibrated, and learning from jump to jump.

Each seed draws one robot by ``graphs/trials/real.yaml``. It is calibrated once by ``aloft robot calibrate``, from its own
motion alone; or the controller is told what the simulator drew, with errors of the size that a calibration is
meant to reach (``studies/oracle``). A robot that learns (``studies/rehearsing/learning``) makes smaller jumps first, and then each jump several times with
fresh noise; it sees its own estimates alone. What it learns stays from one kind of jump to the next, in a file that the graph reads by
``plan.learnt``. A run lands if ``blocks.JumpScore`` says so.

Robots follow one another, and ``results/real_robot/results.json`` has all that are done, so a run that is stopped loses one robot.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

from ....extensions.commissioning.identification.robot_calibration import (
    calibrated_fragment,
)
from ....planner.library.learnt import LearntJumps, launch_of, write_learnt
from ....planner.library.library import PlanLibrary, shipped_folder
from ....planner.task.plan import PlannedJump
from ....planner.task.task import make_task
from ....robots.description import find_robot
from ....runtime.graph import Graph, load
from ....runtime.language.errors import AloftError
from ....runtime.loading.reading.files import graph_path
from ....studies.batch.jobs import job_results
from ....studies.expansion import load_cell
from ....studies.rehearsing.learning import lesson_of
from ....studies.summary import wilson_interval
from ...studies.oracle import CALIBRATED, oracle_values
from ..rows import Row
from .real_tasks import ASKED_OF_OTHERS, EFFORT, EVERY, AskedJump, asked_of

SEEDS = range(97500, 97520)
"""The robots; nothing is tuned on them."""
Told = Literal["nothing", "calibration", "draws"]
ARMS: Mapping[str, tuple[Told, bool]] = {
    "nothing told": ("nothing", False),
    "calibrated": ("calibration", False),
    "learning, nothing told": ("nothing", True),
    "calibrated and learning": ("calibration", True),
    "told within the calibration's goals, learning": ("draws", True),
}
"""The controller's knowledge of each arm, and whether the robot learns."""
MISSED_GOAL = 0.05
"""The largest good share of robots that do not land."""
FOLDER = Path("results") / "real_robot"
"""Folder of the results, the fragments of calibrations and the files that robots have learnt."""
_NOISES = 1000


@dataclass(frozen=True)
class RobotJob:
    """A robot by its seed, and what it does in which arms."""

    seed: int
    arms: tuple[str, ...] = tuple(ARMS)
    asked: tuple[str, ...] = EVERY
    robot: str = "bruce"


Jumps = dict[str, list[dict[str, Any]]]
"""The outcomes of jumps by kind: ``success``, ``reason``, and the largest tilt [deg]."""


def real_robot(
    seeds: Sequence[int] = SEEDS, arms: Sequence[str] = (), asked: Sequence[str] = (), workers: int = 0,
    robot: str = "bruce",
) -> list[Row]:  # fmt: skip
    """Measure for each jump and arm the share of robots that do not land the last time.

    Args:
        seeds: of the robots.
        arms, asked: some of ``ARMS`` and of the robot's jumps (``real_tasks``); none: all.
        workers: processes; 0: as many as there are processors.
        robot: BRUCE, or one of ``ASKED_OF_OTHERS``.

    Raises:
        AloftError: there is no such arm, jump or robot.
    """
    (robot,) = chosen("robot", (robot,), ("bruce", *ASKED_OF_OTHERS))
    there = tuple(asked_of(0, robot))
    job = RobotJob(0, chosen("arm", arms, tuple(ARMS)), chosen("jump", asked, there), robot)
    jobs = [replace(job, seed=seed) for seed in seeds]
    file = FOLDER / ("results.json" if robot == "bruce" else f"results_{robot}.json")
    robots: list[dict[str, Any]] = []
    FOLDER.mkdir(parents=True, exist_ok=True)
    with closing(job_results(jumps_of, jobs, workers=workers)) as results:
        for result in results:
            if result.error:
                raise RuntimeError(result.error)
            robots.append({"seed": jobs[result.index].seed, "arms": result.value})
            robots.sort(key=lambda each: each["seed"])
            text = json.dumps({"effort": EFFORT, "robots": robots}, indent=1)
            file.write_text(text + "\n", encoding="utf-8")
    return [
        _row(f"{name}, {arm}", [each["arms"][arm][name] for each in robots])
        for name in job.asked
        for arm in job.arms
    ]


def chosen(what: str, names: Sequence[str], there: tuple[str, ...]) -> tuple[str, ...]:
    """Check the names and return them, by default all that there are. Raises ``AloftError`` for
    others."""
    for name in names:
        if name not in there:
            raise AloftError(f"there is no {what} {name!r}; there is {', '.join(map(repr, there))}")
    return tuple(names) or there


def jumps_of(job: RobotJob) -> dict[str, Jumps]:
    """Run a robot's jumps and return their outcomes by arm."""
    return {arm: jumps_in(arm, job) for arm in job.arms}


def jumps_in(arm: str, job: RobotJob) -> Jumps:
    """Run a robot's jumps in one arm and return their outcomes."""
    told, learns = ARMS[arm]
    file = (FOLDER / f"{_owner(job.robot)}_{job.seed}_{tuple(ARMS).index(arm)}.json").absolute()
    learnt, found, count = LearntJumps(job.robot), Jumps(), 0
    for name, asked in asked_of(job.seed, job.robot).items():
        if name not in job.asked:
            continue
        tasks: list[Mapping[str, Any]] = [asked.task] * (asked.times if learns else 1)
        if learns:
            tasks = [*asked.before(first=not found), *tasks]
        found[name] = []
        for task in tasks:
            count += 1
            if learns:
                write_learnt(file, learnt)
            graph = graph_of(job.seed, told, asked, task, count, file if learns else None)
            result = graph.run(log=learns)
            if task is asked.task:
                tilt = result.metrics.get("peak_tilt_deg")
                found[name].append(
                    {"success": result.success, "reason": result.reason, "tilt": tilt}
                )
            if learns and asked.alone:
                plan, mass = planned(task, job.robot), find_robot(job.robot).total_mass
                applied = learnt.correction(launch_of(plan.task))
                lesson = lesson_of(result.signal, plan, mass, applied)
                learnt = learnt if lesson is None else learnt.with_lesson(lesson)
    return found


def graph_of(
    seed: int, told: Told, asked: AskedJump, task: Mapping[str, Any], number: int,
    learnt: Path | None = None,
) -> Graph:  # fmt: skip
    """Return the graph of a robot's jump, with noise of its own."""
    graphs = shipped_folder()
    include = [graphs / "trials/real.yaml", graphs / "controllers/late_sensors.yaml"]
    if told == "calibration":
        of_robots = "robots/" if asked.graph.startswith("robots/") else ""
        sway = graph_path(f"aloft:commissioning/{of_robots}calibrate")
        include.append(calibrated(sway, seed, _owner(asked.robot), asked.robot))
    sets: dict[str, Any] = {
        "plan.task": with_margin(task), "robot.seed": seed, "robot.noise_seed": _NOISES * seed + number,
        **asked.sets,
    }  # fmt: skip
    if learnt is not None:
        sets["plan.learnt"] = str(learnt)
    behind = [graphs / asked.behind] if asked.behind else []
    graph = load_cell(graphs / asked.graph, include, sets, graphs / "bench.yaml", behind)
    if told == "draws":
        return graph.changed(oracle_values(graph, CALIBRATED, seed=seed))
    return graph


def with_margin(task: Mapping[str, Any]) -> dict[str, Any]:
    """Return the task with the effort ``EFFORT`` for its plan."""
    return {"effort": EFFORT, **task}


@cache
def calibrated(graph: Path, seed: int, name: str, robot: str = "bruce") -> Path:
    """Calibrate a robot that sways in a graph, and return the fragment that this writes. Raises
    ``AloftError``."""
    folder = FOLDER.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}_{seed}.yaml"
    text = calibrated_fragment(load(graph, [f"robot={robot}", f"robot.seed={seed}"]), graph.name)
    file.write_text(text, encoding="utf-8")
    return file


def planned(task: Mapping[str, Any], robot: str) -> PlannedJump:
    """Plan a robot's task."""
    return _planned(frozenset({**with_margin(task), "robot": robot}.items()))


@cache
def _planned(task: frozenset[tuple[str, Any]]) -> PlannedJump:
    made = make_task({"name": "jump", **dict(task)})
    return PlanLibrary(find_robot(made.robot), None).plan(made)[0]


def _owner(robot: str) -> str:
    """Return the prefix of a robot's files."""
    return "robot" if robot == "bruce" else robot


def _row(what: str, robots: Sequence[Sequence[Mapping[str, Any]]]) -> Row:
    times = [sum(run[k]["success"] for run in robots) for k in range(len(robots[0]))]
    more = ", trial real"
    if len(times) > 1:
        more += f"; jumps 1 to {len(times)}: {', '.join(map(str, times))}"
    return missed_row(what, times[-1], len(robots), MISSED_GOAL, more)


def missed_row(what: str, landed: int, n: int, goal: float, more: str = "") -> Row:
    """Return the share of n robots that do not land, of which ``landed`` do; ``more`` ends the
    note."""
    low, high = wilson_interval(landed, n)
    note = f"{landed} of {n} robots, 95 % interval {low:.2f} to {high:.2f}{more}"
    return Row(f"do not land {what}", 1.0 - landed / n, "", goal=goal, note=note)
