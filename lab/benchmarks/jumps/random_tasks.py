"""The planner's success on random jumping tasks, drawn by a seed.

The range, uniform and independent unless said; all is for BRUCE's real actuators and the usual recipe:

================  ===========  ==================  =======================================
kind              rise         distance            besides
================  ===========  ==================  =======================================
in place          6-22 cm      -
forward           6-16 cm      up to 50 cm ahead
back              6-16 cm      up to 25 cm back
side              6-14 cm      up to 30 cm aside   either side
twist             6-16 cm      -                   up to 120 deg, either way
combined          6-14 cm      10 back to 25 ahead up to 12 cm aside, twist to 45 deg
step up           4-8 cm       16-25 cm ahead      2-12 cm higher; the rise is above the step
step down         5-12 cm      18-30 cm ahead      2-35 cm lower
================  ===========  ==================  =======================================

With ``harder`` they reach as far as jumps land at all: in place to 26 cm, forward to 62 cm, back to 28 cm, aside to 35 cm
with a turn of up to 30 deg, turns of up to 120 deg with up to 20 cm ahead, and steps from 30 cm down to 12 cm up with 20 to 35 cm
ahead. Each of these kinds begins where the usual range becomes hard.

Every kind is as likely as any other. A task counts as done if ``solve_and_check`` gives a plan,
which is then valid.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....planner.checking.validity import failure_text
from ....planner.library.library import solve_and_check
from ....planner.solving.solver_process import cpu_time
from ....planner.task.files import PlanError
from ....planner.task.plan import InvalidPlanError
from ....planner.task.task import JumpTask, make_task
from ....robots.description import RobotDescription, find_robot
from ..rows import Row

COUNT, SEED = 200, 1
MEDIAN_GOAL, MOST_GOAL, WORST_GOAL = 0.3, 1.5, 5.0
"""Processor time of planning [s]: the median's, that of 95 % of the tasks, and the worst."""
MISSED_GOAL = 0.05
"""The largest good share of tasks without a valid plan."""


def random_tasks(count: int = COUNT, seed: int = SEED, harder: bool = False) -> list[JumpTask]:
    """Draw the first ``count`` tasks of a seed; they are the same on every machine."""
    rng = np.random.default_rng(seed)
    ranges = _HARDER if harder else _KINDS
    kinds = list(ranges)
    return [
        make_task({"name": f"{kind} {number}", **ranges[kind](rng)})
        for number, kind in enumerate(kinds[rng.integers(len(kinds))] for _ in range(count))
    ]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 4)


def _signed(rng: np.random.Generator, most: float) -> float:
    return _between(rng, -most, most)


def _step(rng: np.random.Generator, rise: tuple[float, float], step: tuple[float, float],
          ahead: tuple[float, float]) -> dict[str, Any]:  # fmt: skip
    """Draw a jump onto or off a step; the rise is above the higher ground."""
    height = _between(rng, *step)
    return {
        "rise": round(_between(rng, *rise) + max(0.0, height), 4),
        "distance_x": _between(rng, *ahead),
        "landing_height": height,
    }


_KINDS: dict[str, Any] = {
    "in place": lambda rng: {"rise": _between(rng, 0.06, 0.22)},
    "forward": lambda rng: {
        "rise": _between(rng, 0.06, 0.16), "distance_x": _between(rng, 0.0, 0.50),
    },
    "back": lambda rng: {
        "rise": _between(rng, 0.06, 0.16), "distance_x": _between(rng, -0.25, 0.0),
    },
    "side": lambda rng: {"rise": _between(rng, 0.06, 0.14), "distance_y": _signed(rng, 0.30)},
    "twist": lambda rng: {
        "rise": _between(rng, 0.06, 0.16), "twist": _signed(rng, math.radians(120.0)),
    },
    "combined": lambda rng: {
        "rise": _between(rng, 0.06, 0.14), "distance_x": _between(rng, -0.10, 0.25),
        "distance_y": _signed(rng, 0.12), "twist": _signed(rng, math.radians(45.0)),
    },
    "step up": lambda rng: _step(rng, (0.04, 0.08), (0.02, 0.12), (0.16, 0.25)),
    "step down": lambda rng: _step(rng, (0.05, 0.12), (-0.35, -0.02), (0.18, 0.30)),
}  # fmt: skip

_HARDER: dict[str, Any] = {
    "high in place": lambda rng: {"rise": _between(rng, 0.14, 0.26)},
    "far forward": lambda rng: {
        "rise": _between(rng, 0.08, 0.16), "distance_x": _between(rng, 0.30, 0.62),
    },
    "far back": lambda rng: {
        "rise": _between(rng, 0.06, 0.16), "distance_x": _between(rng, -0.28, -0.12),
    },
    "far aside": lambda rng: {
        "rise": _between(rng, 0.06, 0.14), "distance_y": _signed(rng, 0.35),
        "twist": _signed(rng, math.radians(30.0)),
    },
    "far round": lambda rng: {
        "rise": _between(rng, 0.06, 0.16), "distance_x": _between(rng, 0.0, 0.20),
        "twist": _signed(rng, math.radians(120.0)),
    },
    "far step": lambda rng: _step(rng, (0.04, 0.12), (-0.30, 0.12), (0.20, 0.35)),
}  # fmt: skip


def random_rows(count: int = COUNT, seed: int = SEED) -> list[Row]:
    """Measure the share of tasks without a valid plan, and the CPU time of a valid one, from
    nothing to checked, refined where the check asked for it."""
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
    most = float(np.quantile(seconds, 0.95)) if seconds else math.nan
    return [
        Row("random tasks without a valid plan", share, "", goal=MISSED_GOAL,
            note=f"{count} tasks of seed {seed}" + (": " if missed else "") + "; ".join(missed)),
        Row("random tasks, plan and check, median", median, "s", goal=MEDIAN_GOAL),
        Row("random tasks, plan and check, 95 %", most, "s", goal=MOST_GOAL),
        Row("random tasks, plan and check, worst", max(seconds, default=math.nan), "s",
            goal=WORST_GOAL),
    ]  # fmt: skip


def plan_one(task: JumpTask, robot: RobotDescription) -> str:
    """Plan a task and return the reason why it has no valid plan; empty if it has one."""
    try:
        solve_and_check(task, robot)
    except (InvalidPlanError, PlanError) as error:
        return failure_text(error)
    return ""
