"""Solves a problem with fatrop, which exploits the order of its variables in time, or with IPOPT where fatrop fails."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ..problem.assembly import Assembly, NonlinearProgram
from ..problem.program_functions import program_functions
from .solver_process import call_bounded, call_solver, cpu_time, without_output

VIOLATION = 1e-6
"""Tolerance of a solution for each constraint, in the constraint's unit."""
DUAL_TOLERANCE = 1e-4
"""fatrop's dual infeasibility does not fall much further; the cost is then stable to 7 digits."""
LIMIT = 150
"""Iterations; where fatrop finds a motion at all it nearly always does in half as many, and IPOPT
finds it often where it does not."""
TIME_PER_ENTRY = 1e-5
"""s of processor time for each iteration, state and constraint of the problem, about three times what one takes:
a solver that restores feasibility without counting, or looks for a step for ever, is given up."""
FAR, NEAR = 10.0, 1e-4
"""The barrier's parameter to begin with, far from a solution and near one."""
PUSH = 1e-6
"""Distance by which a start near a solution is moved away from bounds."""
KEPT = 12
"""Solvers kept for problems of the same structure."""


@dataclass(frozen=True)
class Solution:
    """Values of the variables and what it took. ``violation`` is the largest of all constraints'
    and bounds', ``family`` whose it is."""

    values: Array
    solver: str
    iterations: int
    cost: float
    violation: float
    family: str
    solved: bool
    cpu: float


def solve(
    problem: NonlinearProgram,
    guess: Array,
    *,
    warm: bool = False,
    barrier: float = NEAR,
    solver: str = "",
    limit: int = LIMIT,
    last: int = LIMIT,
    other_guess: Callable[[], Array | None] = lambda: None,
) -> Solution:
    """Return the first solution found, or the least violated attempt: fatrop from the other guess, which is nearer,
    fatrop from the guess, IPOPT from the guess.

    ``warm`` says that the guess is near the solution, and ``barrier`` is the parameter of the logarithmic
    barrier to begin with near it; ``solver`` insists on one of them. ``limit`` is how many iterations each attempt
    may take, and ``last`` how many IPOPT may take where it is not insisted on.
    """
    tries = [solver] if solver else ["other", "fatrop", "ipopt"]
    best: Solution | None = None
    nearer: Array | None = None
    for name in tries:
        other = name == "other"
        nearer = other_guess() if other else nearer
        start = nearer if other else guess
        if start is None or (name == "fatrop" and nearer is not None):
            continue  # what fatrop does not find from near it does not find from afar
        begin = barrier if warm or other else FAR
        most = min(limit, last) if name == "ipopt" and not solver else limit
        found = _run(problem, start, "fatrop" if other else name, begin, most)
        if best is None or found.solved or found.violation < best.violation:
            best = found
        if best.solved:
            break
    assert best is not None
    return best


def _run(
    problem: NonlinearProgram, guess: Array, name: str, barrier: float, limit: int
) -> Solution:
    started = cpu_time()
    solver = _solver(problem.assembly, name, barrier, limit)
    arguments = {
        "x0": guess, "p": problem.parameters, "lbx": problem.lower, "ubx": problem.upper,
        "lbg": problem.row_lower, "ubg": problem.row_upper,
    }  # fmt: skip
    # In a copy of a process: a fatrop that has failed once would fail at easy problems later.
    if name == "fatrop":
        ended, answer = call_bounded(solver, arguments, time_limit(problem.assembly, limit))
        if not ended or answer is None:
            spent = cpu_time() - started
            return Solution(guess, name, 0, np.inf, np.inf, "dynamics", False, spent)
        values, stats = answer
    else:
        values, stats = call_solver(solver, arguments)
    cost = float(solver.cost(values, problem.parameters)) if np.isfinite(values).all() else np.inf
    violation, family = violation_of(problem, values, solver.constraints)
    status = str(stats.get("unified_return_status", ""))
    solved = bool(stats["success"]) or status == "SOLVER_RET_SUCCESS"
    solved = solved and violation <= 2.0 * VIOLATION
    return Solution(
        values, name, int(stats["iter_count"]), cost, violation, family, solved,
        cpu_time() - started,
    )  # fmt: skip


