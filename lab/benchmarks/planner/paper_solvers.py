"""The paper's planning problem by the paper's solver, SNOPT, and by others, beside IPOPT, which plans it here.

Each solver begins at the guess, and at the plan of a jump that is 5 mm lower. OSQP solves quadratic programs only, so
CasADi's sequential quadratic programming calls it; the paper has it for the whole-body controller.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from ....files.pip_line import pip_line
from ....mathematics.arrays import Array
from ....planner.problem.program import SimpleProblem
from ....planner.problem.program_functions import program_functions
from ....planner.solving.paper_plan import LIMIT, paper_problem
from ....planner.solving.solver import DUAL_TOLERANCE, VIOLATION, Solution, solve, violation_of
from ....planner.solving.solver_process import cpu_time, without_output
from ....planner.task.task import make_task
from ....robots.description import find_robot
from ..rows import Row
from .snopt import SnoptProgram

TASK: dict[str, Any] = {
    "recipe": "paper",
    "formulation": "paper",
    "rise": 0.10,
    "knots": {"squat": 4, "thrust": 8, "flight": 14, "landing": 7},
}
LOWER = 0.005
"""By how much lower the near jump is [m]."""
IPOPT = "IPOPT"
STARTS = ("from the guess", "from a near plan")
STEPS = 30
"""Iterations of the sequential quadratic programming."""
QP_OPTIONS: dict[str, dict[str, Any]] = {
    "osqp": {"osqp": {"verbose": False, "eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 4000}},
    "qrqp": {"print_iter": False, "print_header": False},
}


def paper_solvers(seconds: float = 60.0) -> list[Row]:
    """Measure and return the rows, two a solver; ``ratio`` is its processor time by IPOPT's from the same start.

    Args:
        seconds: the processor time that SNOPT is given for a start.
    """
    robot = find_robot("bruce")
    near, problem = (
        paper_problem(make_task({**TASK, "name": "jump", "rise": TASK["rise"] - off}), robot)
        for off in (LOWER, 0.0)
    )
    lower = solve(near, near.guess, solver="ipopt", limit=LIMIT)
    rows = []
    for start, guess in zip(STARTS, (problem.guess, lower.values), strict=True):
        warm = start == STARTS[1]
        own, fatrop = (_fastest(problem, guess, name, warm) for name in ("ipopt", "fatrop"))
        rows.append(_row(IPOPT, start, own, None))
        rows.append(_row("fatrop", start, fatrop, own))
        rows.append(_sqp_row(problem, guess, start, own))
        rows.append(_snopt_row(problem, guess, start, own, seconds))
    return rows


def _fastest(problem: SimpleProblem, guess: Array, name: str, warm: bool) -> Solution:
    """Return the faster of two solves; the first one also makes the solver."""
    found = [
        solve(problem, guess, solver=name, warm=warm, barrier=1e-3, limit=LIMIT) for _ in range(2)
    ]
    return min(found, key=lambda solution: solution.cpu)


def _row(name: str, start: str, found: Solution, own: Solution | None) -> Row:
    told = f"{found.iterations} iterations, cost {found.cost:.5g}, violation {found.violation:.1e}"
    if not found.solved:
        told += "; no solution, so this is the time it took to give up"
    ratio = None if own is None else found.cpu / own.cpu
    peer = "" if own is None else IPOPT
    return Row(f"paper's problem {start}, {name}", found.cpu, "s", peer, ratio, note=told)


def _sqp_row(problem: SimpleProblem, guess: Array, start: str, own: Solution) -> Row:
    return _row("OSQP in CasADi's SQP", start, solve_by_sqp(problem, guess), own)


def solve_by_sqp(problem: SimpleProblem, guess: Array, solver: str = "osqp") -> Solution:
    """Solve a problem by CasADi's sequential quadratic programming, with a solver of quadratic programs that it has."""
    import casadi as ca

    functions = program_functions(problem.assembly)
    x, p = (ca.MX.sym(name, functions[name].numel()) for name in ("x", "p"))
    factor, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", problem.assembly.constraints)
    cost, slope = functions["grad_f"](x, p)
    rows, matrix = functions["nlp_jac_g"](x, p)
    whole = functions["nlp_hess_l"](x, p, factor, multipliers)[1]
    first = ca.Function(
        "nlp_jac_fg",
        [x, p],
        [cost, slope, rows, matrix],
        ["x", "p"],
        ["f", "grad_f_x", "g", "jac_g_x"],
    )
    second = ca.Function(
        "nlp_hess_l",
        [x, p, factor, multipliers],
        [whole],
        ["x", "p", "lam_f", "lam_g"],
        ["hess_gamma_x_x"],
    )
    options: dict[str, Any] = {
        "qpsol": solver, "max_iter": STEPS, "tol_pr": VIOLATION, "tol_du": DUAL_TOLERANCE, "convexify_strategy": "regularize", "jac_fg": first,
        "hess_lag": second, "no_nlp_grad": True, "calc_lam_p": False, "error_on_fail": False, "print_time": False,
        "print_header": False, "print_iteration": False, "print_status": False,
        "qpsol_options": {"error_on_fail": False, **QP_OPTIONS[solver]},
    }  # fmt: skip
    nlp = {key: functions[key] for key in ("x", "p", "f", "g")}
    with without_output():
        sqp = ca.nlpsol("jump", "sqpmethod", nlp, options)
        began = cpu_time()
        found = sqp(
            x0=guess, p=problem.parameters, lbx=problem.lower, ubx=problem.upper,
            lbg=problem.row_lower, ubg=problem.row_upper,
        )  # fmt: skip
        spent = cpu_time() - began
    values = np.array(found["x"]).ravel()
    violation, family = violation_of(problem, values, functions["nlp_g"])
    stats = sqp.stats()
    solved = bool(stats["success"]) and violation <= 2.0 * VIOLATION
    return Solution(
        values,
        solver,
        int(stats["iter_count"]),
        float(found["f"]),
        violation,
        family,
        solved,
        spent,
    )


def _snopt_row(
    problem: SimpleProblem, guess: Array, start: str, own: Solution, seconds: float
) -> Row:
    name = f"paper's problem {start}, SNOPT through Drake"
    if find_spec("pydrake") is None:
        return Row(
            name, None, "s", IPOPT, note=f"Drake is not installed; {pip_line('peers')} has it"
        )
    found = SnoptProgram(problem).solve(guess, time_limit=seconds)
    told = f"info {found.info}, cost {found.cost:.5g}, violation {found.violation:.1e}, {found.callback_cpu:.2f} s in callbacks"
    if not found.solved:
        told += "; no solution, so this is the time it took to give up"
    return Row(name, found.cpu, "s", IPOPT, found.cpu / own.cpu, note=told)
