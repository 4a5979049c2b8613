"""Determines which phase of the jump the robot is really in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Flags1D,
    Indices0D,
    Indices1D,
    Indices2D,
    Rows3,
    Vector3,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, DelayEstimate, DynamicsTerms, JumpReference, Phase, PhaseState
from .capture_law import PhaseFields
from .phase_table import (
    AHEAD,
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


class JumpPhase(KernelBlock):
    """The phase by plan time and measured contact, the stance points, and the time to touchdown.

    ============  =====================================================================
    phase         ends
    ============  =====================================================================
    STAND, SQUAT  at the planned times
    THRUST        at the planned lift-off; up to ``late_lift_off`` later while any point
                  still has contact; in its second half at once when no point has had
                  contact for ``early_lift_off``
    FLIGHT        at the first contact after ``touchdown_share`` of the predicted flight; with a
                  delay at the predicted touchdown, see below
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
    before. A landing without any contact so far begins with all points. (A controller that may push with a heel slightly above the ground brings it down by
    that; otherwise the robot would rock on its toes.)

    The time s to touchdown is that of the ballistic fall of the measured centre of mass to its
    planned height at touchdown: z + v s - g s^2 / 2 = z_td.

    **Delay.** A controller that works ahead of time, by a = ``delay.ahead``, gives this block the state
    of that later instant. Then the landing also begins, without waiting for a contact, when the
    predicted touchdown is ``early_landing`` a away: a command that waits for the contact would
    act a later than that, and until then legs that are stiff for flight turn the torso by their
    hips. The legs may be ready some milliseconds too early, which matters less.

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
        early_landing: float = parameter(
            1.5,
            ge=0.0,
            le=3.0,
            text="by this times `delay.ahead` a landing begins before the predicted touchdown",
        )
        lost_contact: float = live_parameter(
            0.2, unit="s", gt=0.0, text="time without contact after which it is a fault"
        )

    needs = ("feet",)
    params: Params
    reference = Input(JumpReference, text="the plan")
    contacts = Input(ContactState, text="which points carry load")
    terms = Input(DynamicsTerms, text="the present state")
    delay = Input(DelayEstimate, default={}, text="how far ahead of time the controller works")
    phase = Output(PhaseState, text="the phase, its times and the stance points")
    memory = State(PhaseMemory, text="the phase, its times, and contacts lately lost")

    def setup(self) -> None:
        reference, terms = self.reference, self.terms
        self._limits, self._stance_limits = np.zeros(6), np.zeros(2)
        self.on_parameters()
        following = KernelCall(
            follow_phases,
            self.period,
            Planned(*(getattr(reference, name) for name in Planned._fields)),
            self.contacts.active,
            self.delay.ahead,
            Present(terms.com, terms.com_velocity, terms.contact_position),
            np.array(self.robot.foot_of_contact(), np.int64),
            Table(
                TABLE, self._limits, self._stance_limits, np.zeros(7),
                np.zeros(len(Condition), np.bool_),
            ),
            Memory(*(getattr(self.memory, name) for name in Memory._fields)),
            PhaseFields(*(getattr(self.phase, name) for name in PhaseFields._fields)),
        )  # fmt: skip
        self.kernel_calls = (following,)

    def on_parameters(self) -> None:
        p = self.params
        self._limits[:] = (
            p.late_lift_off, p.early_lift_off, p.touchdown_share, p.landing_time, p.lost_contact,
            p.early_landing,
        )  # fmt: skip
        self._stance_limits[:] = p.contact_hold, p.flat_height

    def start(self) -> None:
        self.memory.touchdown[()] = -1.0


class Planned(NamedTuple):
    """The fields of ``JumpReference`` that the phases follow."""

    time: Array0D
    phase: Indices0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    com: Vector3
    com_velocity: Vector3
    contact: Flags1D


class Present(NamedTuple):
    """The fields of ``DynamicsTerms`` that tell the time to touchdown, and the points."""

    com: Vector3
    com_velocity: Vector3
    contact_position: Rows3


class Memory(NamedTuple):
    """The fields of ``PhaseMemory``."""

    phase: Indices0D
    began: Array0D
    touchdown: Array0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    unloaded: Array1D
    stance: Flags1D


