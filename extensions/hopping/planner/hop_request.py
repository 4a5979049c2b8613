"""Request for the next jump, and the planner's task for it."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from ....planner.task.sequence import PhaseSpec
from ....planner.task.task import JumpTask, Knots, make_task

KNOTS = Knots(squat=8, thrust=10, flight=12, landing=10)
STEP_KNOTS = Knots(squat=9, thrust=10, flight=12, landing=10)
"""Knots of jumps up or down. With fewer the toes dip by more than 1 mm between two knots of a deep squat."""
RISE_SHARE = 0.5
"""Added height of a jump for each metre that it lands higher: with a half, flights take equally long."""
TOE_KNOTS = 4
"""Intervals of the part of the thrust on the toes, which is 40 ms long."""
LEVEL = 0.005
"""Difference of height [m] that landing tolerates without planning for it."""


class HopRequest(NamedTuple):
    """Wanted landing of the middle of the feet, relative to where it is: ``ahead`` and ``aside``, to the left, [m] in
    the axes of the feet, ``turn`` to the left [rad], and the ground there is ``up`` higher [m].
    """

    ahead: float
    aside: float
    turn: float
    up: float = 0.0

    @property
    def level(self) -> bool:
        """True if it is planned as a jump on level ground."""
        return abs(self.up) < LEVEL


class HopReach(NamedTuple):
    """The largest distance ahead, back and aside [m] and turn [rad] of a robot's jumps on level ground, and the
    apex of the centre of mass above standing [m] that all of them have."""

    ahead: float
    back: float
    aside: float
    turn: float
    rise: float

    def nearest(self, wanted: HopRequest) -> HopRequest:
        """Return the nearest request that a jump can do: in half an ellipse ahead and half of one back, and within the
        largest turn.
        """
        shorter = max(self._share(wanted), 1.0)
        turn = _clip(wanted.turn, -self.turn, self.turn)
        up = wanted.up if wanted.level else 0.0
        return HopRequest(wanted.ahead / shorter, wanted.aside / shorter, turn, up)

    def share(self, wanted: HopRequest) -> float:
        """Return the factor on all limits for which the request is at their edge."""
        return max(self._share(wanted), abs(wanted.turn) / self.turn)

    def _share(self, wanted: HopRequest) -> float:
        along = self.ahead if wanted.ahead >= 0.0 else self.back
        return math.hypot(wanted.ahead / along, wanted.aside / self.aside)

    def shortened(self, share: float) -> HopReach:
        """Return a reach with that share of all limits; the jumps are as high."""
        ahead, back, aside, turn = (_rounded(share * limit) for limit in self[:4])
        return HopReach(ahead, back, aside, turn, self.rise)


class StepReach(NamedTuple):
    """The same of jumps up and down, which all go ahead: nearer than ``least`` the edge would lie under the feet."""

    least: float
    ahead: float
    aside: float
    turn: float
    up: float
    down: float
    rise: float

    def nearest(self, wanted: HopRequest) -> HopRequest:
        """Return the nearest request in the box of these limits."""
        return HopRequest(
            _clip(wanted.ahead, self.least, self.ahead), _clip(wanted.aside, -self.aside, self.aside),
            _clip(wanted.turn, -self.turn, self.turn), _clip(wanted.up, -self.down, self.up),
        )  # fmt: skip


def _clip(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)


def _rounded(value: float) -> float:
    return round(value, 3)


@lru_cache(maxsize=4)
def task_of(wanted: HopRequest, robot: str, rise: float) -> JumpTask:
    """Return the task of the requested jump of a robot, whose apex is ``rise`` [m] above standing on level ground.

    Raises:
        JumpTaskError: there is no such jump.
    """
    up = 0.0 if wanted.level else wanted.up
    return make_task(
        {
            "name": "hop",
            "robot": robot,
            "rise": rise + RISE_SHARE * up,
            "distance_x": wanted.ahead,
            "distance_y": wanted.aside,
            "twist": wanted.turn,
            "landing_height": up,
        }
    )


def coarse(task: JumpTask) -> JumpTask:
    """Return a task whose parameters are all chosen, on the few intervals of plans that are made in the loop."""

    def on_fewer(phase_spec: PhaseSpec) -> PhaseSpec:
        return (
            phase_spec
            if phase_spec.knots is None
            else phase_spec.model_copy(update={"knots": TOE_KNOTS})
        )

    phases = task.phases and tuple(on_fewer(phase_spec) for phase_spec in task.phases)
    knots = STEP_KNOTS if task.landing_height else KNOTS
    return task.model_copy(update={"knots": knots, "phases": phases})
