"""Determines which phase of the jump the robot is really in."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, DynamicsTerms, JumpReference, Phase, PhaseState
from .phase_table import (
    IN_PHASE,
    LIFT_OFF,
    NOW,
    REMAINING,
    TABLE,
    TOUCHDOWN,
    UNLOADED,
    Condition,
    find_conditions,
    next_phase,
)


class PhaseMemory(Signal):
    """The state of ``JumpPhase``."""

    phase = Field(dtype="int64", values=Phase, text="see Phase")
    began = Field(unit="s", text="plan time at which the phase began")
    touchdown = Field(unit="s", text="plan time of the last touchdown, negative before the first")
    lift_off_time = Field(unit="s", text="planned lift-off of the flight under way or last")
    touchdown_time = Field(unit="s", text="planned touchdown of that flight")
    unloaded = Field("n_contacts", unit="s", text="how long each point has been without contact")
    stance = Field("n_contacts", dtype="bool", text="the points in stance after touchdown")


class JumpPhase(Block):
    """The phase by plan time and measured contact, the stance points, and the time to touchdown.

    ============  =====================================================================
    phase         ends
    ============  =====================================================================
    STAND, SQUAT  at the planned times
    THRUST        at the planned lift-off; up to ``late_lift_off`` later while any point
                  still has contact; in its second half at once when no point has had
                  contact for ``early_lift_off``
    FLIGHT        at the first contact after ``touchdown_share`` of the predicted flight
    LANDING       ``landing_time`` after touchdown; where the plan has another flight, with the
                  planned thrust, and THRUST follows again
    RECOVER       never; it follows the last LANDING
    FAULT         never; entered from any other phase on the conditions below
    ============  =====================================================================

    The table that the block works from is ``phase_table.TRANSITIONS``. FAULT follows where no point
    has had contact for ``lost_contact`` while the robot should stand, or where the flight has
    lasted that much longer than the plan predicted at its start.

    The stance points may belong to any number of feet. Before lift-off they are those that carry
    load in the plan, so that heels may rise while the toes still push; if the plan has none they
    stay those of the tick before. In flight there are none. After touchdown they are all points
    that had contact within the last ``contact_hold``, and points of the same foot that are less
    than ``flat_height`` above the lowest of these; if there is none they stay those of the tick
    before. (A controller that may push with a heel slightly above the ground brings it down by
    that; otherwise the robot would rock on its toes.)

    The time s to touchdown is that of the ballistic fall of the measured centre of mass to its
    planned height at touchdown: z + v s - g s^2 / 2 = z_td.

    The block does not judge tilt, torques or sensors (``SafetyMonitor`` does), and it never goes
    back to an earlier phase except for another planned flight.
    """

    class Params(Parameters):
        late_lift_off: float = live_parameter(
            0.0, unit="s", ge=0.0, text="how long to wait for the feet to leave the ground"
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
            0.0, unit="s", ge=0.0, text="how long a point stays in stance after its contact ends"
        )
        flat_height: float = live_parameter(
            0.006, unit="m", ge=0.0, text="height up to which a foot's other points are in stance"
        )
        lost_contact: float = live_parameter(
            0.2, unit="s", gt=0.0, text="time without contact after which it is a fault"
        )

    needs = ("feet",)
    params: Params
    reference = Input(JumpReference, text="the plan")
    contacts = Input(ContactState, text="which points carry load")
    terms = Input(DynamicsTerms, text="the present state")
    phase = Output(PhaseState, text="the phase, its times and the stance points")
    memory = State(PhaseMemory, text="the phase, its times, and contacts lately lost")

    def setup(self) -> None:
        self._foot_of_point = np.array(self.robot.foot_of_contact())
        self._table, self._holds = TABLE, np.zeros(len(Condition), bool)
        self._times = np.zeros(6)
        self.on_parameters()

    def on_parameters(self) -> None:
        p = self.params
        self._limits = np.array([
            p.late_lift_off, p.early_lift_off, p.touchdown_share, p.landing_time, p.lost_contact,
        ])  # fmt: skip

    def start(self) -> None:
        self.memory.touchdown[()] = -1.0

    def step(self) -> None:
        p, memory, out = self.params, self.memory, self.phase
        now = float(self.reference.time)
        active, unloaded = self.contacts.active, memory.unloaded
        shortest = count_unloaded(active, self.period, unloaded)
        if int(memory.phase) < Phase.FLIGHT:
            memory.lift_off_time[...] = self.reference.lift_off_time
            memory.touchdown_time[...] = self.reference.touchdown_time
        lift_off, touchdown_time = float(memory.lift_off_time), float(memory.touchdown_time)
        another = float(self.reference.lift_off_time) > touchdown_time
        remaining = 0.0
        if int(memory.phase) <= Phase.FLIGHT:
            remaining = time_to_height(
                float(self.terms.com[2]), float(self.terms.com_velocity[2]),
                planned_touchdown_height(
                    float(self.reference.com[2]), float(self.reference.com_velocity[2]),
                    touchdown_time - max(now, lift_off),
                ),
            )  # fmt: skip
        before = int(memory.phase)
        times = self._times
        times[NOW], times[IN_PHASE] = now, now - float(memory.began)
        times[LIFT_OFF], times[TOUCHDOWN] = lift_off, touchdown_time
        times[REMAINING], times[UNLOADED] = remaining, shortest
        find_conditions(times, self._limits, int(self.reference.phase), another, self._holds)
        phase = next_phase(self._table, before, self._holds)
        if phase != before:
            memory.phase[()] = phase
            memory.began[()] = now
            if phase == Phase.LANDING:
                memory.touchdown[()] = now
        choose_stance(
            phase, self.reference.contact, unloaded, p.contact_hold, self.terms.contact_position,
            self._foot_of_point, p.flat_height, memory.stance,
        )  # fmt: skip
        out.phase[()] = phase
        out.time_in_phase[()] = now - float(memory.began)
        out.time_to_touchdown[()] = remaining if phase == Phase.FLIGHT else 0.0
        since = now - float(memory.touchdown) if float(memory.touchdown) >= 0.0 else 0.0
        out.time_since_touchdown[()] = since
        out.stance[...] = memory.stance
        out.stepping[...] = False  # steps are for CaptureStep to take
        out.step_acceleration[...] = 0.0


@kernel
def count_unloaded(
    active: NDArray[np.bool_], period: float, unloaded: NDArray[np.float64]
) -> float:
    """Update how long each point has been without contact; returns the shortest time [s]."""
    shortest = math.inf
    for i in range(active.shape[0]):
        unloaded[i] = 0.0 if active[i] else float(unloaded[i]) + period
        shortest = min(shortest, float(unloaded[i]))
    return shortest


@kernel
def planned_touchdown_height(height: float, velocity: float, remaining: float) -> float:
    """The height [m] of a body after a free fall of ``remaining`` [s] from ``height`` [m] with the
    upward ``velocity`` [m/s]."""
    return height + remaining * (velocity - 0.5 * GRAVITY * remaining)


@kernel
def time_to_height(height: float, velocity: float, goal: float) -> float:
    """The time [s] until a falling body comes down to ``goal`` [m].

    If it never reaches that height, the time until its apex.
    """
    square = velocity * velocity + 2.0 * GRAVITY * (height - goal)
    return max(0.0, (velocity + math.sqrt(max(square, 0.0))) / GRAVITY)


@kernel
def choose_stance(
    phase: int,
    planned: NDArray[np.bool_],
    unloaded: NDArray[np.float64],
    hold: float,
    position: NDArray[np.float64],
    foot: NDArray[np.int64],
    flat_height: float,
    stance: NDArray[np.bool_],
) -> None:
    """Update the points in ``stance``, which holds those of the tick before; see ``JumpPhase``.

    Args:
        planned: the points that carry load in the plan.
        unloaded: how long each point has been without contact [s].
        position: the positions of the points [m, world], (n, 3).
        foot: the foot of each point.
    """
    if phase < Phase.FLIGHT:
        if np.any(planned):
            stance[:] = planned
        elif not np.any(stance):
            stance[:] = True
        return
    if phase == Phase.FLIGHT:
        stance[:] = False
        return
    ground = math.inf
    for i in range(unloaded.shape[0]):
        if unloaded[i] <= hold:
            ground = min(ground, float(position[i, 2]))
    if ground == math.inf:
        return
    for i in range(unloaded.shape[0]):
        stance[i] = unloaded[i] <= hold
        if float(position[i, 2]) >= ground + flat_height:
            continue
        for j in range(unloaded.shape[0]):
            if foot[j] == foot[i] and unloaded[j] <= hold:
                stance[i] = True
