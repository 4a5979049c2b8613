"""The planner's solver beside others on the same problem, in the same run.

One problem object, one guess, each solver's CPU time on one core: fatrop, IPOPT, and SNOPT through
Drake where Drake is installed. SNOPT is untuned (see ``snopt.OPTIONS``). It starts from the
planner's cold guess and, as the paper's authors do, from the solution of a near task.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner.problem.guess import ballistic_guess
from ...planner.problem.problem import Problem
from ...planner.solving.solve import make_problem
from ...planner.solving.solver import Solution, solve
from ...planner.task.task import make_task
from ...robots.description import find_robot
from ..rows import Row
from .snopt import SnoptProgram, SnoptResult

SNOPT = "SNOPT through Drake"
SNOPT_GOAL = 1.0 / 30.0
TIME_LIMIT = 120.0
"""s of CPU that SNOPT is given for a task."""
INSTALL = "Drake is not installed: pip install aloft[peers]"


def solver_rows(tasks: dict[str, dict[str, Any]], rounds: int = 3) -> list[Row]:
    """Rows of IPOPT and SNOPT for those tasks; ``ratio`` is fatrop's time by the other's."""
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


def _problem(name: str, values: dict[str, Any]) -> Problem:
    return make_problem(make_task({"name": name, **values}), find_robot("bruce"))


def _repeated(problem: Problem, guess: Any, solver: str, rounds: int, warm: bool = False
              ) -> Solution:  # fmt: skip
    solve(problem, guess, solver=solver, warm=warm)  # makes the solver
    found = [solve(problem, guess, solver=solver, warm=warm) for _ in range(rounds)]
    return sorted(found, key=lambda solution: solution.cpu)[rounds // 2]


def _snopt_rows(
    name: str, values: dict[str, Any], problem: Problem, cold: Any, fatrop: Solution
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
    """A row; where SNOPT finds nothing there is no solution to compare with, so no goal is met."""
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
