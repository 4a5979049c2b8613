"""What plans of the paper's problem ask of the motors, by step, weights, bounds and contact sequence.

The problem has no motors. Its joints may change their speed by any amount from one knot to the next, so a torque
follows from the step: the row of an interval is inverse dynamics in its middle.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....planner.solving.solve import solve_jump
from ....planner.task.files import PlanError
from ....planner.task.phase import Phase
from ....planner.task.plan import PlannedJump
from ....planner.task.task import make_task
from ....robots.description import find_robot
from ..rows import Row

COARSE = {"squat": 14, "thrust": 9, "flight": 11, "landing": 17}
"""Steps of 27 to 29 ms."""
WEIGHTS = {"force": 0.01, "orientation": 5.0}
LEAN = {"squat_lean": 0.8, "landing_lean": 0.1, "joints": 0.05}
ON_TOES = [
    {"phase": "squat", "time": 0.4, "knots": 14},
    {"phase": "thrust", "time": 0.21, "knots": 7},
    {"phase": "thrust", "time": 0.04, "knots": 2, "contacts": "toe"},
    {"phase": "flight", "knots": 11},
    {"phase": "landing", "time": 0.5, "knots": 17},
]
SPEEDS = {**WEIGHTS, "joint_velocity": 1.0}
BOUNDED = {"margins": LEAN, "touchdown_lean": 0.03}
VARIANTS: dict[str, dict[str, Any]] = {
    "as it was": {"weights": WEIGHTS},
    "steps of half the length": {
        "weights": WEIGHTS,
        "knots": {"squat": 16, "thrust": 32, "flight": 56, "landing": 28},
    },
    "steps of 28 ms": {"weights": WEIGHTS, "knots": COARSE},
    "ten times the weight of speeds": {"weights": SPEEDS},
    "bounds on the lean": {"weights": WEIGHTS, "margins": LEAN},
    "28 ms, weight and bounds": {"weights": SPEEDS, "knots": COARSE, **BOUNDED},
    "the same, on its toes at the end of the thrust": {
        "weights": SPEEDS,
        "phases": ON_TOES,
        **BOUNDED,
    },
    "the same, 10 cm ahead": {
        "weights": SPEEDS,
        "phases": ON_TOES,
        **BOUNDED,
        "distance_x": 0.1,
    },
    "10 cm ahead, five times the weight of speeds": {
        "weights": {**WEIGHTS, "joint_velocity": 5.0},
        "phases": ON_TOES,
        **BOUNDED,
        "distance_x": 0.1,
    },
    "a somersault in place, 20 cm up": {
        "weights": SPEEDS,
        "rise": 0.2,
        "rotation": 2.0 * math.pi,
    },
    "a somersault in place, 25 cm up, on its toes, five times the weight of speeds": {
        "weights": {**WEIGHTS, "joint_velocity": 5.0},
        "phases": ON_TOES,
        "rise": 0.25,
        "rotation": 2.0 * math.pi,
    },
}
"""A jump of 12 cm in place, unless the name says another; every one changes what its name says."""
PARTS = ("squat and thrust", "flight", "landing")


def paper_plans(rise: float = 0.12) -> list[Row]:
    """Plan every variant and return a row each: the largest torque by part of the jump [N m]."""
    robot = find_robot("bruce")
    rows = []
    for name, values in VARIANTS.items():
        task = {"name": "jump", "recipe": "paper", "formulation": "paper", "rise": rise, **values}
        try:
            plan = solve_jump(make_task(task), robot)
        except PlanError as error:
            rows.append(Row(name, None, "N m", note=str(error)))
            continue
        rows.append(Row(name, max(peaks(plan)), "N m", note=note_of(plan)))
    return rows


def peaks(plan: PlannedJump) -> tuple[float, float, float]:
    """Return the largest joint torque [N m] before lift-off, in flight and after touchdown."""
    torque = np.abs(plan.joint_torque[:-1]).max(axis=1)  # the last one repeats the one before
    phase = plan.phase[:-1]
    flying, landed = phase == Phase.FLIGHT, phase == Phase.LANDING
    before, flight, after = (float(torque[k].max()) for k in (~flying & ~landed, flying, landed))
    return before, flight, after


def note_of(plan: PlannedJump) -> str:
    """Say the torques by part, when the largest one is asked for, and the fastest joint at lift-off."""
    shown = ", ".join(f"{part} {peak:.1f}" for part, peak in zip(PARTS, peaks(plan), strict=True))
    worst = int(np.abs(plan.joint_torque[:-1]).max(axis=1).argmax())
    up = int(np.abs(plan.time - plan.lift_off_time).argmin())
    fastest = float(np.abs(plan.velocity[up, 6:]).max())
    return (
        f"{shown}; largest {plan.time[worst] - plan.lift_off_time:+.3f} s from lift-off; fastest joint at "
        f"lift-off {fastest:.1f} rad/s; {plan.statistics['iterations']} iterations"
    )
