"""How what a person waits for grows: with blocks, ticks, knots of a plan, and joints of a robot.

Every point is processor time, measured in this build and an earlier one by turns, as in ``aloft bench speed``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from .earlier_build import Build, builds_beside
from .rows import Row
from .speed import CHAIN, PLANS, run_process

TURNS = 3
"""How often a program runs with each build; the processes of a robot's first jump run once."""

BLOCKS = (
    CHAIN
    + """
def measure(count):
    begin = time.process_time()
    with aloft.load(chain(count)).open():
        return time.process_time() - begin

measure(10)
print(json.dumps({str(count): min(measure(count) for _ in range(3)) for count in POINTS}))
"""
)
TICKS = """
import json, time
import aloft
from aloft.planner.library.library import shipped_folder

found, done = {}, 0
with aloft.load(shipped_folder() / "up_5cm.yaml").open() as run:
    run.step(20)
    begin = time.process_time()
    for count in POINTS:
        run.step(count - done)
        found[str(count)], done = time.process_time() - begin, count
print(json.dumps(found))
"""
KNOTS = """
import json, time
from aloft.planner.solving.solve import solve_jump
from aloft.planner.solving.solver_process import cpu_time
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

robot = find_robot("bruce")
shares = {"squat": 8, "thrust": 16, "flight": 28, "landing": 14}

def measure(count):
    knots = {name: share * count // 66 for name, share in shares.items()}
    task = make_task({"name": "new", "robot": "bruce", "rise": 0.11, "distance_x": 0.1, "knots": knots})
    begin = cpu_time()
    solve_jump(task, robot)
    return cpu_time() - begin

# the first one derives functions and makes the solver
print(json.dumps({str(count): min(measure(count) for _ in range(3)) for count in POINTS}))
"""
READING = """
import json, time
from pathlib import Path
from aloft.robots.description import read
from aloft.robots.importing.package_files import find_file

def measure(name):
    path = find_file(f"package://example-robot-data/robots/{name}", Path())
    begin = time.process_time()
    read(path)
    return time.process_time() - begin

for name in POINTS.values():  # imports what reading needs
    measure(name)
print(json.dumps({str(count): min(measure(name) for _ in range(3)) for count, name in POINTS.items()}))
"""


@dataclass(frozen=True)
class Growth:
    """What is measured over what.

    Attributes:
        work: what is measured; the rows' names begin with it.
        over: what grows.
        points: its values, each with the robot that has it.
        code: a program that prints the times [s] of all ``POINTS``; without it each point is a process.
        arguments: those of ``aloft`` for a point, with ``POINT`` in place of the robot.
        forgets: folders of the cache that are emptied before each process.
    """

    work: str
    over: str
    points: Mapping[int, str]
    code: str = ""
    arguments: Sequence[str] = ()
    forgets: Sequence[str] = ()


def _all(*points: int) -> dict[int, str]:
    return dict.fromkeys(points, "")


URDFS = {
    6: "ur_description/urdf/ur5_robot.urdf",
    12: "solo_description/robots/solo12.urdf",
    16: "allegro_hand_description/urdf/allegro_right_hand.urdf",
    20: "pr2_description/urdf/pr2.urdf",
    29: "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    43: "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
}
"""By the number of their joints; they are in the package ``example-robot-data``."""
CURVES = (
    Growth("load, bind and start a chain", "blocks", _all(100, 250, 500, 1000, 2000, 3500, 4900), BLOCKS),
    Growth("run BRUCE's jump of 5 cm", "ticks", _all(125, 250, 500, 750, 1000, 1250), TICKS),
    Growth("plan a jump of BRUCE, 10 cm ahead", "knots", _all(33, 66, 99, 132, 198, 264), KNOTS),
    Growth("read a URDF", "joints", URDFS, READING),
    Growth(
        "plan and run a robot's first jump", "joints",
        {10: "bruce", 12: "solo12", 13: "alexander", 29: "g1", 30: "talos"},
        arguments=("jump", "--robot", "POINT", "--rise", "6cm", "--no-record", "--json"), forgets=PLANS,
    ),
)  # fmt: skip


def growth(since: str = "", curves: Sequence[Growth] = CURVES) -> list[Row]:
    """Measure all points of all curves.

    Args:
        since: the earlier build, a folder or a commit; without it there are no ratios.

    Raises:
        AloftError: there is no such build.
        AssertionError: a process failed.
    """
    with builds_beside(since) as builds:
        return [row for curve in curves for row in _rows(curve, builds, since)]


def _rows(curve: Growth, builds: Sequence[Build], since: str) -> list[Row]:
    """Return a row for each point of a curve: the median time, and the median of all turns' ratios."""
    first = replace(curve, points=dict([next(iter(curve.points.items()))]))
    for build in builds:  # fills the caches
        _times(first, build)
    turns = []
    for turn in range(TURNS if curve.code else 1):
        order = sorted(range(len(builds)), reverse=turn % 2 == 1)
        found = {k: _times(curve, builds[k]) for k in order}
        turns.append([found[k] for k in range(len(builds))])
    return [
        Row(
            f"{curve.work}: {point} {curve.over}",
            median(found[0][point] for found in turns), "s", since,
            median(found[0][point] / found[1][point] for found in turns) if since else None,
        )
        for point in curve.points
    ]  # fmt: skip


def _times(curve: Growth, build: Build) -> dict[int, float]:
    """Return the processor time [s] of each point."""
    if curve.code:
        code = f"POINTS = {dict(curve.points)}\n{curve.code}"
        found = run_process(("-c", code), build)
        return {point: found[str(point)] for point in curve.points}
    return {
        point: run_process(
            ("-m", "aloft", *(robot if word == "POINT" else word for word in curve.arguments)),
            build, (0, 1), curve.forgets,
        )["time"]
        for point, robot in curve.points.items()
    }  # fmt: skip
