"""What a plan costs: CPU time of the ten basic tasks, cold and warm, whether they are valid, the other
formulations, and other solvers on the same problem."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...planner.checking.validity import check_plan
from ...planner.solving.solve import solve_jump
from ...planner.solving.solver_process import cpu_time
from ...planner.task.files import PlanError
from ...planner.task.task import JumpTask, make_task
from ...robots.description import find_robot
from ..jumps.random_tasks import random_rows
from ..rows import Row
from .neighbours import neighbour_rows
from .reach import reach_rows
from .solvers import solver_rows

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
GRIDS: dict[str, tuple[dict[str, int], float]] = {
    "33": ({"squat": 4, "thrust": 8, "flight": 14, "landing": 7}, 0.10),
    "66": ({"squat": 8, "thrust": 16, "flight": 28, "landing": 14}, 0.15),
}
"""Intervals a warm start is measured with, and its goal [s]."""
BESIDE = ("in situ 15 cm", "forward 10 cm")
"""The tasks that other solvers solve too."""
MEDIAN_GOAL, WORST_GOAL = 0.35, 1.0


def planner(rounds: int = 3) -> list[Row]:
    """The rows: CPU seconds of ``solve_jump`` as a whole, median of ``rounds``, functions compiled
    before; the solver's structure is kept from round to round, as in any process that plans twice.
    """
    robot = find_robot("bruce")
    rows, times, valid = [], [], 0
    for name, values in BASIC.items():
        task = make_task({"name": name, "recipe": "paper", **values})
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
    for count, (knots, goal) in GRIDS.items():
        first = make_task(
            {"name": "first", "recipe": "paper", **BASIC["in situ 15 cm"], "knots": knots}
        )
        plan = solve_jump(first, robot)
        for name, values in NEAR.items():
            near = make_task({"name": name, "recipe": "paper", **values, "knots": knots})
            seconds, found = _measure(near, rounds, plan)
            note = "" if found is None else f"{found.statistics['iterations']} iterations"
            title = f"plan {name}, warm, {count} intervals"
            rows.append(Row(title, seconds, "s", goal=goal, note=note))
    for formulation in ("paper", "srbm"):
        task = make_task(
            {"name": formulation, **BASIC["in situ 15 cm"], "formulation": formulation}
        )
        seconds, plan_of = _measure(task, 1)
        note = "no plan" if plan_of is None else f"{plan_of.statistics['iterations']} iterations"
        rows.append(Row(f"plan in situ 15 cm, formulation {formulation}", seconds, "s", note=note))
    rows += solver_rows({name: BASIC[name] for name in BESIDE}, rounds)
    return [*rows, *neighbour_rows(), *reach_rows(), *random_rows()]


def _measure(task: JumpTask, rounds: int, warm: Any = None) -> tuple[float, Any]:
    robot = find_robot("bruce")
    times, plan = [], None
    try:
        solve_jump(task, robot, warm_start=warm)  # compiles what has to be compiled
        for _ in range(rounds):
            start = cpu_time()
            plan = solve_jump(task, robot, warm_start=warm)
            times.append(cpu_time() - start)
    except PlanError:
        return math.nan, None
    return float(np.median(times)), plan
