"""What a plan costs: CPU time of the ten basic tasks, cold and warm, and whether they are valid."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from ..blocks.planner.errors import PlanError
from ..blocks.planner.solve import solve_jump
from ..blocks.planner.task import JumpTask, make_task
from ..blocks.planner.validity import check_plan
from ..runtime.description import find_robot
from .rows import Row

BASIC: dict[str, dict[str, Any]] = {
    "in situ 7 cm": {"rise": 0.07},
    "in situ 10 cm": {"rise": 0.10},
    "in situ 15 cm": {"rise": 0.15},
    "forward 10 cm": {"rise": 0.15, "distance_x": 0.1},
    "back 10 cm": {"rise": 0.15, "distance_x": -0.1},
    "side 10 cm": {"rise": 0.15, "distance_y": 0.1},
    "twist 30 deg": {"rise": 0.15, "twist": math.radians(30.0)},
    "step up 5 cm": {"rise": 0.15, "landing_height": 0.05},
    "step up 5 cm, forward 10 cm": {"rise": 0.15, "landing_height": 0.05, "distance_x": 0.1},
    "step down 5 cm, forward 10 cm": {"rise": 0.12, "landing_height": -0.05, "distance_x": 0.1},
}
"""The tasks whose times are goals."""
NEAR: dict[str, dict[str, Any]] = {
    "14.5 cm": {"rise": 0.145},
    "forward 2 cm": {"rise": 0.15, "distance_x": 0.02},
}
"""Tasks started from the plan in situ of 15 cm."""
MEDIAN_GOAL, WORST_GOAL, WARM_GOAL = 0.35, 1.0, 0.15


def planner(rounds: int = 3) -> list[Row]:
    """The rows: CPU seconds of ``solve_jump`` as a whole, median of ``rounds``, functions compiled
    before; the solver's structure is kept from round to round, as in any process that plans twice.
    """
    robot = find_robot("bruce")
    rows, times, valid = [], [], 0
    for name, values in BASIC.items():
        task = make_task({"name": name, **values})
        seconds, plan = _measure(task, rounds)
        if plan is None:
            rows.append(Row(f"plan {name}", None, "s", goal=WORST_GOAL, note="no plan"))
            continue
        report = check_plan(plan, robot)
        valid += report.valid
        note = f"{plan.statistics['iterations']} iterations, {len(plan.time)} knots"
        if not report.valid:
            note += ", not valid: " + ", ".join(test.name for test in report.failed)
        rows.append(Row(f"plan {name}", seconds, "s", note=note))
        times.append(seconds)
    rows.append(Row("plan, median of basic tasks", float(np.median(times)), "s", goal=MEDIAN_GOAL))
    rows.append(Row("plan, worst of basic tasks", float(max(times)), "s", goal=WORST_GOAL))
    rows.append(Row("basic tasks without a valid plan", float(len(BASIC) - valid), "", goal=0.0))
    first = solve_jump(make_task({"name": "first", **BASIC["in situ 15 cm"]}), robot)
    for name, values in NEAR.items():
        seconds, plan = _measure(make_task({"name": name, **values}), rounds, first)
        note = "" if plan is None else f"{plan.statistics['iterations']} iterations"
        rows.append(Row(f"plan {name}, warm", seconds, "s", goal=WARM_GOAL, note=note))
    return rows


def _measure(task: JumpTask, rounds: int, warm: Any = None) -> tuple[float, Any]:
    robot = find_robot("bruce")
    times, plan = [], None
    try:
        solve_jump(task, robot, warm_start=warm)  # compiles what has to be compiled
        for _ in range(rounds):
            start = time.process_time()
            plan = solve_jump(task, robot, warm_start=warm)
            times.append(time.process_time() - start)
    except PlanError:
        return math.nan, None
    return float(np.median(times)), plan
