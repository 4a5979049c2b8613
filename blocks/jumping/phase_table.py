"""The phases of a jump as a table of transitions: a phase, a condition, and the next phase."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array1D
from ...mathematics.kernel import kernel
from ..signals import Phase


class Condition(IntEnum):
    """A condition of a tick that may lead to another phase."""

    PLAN_SQUATS = 0
    """The plan is in its squat or beyond."""
    PLAN_THRUSTS = 1
    """The plan is in its thrust or beyond."""
    LIFT_OFF_DUE = 2
    """The planned lift-off is over, and all points have left the ground or waited long enough."""
    LEFT_EARLY = 3
    """In the second half of the thrust no point has had contact for a while."""
    TOUCHED_DOWN = 4
    """A point has contact after the least share of the predicted flight."""
    OVERDUE = 5
    """The flight lasts much longer than planned."""
    RESTED = 6
    """The landing has lasted long enough, and no other flight is planned."""
    THRUSTS_AGAIN = 7
    """Another flight is planned, and the plan is in its thrust."""
    LOST_CONTACT = 8
    """No point has had contact for too long."""


class Transition(NamedTuple):
    """From ``phase`` to ``to`` when the condition ``when`` holds."""

    phase: Phase
    when: Condition
    to: Phase


TRANSITIONS = (
    Transition(Phase.STAND, Condition.LOST_CONTACT, Phase.FAULT),
    Transition(Phase.STAND, Condition.LIFT_OFF_DUE, Phase.FLIGHT),
    Transition(Phase.STAND, Condition.PLAN_THRUSTS, Phase.THRUST),
    Transition(Phase.STAND, Condition.PLAN_SQUATS, Phase.SQUAT),
    Transition(Phase.SQUAT, Condition.LOST_CONTACT, Phase.FAULT),
    Transition(Phase.SQUAT, Condition.LIFT_OFF_DUE, Phase.FLIGHT),
    Transition(Phase.SQUAT, Condition.PLAN_THRUSTS, Phase.THRUST),
    Transition(Phase.THRUST, Condition.LOST_CONTACT, Phase.FAULT),
    Transition(Phase.THRUST, Condition.LIFT_OFF_DUE, Phase.FLIGHT),
    Transition(Phase.THRUST, Condition.LEFT_EARLY, Phase.FLIGHT),
    Transition(Phase.FLIGHT, Condition.TOUCHED_DOWN, Phase.LANDING),
    Transition(Phase.FLIGHT, Condition.OVERDUE, Phase.FAULT),
    Transition(Phase.LANDING, Condition.LOST_CONTACT, Phase.FAULT),
    Transition(Phase.LANDING, Condition.THRUSTS_AGAIN, Phase.THRUST),
    Transition(Phase.LANDING, Condition.RESTED, Phase.RECOVER),
    Transition(Phase.RECOVER, Condition.LOST_CONTACT, Phase.FAULT),
)
"""All transitions. In each phase the first transition whose condition holds is taken; a phase
without transitions, such as FAULT, lasts to the end of the run."""

TABLE = np.array([[int(value) for value in row] for row in TRANSITIONS])
"""The transitions as an array (n, 3), for the kernel."""

NOW, IN_PHASE, LIFT_OFF, TOUCHDOWN, REMAINING, UNLOADED, AHEAD = range(7)
"""Elements of ``times`` [s]: the plan's time; how long the phase has lasted; the planned lift-off
and touchdown of the next flight, the one under way or the last; the predicted time to touchdown;
how long no point has had contact; and by how much the controller works ahead of time."""

LATE_LIFT_OFF, EARLY_LIFT_OFF, TOUCHDOWN_SHARE, LANDING_TIME, LOST_CONTACT, EARLY_LANDING = range(6)
"""Elements of ``limits``: the parameters of ``JumpPhase`` of these names."""

LEAST_AHEAD = 0.0015
"""A controller that works less ahead of time [s] waits for contact: the prediction is no better."""


@kernel
def find_conditions(
    times: Array1D, limits: Array1D, planned: int, another: bool, holds: NDArray[np.bool_]
) -> None:
    """Which conditions hold in this tick.

    Args:
        times, limits: see ``NOW`` and ``LATE_LIFT_OFF``.
        planned: the phase that the plan is in.
        another: whether the plan has a flight after the one that ``times`` is about.
        holds: becomes true for each ``Condition`` that holds.
    """
    now, in_phase = times[NOW], times[IN_PHASE]
    lift_off, unloaded = times[LIFT_OFF], times[UNLOADED]
    flight = times[TOUCHDOWN] - lift_off
    due = now >= lift_off
    waiting = unloaded == 0.0 and now < lift_off + limits[LATE_LIFT_OFF]
    share = limits[TOUCHDOWN_SHARE] * (in_phase + times[REMAINING])
    # `.value`: before its version 0.68 Numba takes no member of an enumeration as an index.
    holds[Condition.PLAN_SQUATS.value] = planned >= Phase.SQUAT
    holds[Condition.PLAN_THRUSTS.value] = planned >= Phase.THRUST or due
    holds[Condition.LIFT_OFF_DUE.value] = due and not waiting
    holds[Condition.LEFT_EARLY.value] = (
        now + in_phase >= lift_off and not due and unloaded >= limits[EARLY_LIFT_OFF]
    )
    ahead = times[AHEAD]
    early = ahead > LEAST_AHEAD and times[REMAINING] < ahead * limits[EARLY_LANDING]
    holds[Condition.TOUCHED_DOWN.value] = (unloaded == 0.0 or early) and in_phase >= share
    holds[Condition.OVERDUE.value] = in_phase > flight + limits[LOST_CONTACT]
    holds[Condition.RESTED.value] = not another and in_phase >= limits[LANDING_TIME]
    holds[Condition.THRUSTS_AGAIN.value] = another and planned == Phase.THRUST
    holds[Condition.LOST_CONTACT.value] = unloaded > limits[LOST_CONTACT]


@kernel
def next_phase(table: NDArray[np.int64], phase: int, holds: NDArray[np.bool_]) -> int:
    """The phase that follows by the first row (phase, condition, to) of the table that applies."""
    for row in range(table.shape[0]):
        if int(table[row, 0]) == phase and holds[int(table[row, 1])]:
            return int(table[row, 2])
    return phase
