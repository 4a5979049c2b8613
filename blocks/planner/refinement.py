"""Finer intervals for a plan that failed the validity check because its own are too long.

The planner's equations are of second order: errors of the flight, of limits between knots and of
torques at an interval's ends fall to a fourth where intervals are halved. What a finer grid cannot
cure (a body in the way of a step, a task that is missed) is not tried again.
"""

from __future__ import annotations

import math

from .plan import JumpPlan
from .task import JumpTask, Knots

FACTOR = 1.5
"""How many times as many intervals a plan is solved on again."""
ROUNDS = 2
"""How often at most."""
CURABLE = frozenset(
    {
        "position_defect", "rotation_defect", "velocity_defect", "angular_velocity_defect",
        "flight_position", "flight_rotation", "rise", "joint_torque", "joint_limits",
        "motor_torque", "motor_speed", "effort", "touchdown_speed", "foot_slip", "foot_on_ground",
        "foot_below_ground", "foot_clearance", "body_on_ground", "leg_clearance",
    }
)  # fmt: skip
"""Tests whose figures depend on the length of the intervals."""
NEAR = 8.0
"""A figure further than this many times its limit is no error of the grid."""


def curable(plan: JumpPlan) -> bool:
    """Whether a plan with its report failed by what finer intervals may cure."""
    failed = [test for test in plan.report.get("tests", []) if not test["passed"]]
    return bool(failed) and all(
        test["name"] in CURABLE and test["value"] <= NEAR * max(test["limit"], 1e-3)
        for test in failed
    )


def next_refinement(plan: JumpPlan) -> float:
    """How many times as many intervals as its task says a plan is solved on again."""
    return FACTOR * float(plan.statistics.get("refinement", 1.0))


def refined(task: JumpTask, factor: float) -> JumpTask:
    """The task on so many times as many intervals in every phase."""

    def more(count: int) -> int:
        return math.ceil(factor * count)

    knots = {name: more(getattr(task.knots, name)) for name in type(task.knots).model_fields}
    spans = task.phases and tuple(
        span if span.knots is None else span.model_copy(update={"knots": more(span.knots)})
        for span in task.phases
    )
    return task.model_copy(update={"knots": Knots.model_validate(knots), "phases": spans})


def asks_for_finer(task: JumpTask, plan: JumpPlan | None) -> bool:
    """Whether a plan to start from is a failed one of that very task."""
    return (
        plan is not None
        and bool(plan.report)
        and not plan.valid
        and plan.task.content() == task.content()
    )
