"""Chooses finer intervals for a plan that failed the validity check because its intervals are too long.

The planner's equations on the ground are of second order: errors of limits between knots and of torques at an
interval's ends fall to a fourth where intervals are halved. A plan that failed for a reason that a finer grid
cannot remove (a body in the way of a step, a task that is missed) is not solved again.
"""

from __future__ import annotations

import math

from ...blocks.signals import Phase
from ..problem.resampling import segments
from ..task.plan import JumpPlan
from ..task.task import JumpTask, Knots

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


def finer_knots(plan: JumpPlan) -> Knots:
    """Numbers of intervals for solving a plan's task again; of several phases of a kind the one
    with the most counts."""
    count = dict.fromkeys(("squat", "thrust", "flight", "landing"), 4)
    for phase, start, stop in segments(plan.phase[:-1].tolist()):
        name = Phase(phase).name.lower()
        count[name] = max(count.get(name, 0), stop - start)
    return Knots.model_validate(
        {name: math.ceil(FACTOR * count[name]) for name in Knots.model_fields}
    )


def with_knots(task: JumpTask, knots: Knots) -> JumpTask:
    """The task on those numbers of intervals; phases that name their own change in proportion."""
    changed: dict[str, object] = {"knots": knots}
    if task.phases is not None and knots != task.knots:
        more = knots.total / task.knots.total
        changed["phases"] = tuple(
            span if span.knots is None
            else span.model_copy(update={"knots": math.ceil(more * span.knots)})
            for span in task.phases
        )  # fmt: skip
    return task.model_copy(update=changed)


def asks_for_finer(task: JumpTask, plan: JumpPlan | None) -> bool:
    """Whether a plan to start from is a failed one of that very task."""
    return (
        plan is not None
        and bool(plan.report)
        and not plan.valid
        and plan.task.content() == task.content()
    )
