"""What the next jump should do, and the task of the planner that says so."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from ..task.sequence import PhaseSpec
from ..task.task import JumpTask, Knots, make_task

RISE = 0.09
"""Apex of the centre of mass above standing [m]."""
KNOTS = Knots(squat=8, thrust=10, flight=12, landing=10)
STEP_KNOTS = Knots(squat=9, thrust=10, flight=12, landing=10)
"""Those of jumps up or down. With fewer the toes dip by more than 1 mm between two knots of a deep squat."""
RISE_SHARE = 0.5
"""How much higher a jump goes for each metre that it lands higher: with a half, flights take equally long."""
TOE_KNOTS = 4
"""Intervals of the part of the thrust on the toes, which is 40 ms long."""
REACH = {"ahead": 0.32, "back": 0.10, "aside": 0.30, "turn": 0.87}
"""The largest distance ahead, back and aside [m] and turn [rad]. Jumps further back with a turn are planned, but
in the robust trial they land askew."""
STEP_REACH = {"least": 0.12, "ahead": 0.32, "aside": 0.10, "turn": 0.35, "up": 0.06}
"""The same for jumps up or down: nearer than ``least`` the edge would lie under the feet."""
LEVEL = 0.005
"""A difference of height [m] that landing takes without being told of it."""


class HopRequest(NamedTuple):
    """Where the middle of the feet should land, relative to where it is: ``ahead`` and ``aside``, to the
    left, [m] in the axes of the feet, ``turn`` to the left [rad], and the ground there is ``up`` higher [m]."""

    ahead: float
    aside: float
    turn: float
    up: float = 0.0

    @property
    def level(self) -> bool:
        """Whether it is planned as a jump on level ground."""
        return abs(self.up) < LEVEL


def within_reach(wanted: HopRequest) -> HopRequest:
    """The nearest request that a jump can do: in half an ellipse ahead and half of one
    back, and within the largest turn; up or down in a box ahead."""
    if not wanted.level:
        r = STEP_REACH
        return HopRequest(
            _clip(wanted.ahead, r["least"], r["ahead"]), _clip(wanted.aside, -r["aside"], r["aside"]),
            _clip(wanted.turn, -r["turn"], r["turn"]), _clip(wanted.up, -r["up"], r["up"]),
        )  # fmt: skip
    along = REACH["ahead"] if wanted.ahead >= 0.0 else REACH["back"]
    share = math.hypot(wanted.ahead / along, wanted.aside / REACH["aside"])
    shorter = max(share, 1.0)
    turn = _clip(wanted.turn, -REACH["turn"], REACH["turn"])
    return HopRequest(wanted.ahead / shorter, wanted.aside / shorter, turn, wanted.up)


def _clip(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)


@lru_cache(maxsize=4)
def task_of(wanted: HopRequest, robot: str = "bruce") -> JumpTask:
    """The task of the requested jump.

    Raises:
        JumpTaskError: there is no such jump.
    """
    up = 0.0 if wanted.level else wanted.up
    return make_task(
        {
            "name": "hop",
            "robot": robot,
            "rise": RISE + RISE_SHARE * up,
            "distance_x": wanted.ahead,
            "distance_y": wanted.aside,
            "twist": wanted.turn,
            "landing_height": up,
        }
    )


def coarse(task: JumpTask) -> JumpTask:
    """A task whose parameters are all chosen, on the few intervals of plans that are made in the loop."""

    def on_fewer(span: PhaseSpec) -> PhaseSpec:
        return span if span.knots is None else span.model_copy(update={"knots": TOE_KNOTS})

    phases = task.phases and tuple(on_fewer(span) for span in task.phases)
    knots = STEP_KNOTS if task.landing_height else KNOTS
    return task.model_copy(update={"knots": knots, "phases": phases})