class Table(NamedTuple):
    """The ``transitions`` and their ``limits``, those of the stance, and memory: see ``phase_table``.

    ``stance_limits`` (2,) are how long a lost contact counts [s], and how high a point of a flat foot
    may be above the lowest [m].
    """

    transitions: Indices2D
    limits: Array1D
    stance_limits: Array1D
    times: Array1D
    holds: Flags1D


@kernel
def follow_phases(
    period: float,
    planned: Planned,
    active: Flags1D,
    ahead: Array0D,
    present: Present,
    foot_of_point: Indices1D,
    table: Table,
    memory: Memory,
    out: PhaseFields,
) -> None:
    """One tick of ``JumpPhase``; ``active`` are the points with contact, (n_contacts,)."""
    now, before, times = planned.time[()], memory.phase[()], table.times
    shortest = count_unloaded(active, period, memory.unloaded)
    if before < Phase.FLIGHT:
        memory.lift_off_time[()] = planned.lift_off_time[()]
        memory.touchdown_time[()] = planned.touchdown_time[()]
    lift_off = memory.lift_off_time[()]
    touchdown = memory.touchdown_time[()]
    another = planned.lift_off_time[()] > touchdown
    remaining = 0.0
    if before <= Phase.FLIGHT:
        remaining = time_to_height(
            present.com[2], present.com_velocity[2],
            planned_touchdown_height(
                planned.com[2], planned.com_velocity[2],
                touchdown - max(now, lift_off),
            ),
        )  # fmt: skip
    times[NOW], times[IN_PHASE] = now, now - memory.began[()]
    times[LIFT_OFF], times[TOUCHDOWN] = lift_off, touchdown
    if before == Phase.LANDING:  # it may have begun without a contact, after a long flight
        shortest = min(shortest, times[IN_PHASE])
    times[REMAINING], times[UNLOADED], times[AHEAD] = remaining, shortest, ahead[()]
    find_conditions(times, table.limits, planned.phase[()], another, table.holds)
    phase = next_phase(table.transitions, before, table.holds)
    if phase != before:
        memory.phase[()] = phase
        memory.began[()] = now
        if phase == Phase.LANDING:
            memory.touchdown[()] = now
    choose_stance(
        phase, planned.contact, memory.unloaded, table.stance_limits[0],
        present.contact_position, foot_of_point, table.stance_limits[1], memory.stance,
    )  # fmt: skip
    out.phase[()] = phase
    out.time_in_phase[()] = now - memory.began[()]
    out.time_to_touchdown[()] = remaining if phase == Phase.FLIGHT else 0.0
    landed = memory.touchdown[()]
    out.time_since_touchdown[()] = now - landed if landed >= 0.0 else 0.0
    for i in range(active.shape[0]):
        out.stance[i] = memory.stance[i]
        out.stepping[i] = False  # steps are for CaptureStep to take
        out.step_acceleration[i, :] = 0.0


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
    if phase <= Phase.FLIGHT:
        any_planned, any_stance = False, False
        for i in range(stance.shape[0]):
            any_planned = any_planned or bool(planned[i])
            any_stance = any_stance or bool(stance[i])
        for i in range(stance.shape[0]):
            if phase == Phase.FLIGHT:
                stance[i] = False
            elif any_planned:
                stance[i] = planned[i]
            elif not any_stance:
                stance[i] = True
        return
    ground = math.inf
    for i in range(unloaded.shape[0]):
        if unloaded[i] <= hold:
            ground = min(ground, float(position[i, 2]))
    if ground == math.inf:
        any_held = False
        for i in range(stance.shape[0]):
            any_held = any_held or bool(stance[i])
        for i in range(stance.shape[0]):
            stance[i] = stance[i] or not any_held
        return
    for i in range(unloaded.shape[0]):
        stance[i] = unloaded[i] <= hold
        if float(position[i, 2]) >= ground + flat_height:
            continue
        for j in range(unloaded.shape[0]):
            if foot[j] == foot[i] and unloaded[j] <= hold:
                stance[i] = True
