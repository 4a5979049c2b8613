"""Determines which phase of the jump the robot is really in."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Literal, NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array1D,
    Flags1D,
    Indices1D,
    Indices2D,
    Rows3,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, DelayEstimate, DynamicsTerms, JumpReference, Phase, PhaseState


class PhaseCondition(IntEnum):
    """A condition of a tick that may lead to another phase."""

    PLAN_SQUATS = 0
    """The plan is in its squat or beyond."""
    PLAN_THRUSTS = 1
    """The plan is in its thrust or beyond."""
    LIFT_OFF_DUE = 2
    """The planned lift-off is over, and all points have left the ground or waited long enough."""
    LEFT_EARLY = 3
    """No point has had contact for a while, in the second half of the thrust."""
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
    STANDS = 9
    """All points have had contact for long enough."""
    SQUATS_AGAIN = 10
    """Another flight is planned, and the plan is in its squat."""


class PhaseTransition(NamedTuple):
    """Change from ``phase`` to the ``following`` one when the ``condition`` holds."""

    phase: Phase
    condition: PhaseCondition
    following: Phase


TRANSITIONS = (
    PhaseTransition(Phase.HANG, PhaseCondition.STANDS, Phase.STAND),
    PhaseTransition(Phase.STAND, PhaseCondition.LOST_CONTACT, Phase.FAULT),
    PhaseTransition(Phase.STAND, PhaseCondition.LIFT_OFF_DUE, Phase.FLIGHT),
    PhaseTransition(Phase.STAND, PhaseCondition.PLAN_THRUSTS, Phase.THRUST),
    PhaseTransition(Phase.STAND, PhaseCondition.PLAN_SQUATS, Phase.SQUAT),
    PhaseTransition(Phase.SQUAT, PhaseCondition.LOST_CONTACT, Phase.FAULT),
    PhaseTransition(Phase.SQUAT, PhaseCondition.LIFT_OFF_DUE, Phase.FLIGHT),
    PhaseTransition(Phase.SQUAT, PhaseCondition.PLAN_THRUSTS, Phase.THRUST),
    PhaseTransition(Phase.THRUST, PhaseCondition.LOST_CONTACT, Phase.FAULT),
    PhaseTransition(Phase.THRUST, PhaseCondition.LIFT_OFF_DUE, Phase.FLIGHT),
    PhaseTransition(Phase.THRUST, PhaseCondition.LEFT_EARLY, Phase.FLIGHT),
    PhaseTransition(Phase.FLIGHT, PhaseCondition.TOUCHED_DOWN, Phase.LANDING),
    PhaseTransition(Phase.FLIGHT, PhaseCondition.OVERDUE, Phase.FAULT),
    PhaseTransition(Phase.LANDING, PhaseCondition.LOST_CONTACT, Phase.FAULT),
    PhaseTransition(Phase.LANDING, PhaseCondition.THRUSTS_AGAIN, Phase.THRUST),
    PhaseTransition(Phase.LANDING, PhaseCondition.RESTED, Phase.RECOVER),
    PhaseTransition(Phase.RECOVER, PhaseCondition.LOST_CONTACT, Phase.FAULT),
    PhaseTransition(Phase.RECOVER, PhaseCondition.SQUATS_AGAIN, Phase.SQUAT),
)
"""All transitions. In each phase the first transition whose condition holds is taken; a phase
without transitions, such as FAULT, lasts to the end of the run."""

TABLE = np.array([[int(value) for value in row] for row in TRANSITIONS])
"""The transitions as an array (n, 3), for the kernel."""

NOW, IN_PHASE, LIFT_OFF, TOUCHDOWN, REMAINING, UNLOADED, AHEAD, STOOD = range(8)
"""Elements of ``times`` [s]: the plan's time; the duration of the phase so far; the planned lift-off and touchdown of
the next flight, the one under way or the last; the predicted time to touchdown; the time since the last point lost
contact; the lead time of the controller; and the time for which all points have had contact."""

LATE_LIFT_OFF, EARLY_LIFT_OFF, TOUCHDOWN_SHARE, LANDING_TIME, LOST_CONTACT, EARLY_LANDING = range(6)
STAND_TIME = 6
"""Elements of ``limits``: the parameters of ``JumpPhase`` of these names."""

LEAST_AHEAD = 0.0015
"""A controller that works less ahead of time [s] waits for contact: the prediction is no better."""


@kernel
def find_conditions(
    times: Array1D, limits: Array1D, planned: int, another: bool, holds: Flags1D
) -> None:
    """Mark the conditions that hold in this tick.

    Args:
        times, limits: see ``NOW`` and ``LATE_LIFT_OFF``.
        planned: the phase that the plan is in.
        another: whether the plan has a flight after the one that ``times`` is about.
        holds: becomes true for each ``PhaseCondition`` that holds.
    """
    now, in_phase = times[NOW], times[IN_PHASE]
    lift_off, unloaded = times[LIFT_OFF], times[UNLOADED]
    flight = times[TOUCHDOWN] - lift_off
    due = now >= lift_off
    waiting = unloaded == 0.0 and now < lift_off + limits[LATE_LIFT_OFF]
    share = limits[TOUCHDOWN_SHARE] * (in_phase + times[REMAINING])
    holds[PhaseCondition.PLAN_SQUATS] = planned >= Phase.SQUAT
    holds[PhaseCondition.PLAN_THRUSTS] = planned >= Phase.THRUST or due
    holds[PhaseCondition.LIFT_OFF_DUE] = due and not waiting
    holds[PhaseCondition.LEFT_EARLY] = (
        now + in_phase >= lift_off and not due and unloaded >= limits[EARLY_LIFT_OFF]
    )
    ahead = times[AHEAD]
    early = ahead > LEAST_AHEAD and times[REMAINING] < ahead * limits[EARLY_LANDING]
    holds[PhaseCondition.TOUCHED_DOWN] = (unloaded == 0.0 or early) and in_phase >= share
    holds[PhaseCondition.OVERDUE] = in_phase > flight + limits[LOST_CONTACT]
    holds[PhaseCondition.RESTED] = not another and in_phase >= limits[LANDING_TIME]
    holds[PhaseCondition.THRUSTS_AGAIN] = another and planned == Phase.THRUST
    holds[PhaseCondition.LOST_CONTACT] = unloaded > limits[LOST_CONTACT]
    holds[PhaseCondition.SQUATS_AGAIN] = another and planned == Phase.SQUAT
    holds[PhaseCondition.STANDS] = times[STOOD] >= limits[STAND_TIME]


@kernel
def next_phase(table: Indices2D, phase: int, holds: Flags1D) -> int:
    """Return the phase that follows by the first row (phase, condition, to) of the table that applies."""
    for row in range(table.shape[0]):
        if table[row, 0] == phase and holds[table[row, 1]]:
            return int(table[row, 2])
    return phase


class PhaseMemory(Signal):
    """The state of ``JumpPhase``."""

    phase = Field(dtype="int64", values=Phase, text="see Phase")
    began = Field(unit="s", text="plan time at which the phase began")
    touchdown = Field(unit="s", text="plan time of the last touchdown, negative before the first")
    lift_off_time = Field(unit="s", text="planned lift-off of the flight under way or last")
    touchdown_time = Field(unit="s", text="planned touchdown of that flight")
    unloaded = Field("n_contacts", unit="s", text="time since each point lost contact")
    stood = Field(unit="s", text="time for which all points have had contact")
    stance = Field("n_contacts", dtype="bool", text="the points in stance after touchdown")


class JumpPhase(Block):
    """The phase by plan time and measured contact, the stance points, and the time to touchdown.

    ============  =====================================================================
    phase         ends
    ============  =====================================================================
    HANG          when all points have had contact for ``stand_time``; only with ``start: standing``
    STAND, SQUAT  at the planned times
    THRUST        at the planned lift-off; up to ``late_lift_off`` later while any point
                  still has contact; in its second half at once when no point has had
                  contact for ``early_lift_off``
    FLIGHT        at the first contact after ``touchdown_share`` of the predicted flight; with a
                  delay at the predicted touchdown, see below
    LANDING       ``landing_time`` after touchdown; where the plan has another flight, with the
                  planned thrust, and THRUST follows again
    RECOVER       with the squat of another plan (``SteeredPlan``); else never. It follows a LANDING
    FAULT         never; entered from any other phase on the conditions below
    ============  =====================================================================

    The table that the block works from is ``TRANSITIONS``. FAULT follows where no point
    has had contact for ``lost_contact`` while the robot should stand, or where the flight has
    lasted that much longer than the plan predicted at its start.

    The stance points may belong to any number of feet. Before lift-off they are those that carry
    load in the plan, so that heels may rise while the toes still push; if the plan has none they
    stay those of the tick before. In flight there are none. After touchdown they are all points
    that had contact within the last ``contact_hold``, and points of the same foot that are less
    than ``flat_height`` above the lowest of these; if there is none they stay those of the tick
    before. A landing without any contact so far begins with all points. (A controller that may push with a heel slightly above the ground brings it down by
    that; otherwise the robot would rock on its toes.)

    The time s to touchdown is that of the ballistic fall of the measured centre of mass to its
    planned height at touchdown: z + v s - g s^2 / 2 = z_td.

    **Delay.** A controller that works ahead of time, by a = ``delay.ahead``, gives this block the state
    of that later instant. Then the landing also begins, without waiting for a contact, when the
    predicted touchdown is ``early_landing`` a away: a command that waits for the contact would
    act a later than that, and until then legs that are stiff for flight turn the torso by their
    hips. The legs may be ready some milliseconds too early, which matters less.

    **Start.** With ``start: clock`` the robot stands when the run begins. With ``start: standing`` it may
    hang in a gantry: the legs are held in the planned pose until the robot has been put down and stands on
    all its points. A ``TriggeredJumpPlan`` begins then.

    The block does not judge tilt, torques or sensors (``SafetyMonitor`` does), and it never goes
    back to an earlier phase except for another planned flight or plan.
    """

    class Params(Parameters):
        start: Literal["clock", "standing"] = parameter(
            "clock",
            text="start of the plan: at the first tick of a robot that stands, or after it is put down",
        )
        stand_time: float = parameter(
            0.3,
            unit="s",
            gt=0.0,
            text="time for which it must stand on all points before the plan begins",
        )
        late_lift_off: float = live_parameter(
            0.0, unit="s", ge=0.0, text="longest wait for the feet to leave the ground"
        )
        early_lift_off: float = live_parameter(
            0.01,
            unit="s",
            gt=0.0,
            text="time without any contact after which the robot is in flight",
        )
        touchdown_share: float = live_parameter(
            0.5,
            ge=0.0,
            le=1.0,
            text="share of the predicted flight before which a contact is no touchdown",
        )
        landing_time: float = live_parameter(
            0.35, unit="s", ge=0.0, text="time from touchdown until the robot rises again"
        )
        contact_hold: float = live_parameter(
            0.0,
            unit="s",
            ge=0.0,
            text="time for which a point stays in stance after its contact ends",
        )
        flat_height: float = live_parameter(
            0.006, unit="m", ge=0.0, text="height up to which a foot's other points are in stance"
        )
        early_landing: float = parameter(
            1.5,
            ge=0.0,
            le=3.0,
            text="by this times `delay.ahead` a landing begins before the predicted touchdown",
        )
        lost_contact: float = live_parameter(
            0.2, unit="s", gt=0.0, text="time without contact after which it is a fault"
        )

    class Constants(Signal):
        """Constants derived from the robot and the parameters."""

        transitions = Field((len(TRANSITIONS), 3), dtype="int64", text="rows of TRANSITIONS")
        limits = Field(7, text="see LATE_LIFT_OFF")
        foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")

    class Scratch(Signal):
        """Intermediate values of a step."""

        times = Field(8, unit="s", text="see NOW")
        holds = Field(
            len(PhaseCondition), dtype="bool", text="the conditions that hold in this tick"
        )

    needs = ("feet",)
    params: Params
    constants: Constants
    reference = Input(JumpReference, text="the plan")
    contacts = Input(ContactState, text="points that carry load")
    terms = Input(DynamicsTerms, text="the present state")
    delay = Input(DelayEstimate, default={}, text="lead time of the controller")
    phase = Output(PhaseState, text="the phase, its times and the stance points")
    memory = State(PhaseMemory, text="the phase, its times, and contacts lately lost")

    def setup(self) -> None:
        self.constants.transitions[:] = TABLE
        self.constants.foot_of_point[:] = self.robot.foot_of_contact()

    def prepare(self) -> None:
        p = self.params
        self.constants.limits[:] = (
            p.late_lift_off, p.early_lift_off, p.touchdown_share, p.landing_time, p.lost_contact,
            p.early_landing, p.stand_time,
        )  # fmt: skip

    def start(self) -> None:
        self.memory.touchdown = -1.0
        if self.params.start == "standing":
            self.memory.phase = Phase.HANG

    @kernel
    @staticmethod
    def step(
        reference: JumpReference,
        contacts: ContactState,
        terms: DynamicsTerms,
        delay: DelayEstimate,
        phase: PhaseState,
        memory: PhaseMemory,
        params: Params,
        constants: Constants,
        scratch: Scratch,
        period: float,
    ) -> None:
        now, before, times = reference.time, memory.phase, scratch.times
        shortest = count_unloaded(contacts.active, period, memory.unloaded)
        if count_unloaded_points(contacts.active) == 0:
            memory.stood += period
        else:
            memory.stood = 0.0
        if before < Phase.FLIGHT:
            memory.lift_off_time = reference.lift_off_time
            memory.touchdown_time = reference.touchdown_time
        lift_off, touchdown = memory.lift_off_time, memory.touchdown_time
        another = reference.lift_off_time > touchdown
        remaining = 0.0
        if before <= Phase.FLIGHT:
            remaining = time_to_height(
                terms.com[2], terms.com_velocity[2],
                planned_touchdown_height(
                    reference.com[2], reference.com_velocity[2], touchdown - max(now, lift_off)
                ),
            )  # fmt: skip
        times[NOW], times[IN_PHASE] = now, now - memory.began
        times[LIFT_OFF], times[TOUCHDOWN] = lift_off, touchdown
        if before == Phase.LANDING:  # it may have begun without a contact, after a long flight
            shortest = min(shortest, times[IN_PHASE])
        times[REMAINING], times[UNLOADED], times[AHEAD] = remaining, shortest, delay.ahead
        times[STOOD] = memory.stood
        find_conditions(times, constants.limits, reference.phase, another, scratch.holds)
        after = next_phase(constants.transitions, before, scratch.holds)
        if after != before:
            memory.phase = after
            memory.began = now
            if after == Phase.LANDING:
                memory.touchdown = now
        choose_stance(
            after, reference.contact, memory.unloaded, params.contact_hold,
            terms.contact_position, constants.foot_of_point, params.flat_height, memory.stance,
        )  # fmt: skip
        phase.phase = after
        phase.time_in_phase = now - memory.began
        phase.time_to_touchdown = remaining if after == Phase.FLIGHT else 0.0
        landed = memory.touchdown
        phase.time_since_touchdown = now - landed if landed >= 0.0 else 0.0
        phase.stance[:] = memory.stance
        phase.stepping[:] = False  # steps are for CaptureStep to take
        phase.step_acceleration[:] = 0.0


@kernel
def count_unloaded(active: Flags1D, period: float, unloaded: Array1D) -> float:
    """Update how long each point has been without contact; returns the shortest time [s]."""
    shortest = math.inf
    for i in range(active.shape[0]):
        unloaded[i] = 0.0 if active[i] else unloaded[i] + period
        shortest = min(shortest, unloaded[i])
    return shortest


@kernel
def count_unloaded_points(active: Flags1D) -> int:
    """Count the points without contact."""
    count = 0
    for i in range(active.shape[0]):
        count += 0 if active[i] else 1
    return count


@kernel
def planned_touchdown_height(height: float, velocity: float, remaining: float) -> float:
    """Return the height [m] of a body after a free fall of ``remaining`` [s] from ``height`` [m] with the upward
    ``velocity`` [m/s]."""
    return height + remaining * (velocity - 0.5 * GRAVITY * remaining)


@kernel
def time_to_height(height: float, velocity: float, goal: float) -> float:
    """Return the time [s] until a falling body comes down to ``goal`` [m].

    If it never reaches that height, the time until its apex.
    """
    square = velocity * velocity + 2.0 * GRAVITY * (height - goal)
    return max(0.0, (velocity + math.sqrt(max(square, 0.0))) / GRAVITY)


@kernel
def choose_stance(
    phase: int,
    planned: Flags1D,
    unloaded: Array1D,
    hold: float,
    position: Rows3,
    foot: Indices1D,
    flat_height: float,
    stance: Flags1D,
) -> None:
    """Update the points in ``stance``, which holds those of the tick before; see ``JumpPhase``.

    Args:
        planned: the points that carry load in the plan.
        unloaded: how long each point has been without contact [s].
        position: the positions of the points [m, world], (n, 3).
        foot: the foot of each point.
    """
    if phase <= Phase.FLIGHT:
        any_planned, any_stance = False, False
        for i in range(stance.shape[0]):
            any_planned = any_planned or planned[i]
            any_stance = any_stance or stance[i]
        for i in range(stance.shape[0]):
            if phase == Phase.FLIGHT or phase == Phase.HANG:
                stance[i] = False
            elif any_planned:
                stance[i] = planned[i]
            elif not any_stance:
                stance[i] = True
        return
    ground = math.inf
    for i in range(unloaded.shape[0]):
        if unloaded[i] <= hold:
            ground = min(ground, position[i, 2])
    if ground == math.inf:
        any_held = False
        for i in range(stance.shape[0]):
            any_held = any_held or stance[i]
        for i in range(stance.shape[0]):
            stance[i] = stance[i] or not any_held
        return
    for i in range(unloaded.shape[0]):
        stance[i] = unloaded[i] <= hold
        if position[i, 2] >= ground + flat_height:
            continue
        for j in range(unloaded.shape[0]):
            if foot[j] == foot[i] and unloaded[j] <= hold:
                stance[i] = True
