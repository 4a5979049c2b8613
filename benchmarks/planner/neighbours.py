"""What a plan costs that starts from the library's neighbour: jumps like the shipped ones, a little changed by a seed.

Every shipped task with one jump of BRUCE's that the recipe plans is changed at once in all that it says: the rise
by up to 1 cm, the place of landing by up to 2 cm and the turn by up to 6 degrees, uniformly.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from ...planner.checking.validity import InvalidPlanError
from ...planner.library.library import PlanLibrary, shipped_folder, solve_and_check
from ...planner.solving.solver_process import cpu_time
from ...planner.task.files import PlanError
from ...planner.task.read_task import read_task
from ...planner.task.task import JumpTask
from ...robots.description import find_robot
from ..jumps.random_tasks import why_not
from ..rows import Row

GOAL = 0.1
"""s of processor time"""
CHANGES = {"rise": 0.01, "distance_x": 0.02, "distance_y": 0.02, "twist": math.radians(6.0)}
"""The most that each parameter changes by, where the task says it."""
SEED = 1


def neighbours(seed: int = SEED) -> list[JumpTask]:
    """The changed tasks, in the order of the files of the shipped ones; the same on every machine."""
    generator = np.random.default_rng(seed)
    found = []
    for path in sorted((shipped_folder() / "tasks").glob("*.yaml")):
        if "robot:" in path.read_text():
            continue  # another robot's, whose files may not be installed
        task = read_task(path)
        if len(task.hops()) > 1 or task.rotation or task.recipe == "paper":
            continue
        changed: dict[str, object] = {"name": f"{task.name} nearby"}
        for name, most in CHANGES.items():
            share = float(generator.uniform(-1.0, 1.0))
            value = getattr(task, name)
            if value:
                changed[name] = round(value + most * share, 4)
        found.append(task.model_copy(update=changed))
    return found


def neighbour_rows(seed: int = SEED) -> list[Row]:
    """Rows: CPU time of the search in the library, the solve and the check, each task planned for the second time
    in this process; and how many have no valid plan."""
    robot = find_robot("bruce")
    rows, missed = [], list[str]()
    with tempfile.TemporaryDirectory() as folder:
        library = PlanLibrary(robot, Path(folder))
        times: dict[str, list[float]] = {}
        iterations: dict[str, list[int]] = {}
        for task in neighbours(seed):
            if library.nearest(task) is None:
                continue  # where the recipe changes, no plan is like it
            for _ in range(2):  # the first compiles what has to be compiled, and sets the solver up
                start = cpu_time()
                near = library.nearest(task)
                try:
                    plan = solve_and_check(task, robot, near[0] if near else None)
                except (PlanError, InvalidPlanError) as error:
                    failed = f"{task.name} ({why_not(error)})"
                else:
                    failed = ""
                spent = cpu_time() - start
            if failed:
                missed.append(failed)
                continue
            kind = plan.statistics["coordinates"]
            times.setdefault(kind, []).append(spent)
            iterations.setdefault(kind, []).append(plan.statistics["iterations"])
        for kind in sorted(times, reverse=True):
            note = f"{len(times[kind])} tasks, {np.median(iterations[kind]):g} iterations"
            title = f"plan from the library's neighbour, {kind} coordinates"
            rows.append(
                Row(f"{title}, median", float(np.median(times[kind])), "s", goal=GOAL, note=note)
            )
            rows.append(Row(f"{title}, worst", max(times[kind]), "s"))
    rows.append(
        Row("neighbours without a valid plan", float(len(missed)), "", note="; ".join(missed))
    )
    return rows
