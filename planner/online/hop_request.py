"""What the next jump should do, and the task of the planner that says so."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..task.sequence import PhaseSpec
from ..task.task import JumpTask, Knots, make_task

RISE = 0.09
"""Apex of the centre of mass above standing [m]."""
KNOTS = Knots(squat=8, thrust=10, flight=12, landing=10)
TOE_KNOTS = 4
"""Intervals of the part of the thrust on the toes, which is 40 ms long."""
REACH = {"ahead": 0.32, "back": 0.10, "aside": 0.30, "turn": 0.87}
"""The largest distance ahead, back and aside [m] and turn [rad]. Jumps further back with a turn are planned, but
in the robust trial they land askew."""


class HopRequest(NamedTuple):
    """Where the middle of the feet should land, relative to where it is: ``ahead`` and ``aside``, to the
    left, [m] in the axes of the feet, and ``turn`` to the left [rad]. The ground is level."""

    ahead: float
    aside: float
    turn: float


def within_reach(wanted: HopRequest) -> HopRequest:
    """The nearest request that a jump can do: in half an ellipse ahead and half of one
    back, and within the largest turn."""
    along = REACH["ahead"] if wanted.ahead >= 0.0 else REACH["back"]
    share = math.hypot(wanted.ahead / along, wanted.aside / REACH["aside"])
    shorter = max(share, 1.0)
    turn = min(max(wanted.turn, -REACH["turn"]), REACH["turn"])
    return HopRequest(wanted.ahead / shorter, wanted.aside / shorter, turn)


def task_of(wanted: HopRequest, robot: str = "bruce") -> JumpTask:
    """The task of that jump.

    Raises:
        JumpTaskError: there is no such jump.
    """
    return make_task(
        {
            "name": "hop",
            "robot": robot,
            "rise": RISE,
            "distance_x": wanted.ahead,
            "distance_y": wanted.aside,
            "twist": wanted.turn,
        }
    )


def coarse(task: JumpTask) -> JumpTask:
    """A task whose parameters are all chosen, on the few intervals of plans that are made in the loop."""

    def on_fewer(span: PhaseSpec) -> PhaseSpec:
        return span if span.knots is None else span.model_copy(update={"knots": TOE_KNOTS})

    phases = task.phases and tuple(on_fewer(span) for span in task.phases)
    return task.model_copy(update={"knots": KNOTS, "phases": phases})
