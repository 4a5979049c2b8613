"""Describes the outcome of a solve: the reason why there is no plan, or the statistics of the solution."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..problem.program import Program
from ..task.errors import PlanError
from ..task.task import JumpTask
from .solver import Solution

ADVICE = {
    "motor torque": "ask for a smaller jump, a longer thrust_time or a stronger profile",
    "motor torque at speed": "ask for a smaller jump, a longer thrust_time or a faster profile",
    "motor speed": "ask for a smaller jump, a longer flight or a faster profile",
    "held joints": "ask for a smaller jump or a longer thrust_time, or let these joints move",
    "friction": "ask for a shorter distance or more friction",
    "ground clearance": "ask for a greater rise or less foot_clearance",
    "leg clearance": "ask for less twist or less leg_clearance",
    "joint limits": "ask for a smaller jump",
    "footholds": "ask for a place within reach: a smaller distance, or a greater rise",
    "apex": "ask for a smaller rise or a longer thrust_time",
    "angular momentum": "allow more lift_off_momentum or touchdown_momentum",
    "flight time": "leave flight_time to the planner",
    "impact": "use impact: false, or ask for a smaller jump",
}


def statistics_of(problem: Program, solution: Solution) -> dict[str, Any]:
    """How a problem on a fixed grid was solved, for the plan; the whole time comes to it later."""
    return {
        "solver": solution.solver,
        "iterations": solution.iterations,
        "solver_cpu_s": solution.cpu,
        "violation": solution.violation,
        "cost": solution.cost,
        "warm": False,
        "knots": problem.knots,
        "variables": problem.assembly.variables,
        "constraints": problem.assembly.constraints,
        "compiled": not problem.assembly.interpreted,
    }


def failure(task: JumpTask, solution: Solution) -> PlanError:
    """The error of a task without a solution, with what to do about it."""
    family = solution.family
    advice = ADVICE.get(family, "ask for a smaller jump, or change the durations")
    reason = (
        f"{family} is missed by {solution.violation:.3g}"
        if solution.violation > 1e-5
        else "the solver found no optimum"
    )
    return PlanError(
        f"no plan for {task.name!r} after {solution.iterations} iterations: {reason}; {advice}",
        family=family, violation=solution.violation,
    )  # fmt: skip


def versions() -> dict[str, str]:
    """Of the packages that decide what a plan is."""
    import casadi as ca

    return {"casadi": str(ca.CasadiMeta.version()), "numpy": np.__version__}
