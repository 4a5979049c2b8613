"""The planner's success on jumps that nobody chose: tasks that are drawn by a seed.

The range, within reach of BRUCE's real actuators, uniform and independent unless said (signs are
drawn too; all is for the robot's first actuator profile at full effort, with no weight or time changed):

================  ===========  ==================  =======================================
kind              rise         distance            besides
================  ===========  ==================  =======================================
in place          5-18 cm      -
forward           8-16 cm      up to 20 cm ahead
back              8-16 cm      up to 15 cm back
side              8-16 cm      up to 15 cm aside   either side
twist             8-16 cm      -                   up to 45 deg, either way
combined          8-14 cm      up to 10 cm ahead   or back; up to 8 cm aside, twist to 25 deg
step up           12-15 cm     10-18 cm ahead      2-5 cm higher
step down         8-12 cm      10-18 cm ahead      2-6 cm lower
================  ===========  ==================  =======================================

Every kind is as likely as any other. A task counts as done if ``solve_and_check`` gives a plan,
which is then valid.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..planner.checking.validity import InvalidPlanError
from ..planner.library.library import solve_and_check
from ..planner.solving.bounded import cpu_time
from ..planner.task.errors import PlanError
from ..planner.task.task import JumpTask, make_task
from ..robots.description import RobotDescription, find_robot
from .rows import Row

COUNT, SEED = 200, 1
MISSED_GOAL = 0.05
"""The largest good share of tasks without a valid plan."""


def random_tasks(count: int = COUNT, seed: int = SEED) -> list[JumpTask]:
    """The first ``count`` tasks of a seed; the same on every machine."""
    rng = np.random.default_rng(seed)
    kinds = list(_KINDS)
    return [
        make_task({"name": f"{kind} {number}", **_KINDS[kind](rng)})
        for number, kind in enumerate(kinds[rng.integers(len(kinds))] for _ in range(count))
    ]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 4)


def _signed(rng: np.random.Generator, most: float) -> float:
    return _between(rng, -most, most)


def _step(rng: np.random.Generator, rise: tuple[float, float], step: tuple[float, float]
          ) -> dict[str, Any]:  # fmt: skip
    return {
        "rise": _between(rng, *rise),
        "distance_x": _between(rng, 0.10, 0.18),
        "landing_height": _between(rng, *step),
    }


_KINDS: dict[str, Any] = {
    "in place": lambda rng: {"rise": _between(rng, 0.05, 0.18)},
    "forward": lambda rng: {
        "rise": _between(rng, 0.08, 0.16), "distance_x": _between(rng, 0.0, 0.20),
    },
    "back": lambda rng: {
        "rise": _between(rng, 0.08, 0.16), "distance_x": _between(rng, -0.15, 0.0),
    },
    "side": lambda rng: {"rise": _between(rng, 0.08, 0.16), "distance_y": _signed(rng, 0.15)},
    "twist": lambda rng: {
        "rise": _between(rng, 0.08, 0.16), "twist": _signed(rng, math.radians(45.0)),
    },
    "combined": lambda rng: {
        "rise": _between(rng, 0.08, 0.14), "distance_x": _signed(rng, 0.10),
        "distance_y": _signed(rng, 0.08), "twist": _signed(rng, math.radians(25.0)),
    },
    "step up": lambda rng: _step(rng, (0.12, 0.15), (0.02, 0.05)),
    "step down": lambda rng: _step(rng, (0.08, 0.12), (-0.06, -0.02)),
}  # fmt: skip


def random_rows(count: int = COUNT, seed: int = SEED) -> list[Row]:
    """Rows: the share of tasks without a valid plan, and the CPU time of a valid one, from nothing
    to checked, refined where the check asked for it."""
    robot = find_robot("bruce")
    seconds, missed = [], list[str]()
    for task in random_tasks(count, seed):
        start = cpu_time()
        reason = plan_one(task, robot)
        if reason:
            missed.append(f"{task.name} ({reason})")
        else:
            seconds.append(cpu_time() - start)
    share = len(missed) / count
    median = float(np.median(seconds)) if seconds else math.nan
    return [
        Row("random tasks without a valid plan", share, "", goal=MISSED_GOAL,
            note=f"{count} tasks of seed {seed}" + (": " if missed else "") + "; ".join(missed)),
        Row("random tasks, plan and check, median", median, "s"),
        Row("random tasks, plan and check, worst", max(seconds, default=math.nan), "s"),
    ]  # fmt: skip


def plan_one(task: JumpTask, robot: RobotDescription) -> str:
    """Why a task has no valid plan; empty if it has one."""
    try:
        solve_and_check(task, robot)
    except InvalidPlanError as error:
        return ", ".join(t["name"] for t in error.plan.report["tests"] if not t["passed"])
    except PlanError as error:
        return error.family or "no plan"
    return ""
