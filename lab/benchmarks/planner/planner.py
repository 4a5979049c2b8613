"""Cost of a plan: CPU time of the ten basic tasks, cold and warm, and the validity of the plans.

The other formulations and other solvers get the same tasks. Solvers get the same problem object and
guess, and their CPU time is taken on one core: fatrop, IPOPT, and SNOPT through Drake where Drake is
installed. SNOPT is untuned (see ``snopt.OPTIONS``). It starts from the planner's cold guess and, as
the paper's authors do, from the solution of a near task.

A plan that starts from the library's neighbour is measured on jumps like the shipped ones: every
shipped task with one jump of BRUCE's that the recipe plans is changed at once in all that it says,
the rise by up to 1 cm, the place of landing by up to 2 cm and the turn by up to 6 degrees, uniformly
by a seed. Last come the hardest tasks that are goals with the real actuators.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ....planner.checking.validity import check_plan, failure_text
from ....planner.library.library import PlanLibrary, shipped_folder, solve_and_check
from ....planner.problem.guess import ballistic_guess
from ....planner.problem.problem import FullProblem
from ....planner.solving.solve import make_problem, solve_jump
from ....planner.solving.solver import Solution, solve
from ....planner.solving.solver_process import cpu_time
from ....planner.task.files import PlanError
from ....planner.task.plan import InvalidPlanError
from ....planner.task.read_task import read_task
from ....planner.task.task import JumpTask, make_task
from ....robots.description import find_robot
from ....runtime.loading.reading.files import FOLDER
from ..jumps.random_tasks import random_rows
from ..rows import Row
from .snopt import SnoptProgram, SnoptResult

GOAL = 0.1
"""Processor time of a plan [s]."""
CHANGES = {"rise": 0.01, "distance_x": 0.02, "distance_y": 0.02, "twist": math.radians(6.0)}
"""The most that each parameter changes by, where the task says it."""
SEED = 1


def neighbours(seed: int = SEED) -> list[JumpTask]:
    """Draw the changed tasks, in the order of the files of the shipped ones; they are the same on
    every machine."""
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
    """Measure the CPU time of the search in the library, the solve and the check, each task planned
    for the second time in this process; and how many have no valid plan."""
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
                    failed = f"{task.name} ({failure_text(error)})"
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
    """Measure the CPU seconds from nothing to a checked plan of each task, none where there is no
    valid plan; and the flight error of the shipped somersaults, by exact dynamics."""
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


SNOPT = "SNOPT through Drake"
SNOPT_GOAL = 1.0 / 30.0
TIME_LIMIT = 120.0
"""CPU time that SNOPT is given for a task [s]."""
INSTALL = "Drake is not installed; the extra peers has it"


def solver_rows(tasks: dict[str, dict[str, Any]], rounds: int = 3) -> list[Row]:
    """Measure IPOPT and SNOPT on those tasks; ``ratio`` is fatrop's time by the other's."""
    rows = []
    for name, values in tasks.items():
        problem = _problem(name, values)
        cold = ballistic_guess(problem)
        fatrop = _repeated(problem, cold, "fatrop", rounds)
        ipopt = _repeated(problem, cold, "ipopt", rounds)
        knots = f"{problem.knots} knots, {problem.coordinates.name} coordinates"
        rows.append(
            Row(f"solve {name}, fatrop", fatrop.cpu, "s", "IPOPT", fatrop.cpu / ipopt.cpu,
                note=f"{knots}; IPOPT {ipopt.cpu:.3f} s, {ipopt.iterations} iterations")
        )  # fmt: skip
        rows += _snopt_rows(name, values, problem, cold, fatrop)
    return rows


def _problem(name: str, values: dict[str, Any]) -> FullProblem:
    return make_problem(make_task({"name": name, **values}), find_robot("bruce"))


def _repeated(problem: FullProblem, guess: Any, solver: str, rounds: int, warm: bool = False
              ) -> Solution:  # fmt: skip
    solve(problem, guess, solver=solver, warm=warm)  # makes the solver
    found = [solve(problem, guess, solver=solver, warm=warm) for _ in range(rounds)]
    return sorted(found, key=lambda solution: solution.cpu)[rounds // 2]


def _snopt_rows(
    name: str, values: dict[str, Any], problem: FullProblem, cold: Any, fatrop: Solution
) -> list[Row]:
    titles = f"solve {name}, fatrop", f"solve {name} from a near task, fatrop"
    try:
        program = SnoptProgram(problem)
    except ImportError:
        return [Row(title, None, "s", SNOPT, goal=SNOPT_GOAL, note=INSTALL) for title in titles]
    near = _problem(name, values | {"rise": values["rise"] - 0.005})
    start = solve(near, ballistic_guess(near)).values
    warm = _repeated(problem, start, "fatrop", 3, warm=True)
    return [
        _beside(titles[0], fatrop, program.solve(cold, time_limit=TIME_LIMIT)),
        _beside(titles[1], warm, program.solve(start, time_limit=TIME_LIMIT)),
    ]


def _beside(title: str, own: Solution, other: SnoptResult) -> Row:
    """Return a row; where SNOPT finds nothing there is no solution to compare with, so no goal is
    met."""
    note = (
        f"SNOPT {other.cpu:.2f} s, {other.callback_cpu:.2f} s of it in callbacks, "
        f"info {other.info}, cost {other.cost:.5g} (fatrop {own.cost:.5g}), "
        f"violation {other.violation:.1e}"
    )
    without = other.cpu - other.callback_cpu
    note += f"; ratio without callbacks {own.cpu / max(without, 1e-9):.4f}"
    solved = other.solved and bool(np.isfinite(other.cost))
    if not solved:
        note += "; it ended without a solution, so this is the time it took to give up"
    return Row(title, own.cpu, "s", SNOPT, own.cpu / other.cpu,
               goal=SNOPT_GOAL if solved else None, note=note)  # fmt: skip


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
    """Measure the CPU seconds of ``solve_jump`` as a whole, median of ``rounds``, functions
    compiled before; the solver's structure is kept from round to round, as in any process that
    plans twice.
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