def time_limit(assembly: Assembly, limit: int) -> int:
    """Return the time that fatrop may take for so many iterations [s of processor time]; IPOPT, twice as long."""
    return max(2, math.ceil(TIME_PER_ENTRY * limit * (sum(assembly.nx) + assembly.constraints)))


def violation_of(problem: NonlinearProgram, values: Array, constraint: Any) -> tuple[float, str]:
    """Return the largest violation of a constraint or bound, and the family it belongs to."""
    if not np.isfinite(values).all():
        return np.inf, "dynamics"
    rows = np.array(constraint(values, problem.parameters)).ravel()
    over = np.maximum(problem.row_lower - rows, rows - problem.row_upper)
    outside = np.maximum(problem.lower - values, values - problem.upper)
    worst = int(over.argmax())
    if outside.max(initial=0.0) > over[worst]:
        return float(outside.max()), "joint limits"
    return max(float(over[worst]), 0.0), problem.families[worst]


class Solver:
    """A solver of CasADi for problems of one structure. Pickled, it is made anew where it arrives: CasADi cannot write
    down functions that call Python.

    Attributes:
        cost, constraints: the functions of variables and parameters.
    """

    def __init__(self, assembly: Assembly, name: str, barrier: float, limit: int) -> None:
        self._made_of = (assembly, name, barrier, limit)
        self._functions = program_functions(assembly, upper=name != "fatrop")
        self.cost, self.constraints = self._functions["nlp_f"], self._functions["nlp_g"]

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what it is made of."""
        return Solver, self._made_of

    @cached_property
    def _function(self) -> Any:
        """CasADi's solver, which takes a second to make: only where it is called."""
        assembly, name, barrier, limit = self._made_of
        return _make_solver(assembly, self._functions, name, barrier, limit)

    def prepare(self) -> None:
        """Make CasADi's solver if that has not been done."""
        _ = self._function

    def __call__(self, **arguments: Array) -> Any:
        """Solve, with the arguments of CasADi's solvers."""
        return self._function(**arguments)

    def stats(self) -> Any:
        """Return CasADi's report of the last call."""
        return self._function.stats()


_solvers: OrderedDict[object, Solver] = OrderedDict()


def _solver(assembly: Assembly, name: str, barrier: float, limit: int) -> Solver:
    """Return a solver for problems of this structure."""
    key = (assembly.signature, name, barrier, limit)
    if key in _solvers:
        _solvers.move_to_end(key)
        return _solvers[key]
    made = Solver(assembly, name, barrier, limit)
    _solvers[key] = made
    if len(_solvers) > KEPT:
        _solvers.popitem(last=False)
    return made


def _make_solver(
    assembly: Assembly, functions: dict[str, Any], name: str, barrier: float, limit: int
) -> Any:
    import casadi as ca

    nlp = {key: functions[key] for key in ("x", "p", "f", "g")}
    own: dict[str, Any] = {"tol": DUAL_TOLERANCE, "constr_viol_tol": VIOLATION,
                              "max_iter": limit, "print_level": 0}  # fmt: skip
    options: dict[str, Any] = {"print_time": False, "calc_lam_p": False, "error_on_fail": False}
    if name == "fatrop":
        # Its own tolerance takes the short intervals' small coefficients for a lack of rank.
        own |= {"linsol_lu_fact_tol": 1e-7, "mu_init": barrier}
        if barrier < FAR:
            own |= {"bound_push": PUSH, "bound_frac": PUSH}
        given = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l", "nlp_grad")
        options |= {
            "structure_detection": "manual", "nx": assembly.nx, "nu": assembly.nu,
            "ng": assembly.ng, "N": len(assembly.nx) - 1,
            "cache": {key: functions[key] for key in given}, "fatrop": own,
        }  # fmt: skip
    else:
        own |= {"sb": "yes", "mu_init": barrier}
        own["max_cpu_time"] = 2.0 * time_limit(assembly, limit)
        if barrier < FAR:
            own |= {"bound_push": PUSH, "bound_frac": PUSH,
                    "slack_bound_push": PUSH, "slack_bound_frac": PUSH}  # fmt: skip
        options |= {
            "hess_lag": functions["hess_lag"], "jac_g": functions["nlp_jac_g"],
            "grad_f": functions["grad_f"], "no_nlp_grad": True, "ipopt": own,
        }  # fmt: skip
    with without_output():
        return ca.nlpsol("jump", name, nlp, options)
