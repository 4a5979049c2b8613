"""How far the planner reaches with the real actuators: the hardest tasks that are goals."""

from __future__ import annotations

import math
from typing import Any

from ...planner.checking.validity import InvalidPlanError, check_plan
from ...planner.library.library import PlanLibrary, solve_and_check
from ...planner.solving.solver_process import cpu_time
from ...planner.task.files import PlanError
from ...planner.task.read_task import read_task
from ...planner.task.task import make_task
from ...robots.description import find_robot
from ...runtime.loading.reading.files import FOLDER
from ..rows import Row

REACH: dict[str, dict[str, Any]] = {
    "rise 20 cm": {"rise": 0.20},
    "forward 30 cm": {"rise": 0.10, "distance_x": 0.30},
    "side 20 cm": {"rise": 0.15, "distance_y": 0.20},
    "twist 60 deg": {"rise": 0.15, "twist": math.radians(60.0)},
    "step up 10 cm": {"rise": 0.15, "landing_height": 0.10, "distance_x": 0.20},
}
"""Profile ``koala`` at full effort, on the intervals that the check asks for."""
SOMERSAULTS = ("somersault_in_place", "somersault_forward_35cm", "somersault_backward_35cm")
"""Shipped plans; the files of their tasks state the motors."""
FLIGHT_GOAL = 1.0
"""mm"""


def reach_rows() -> list[Row]:
    """Rows: CPU seconds from nothing to a checked plan of each task, none where there is no valid
    plan; and the flight error of the shipped somersaults, by exact dynamics."""
    robot = find_robot("bruce")
    rows = []
    for name, values in REACH.items():
        start = cpu_time()
        try:
            plan = solve_and_check(make_task({"name": name, "recipe": "paper", **values}), robot)
        except (PlanError, InvalidPlanError) as error:
            rows.append(Row(f"reach {name}", None, "s", note=str(error)))
            continue
        note = f"valid, {len(plan.time)} knots"
        rows.append(Row(f"reach {name}", cpu_time() - start, "s", note=note))
    for name in SOMERSAULTS:
        task = read_task(FOLDER / "tasks" / f"{name}.yaml")
        kept = PlanLibrary(robot).find(task)
        report = None if kept is None else check_plan(kept, robot)
        error_mm = report.figures["flight_error_mm"] if report and report.valid else None
        note = f"{task.profile}, effort {task.effort:g}" + ("" if error_mm else ", no valid plan")
        rows.append(Row(f"{name}, flight error", error_mm, "mm", goal=FLIGHT_GOAL, note=note))
    return rows
