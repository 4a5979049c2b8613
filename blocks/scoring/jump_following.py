"""Records a jump, tick by tick, from the simulation truth and from the reference."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from ...mathematics.arrays import (
    Array,
    Array0D,
    Array1D,
    Array2D,
    Indices0D,
    Indices1D,
    Rows3,
    Vector3,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from .jump_series import Jump, Planned, Series, keep_place, note_landing, note_place
from .stand_criteria import NEVER
from .stand_following import (
    Limits,
    Stand,
    Truth,
    any_touched,
    begin,
    keep_largest,
    keep_least,
    largest_of,
    note_fall,
    note_feet,
    note_machine,
    note_rest,
)

EARLY_LIFT_OFF = 0.1
"""Feet that leave the ground more than this time [s] before the planned lift-off have bounced."""


class Ending(IntEnum):
    """Why a judge asks for the end of the run."""

    NONE = 0
    FELL = 1
    ALONE = 2
    """No other jump of a row has come."""
    RESTED = 3


_FELL, _ALONE, _RESTED = int(Ending.FELL), int(Ending.ALONE), int(Ending.RESTED)


class Reference(NamedTuple):
    """The fields of ``JumpReference`` that a jump is compared with."""

    time: Array0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    com: Vector3
    com_velocity: Vector3
    foot_position: Rows3
    foot_yaw: Array1D


class Times(NamedTuple):
    """When what of a jump is judged [s]: see ``JumpCriteria``. ``jumps`` is the number in a row, and
    ``planned`` says whether there is a reference."""

    flight_confirmation: float
    rest_time: float
    settle_time: float
    slip_delay: float
    jumps: int
    planned: bool


class Verdict(NamedTuple):
    """What a tick asks for, (1,): the ``Ending``, and how long after touchdown that is [s]."""

    ending: Indices1D
    landed: Array1D


@kernel
def follow_reference(
    tick: Indices1D,
    base_period: float,
    ticks: Indices0D,
    reference: Reference,
    planned: Planned,
    series: Series,
) -> None:
    """Note what the reference plans: its flight, its apex, and where the feet should be.

    Args:
        tick: the present tick, (1,), each of ``base_period`` [s].
        ticks: of the record so far, without a dimension.
    """
    now, first = base_period * tick[0], ticks[()] == 0
    feet, turn = planned.foot.shape[0], 0.0
    for foot in range(feet):
        turn += reference.foot_yaw[foot]
        for axis in range(2):
            planned.foot[foot, axis] = reference.foot_position[foot, axis]
    planned.yaw[()] = turn / feet
    height = reference.com[2]
    if first:
        for foot in range(feet):
            for axis in range(2):
                planned.start[foot, axis] = planned.foot[foot, axis]
        planned.yaw_start[()] = planned.yaw[()]
        planned.standing[()] = planned.apex[()] = height
        planned.speed_time[()] = NEVER
    keep_largest(planned.apex, height)
    time, touchdown = reference.time[()], reference.touchdown_time[()]
    lift_off = reference.lift_off_time[()]
    taken_off = lift_off - 1e-9 <= time < touchdown
    fresh = planned.speed_time[()] == NEVER
    if fresh or taken_off:  # from the middle of a flight on the reference names the next
        planned.flight[()] = touchdown - lift_off
    later = lift_off > series.planned_lift_off[()]
    if taken_off and (fresh or later):
        series.planned_lift_off[()] = lift_off
        if not fresh:
            planned.apex[()] = height
        planned.speed_time[()] = now
        # The plan's own ballistic flight takes it back to the planned instant.
        planned.speed[()] = reference.com_velocity[2] + GRAVITY * (time - lift_off)


@kernel
def follow_jump(
    tick: Indices1D,
    base_period: float,
    truth: Truth,
    momentum: Array1D,
    reference: Reference,
    failures: Indices0D,
    stand: Stand,
    jump: Jump,
    planned: Planned,
    series: Series,
    limits: Limits,
    times: Times,
    verdict: Verdict,
) -> None:
    """Follow a jump by one tick, once its feet have been measured.

    Args:
        tick, base_period: as for ``follow_reference``.
        momentum: the angular momentum about the com [N m s, world], (3,).
        failures: of the solver so far, without a dimension.
    """
    now = base_period * tick[0]
    stand.now[()] = now
    if stand.ticks[()] == 0:
        begin(stand, truth)
        begin_jump(jump, planned, stand.foot, truth.com[2])
    stand.ticks[()] = stand.ticks[()] + 1
    note_machine(stand, truth)
    stand.failures[()] = failures[()]
    verdict.ending[0] = _FELL if note_fall(stand, truth, limits) else 0
    touched, made = any_touched(truth.contact_touched), series.made[()]
    early = reference.time[()] < reference.lift_off_time[()] - EARLY_LIFT_OFF
    bounces = times.planned and made > 0 and early
    follow_flight(
        now, touched, bounces, truth, momentum, stand, jump, planned, series, limits, times
    )
    if jump.touchdown_time[()] != NEVER:
        follow_landing(now - jump.touchdown_time[()], truth, stand, jump, limits, times, verdict)
    elif series.made[()] != 0:
        follow_row(now, touched, stand.foot, jump, planned, series, times, verdict)
    jump.vertical_speed[()] = truth.com_velocity[2]


@kernel
def begin_jump(jump: Jump, planned: Planned, foot: Array2D, height: float) -> None:
    """Start the record of a jump; ``foot`` (n_feet, 2) is where the feet are, ``height`` the com's."""
    jump.unloaded_time[()] = jump.lift_off_time[()] = jump.touchdown_time[()] = NEVER
    planned.speed_time[()] = NEVER
    jump.squat_height[()] = jump.apex_height[()] = height
    for k in range(foot.shape[0]):
        for axis in range(2):
            jump.start_foot[k, axis] = foot[k, axis]
            jump.start_direction[k, axis] = jump.direction[k, axis]


@kernel
def follow_flight(
    now: float,
    touched: bool,
    bounces: bool,
    truth: Truth,
    momentum: Vector3,
    stand: Stand,
    jump: Jump,
    planned: Planned,
    series: Series,
    limits: Limits,
    times: Times,
) -> None:
    """Lift-off, apex and touchdown, by the simulator's contacts.

    ``bounces`` says that a foot off the ground would be no lift-off: it is between two jumps.
    """
    height = truth.com[2]
    if jump.lift_off_time[()] == NEVER:
        keep_least(jump.squat_height, height)
        if touched or bounces:
            jump.unloaded_time[()] = NEVER
            return
        if jump.unloaded_time[()] == NEVER:
            # Nothing touched during the whole of the tick before.
            jump.unloaded_time[()] = max(0.0, now - limits.period)
            speed = jump.vertical_speed[()] if now > 0.0 else truth.com_velocity[2]
            jump.unloaded_speed[()] = speed
            for axis in range(3):
                jump.unloaded_momentum[axis] = momentum[axis]
            jump.apex_height[()] = height
        if now - jump.unloaded_time[()] >= times.flight_confirmation - 1e-9:
            jump.lift_off_time[()] = jump.unloaded_time[()]
            jump.lift_off_speed[()] = jump.unloaded_speed[()]
            for axis in range(3):
                jump.lift_off_momentum[axis] = jump.unloaded_momentum[axis]
            if series.made[()] != 0:
                keep_place(series)
    elif jump.touchdown_time[()] == NEVER and touched:
        jump.touchdown_time[()] = now - limits.period
        jump.touchdown_speed[()] = -jump.vertical_speed[()]
        if series.made[()] + 1 < times.jumps:  # more jumps must follow
            note_landing(stand.standing_height[()], jump, planned, series, times.planned)
            stand.peak_tilt[()] = 0.0
            return
    if jump.touchdown_time[()] == NEVER:
        keep_largest(jump.apex_height, height)


@kernel
def follow_row(
    now: float,
    touched: bool,
    foot: Array,
    jump: Jump,
    planned: Planned,
    series: Series,
    times: Times,
    verdict: Verdict,
) -> None:
    """Between two jumps: where the feet stand, and whether another comes."""
    if times.planned and touched:
        note_place(foot, jump, planned, series)
    landed = now - series.landed_time[()]
    if jump.lift_off_time[()] == NEVER and landed >= times.rest_time - 1e-9:
        ask(verdict, _ALONE, landed)


@kernel
def follow_landing(
    since: float,
    truth: Truth,
    stand: Stand,
    jump: Jump,
    limits: Limits,
    times: Times,
    verdict: Verdict,
) -> None:
    """Peaks since touchdown, feet that slide or step, and the rest when its time comes.

    ``since`` is the time since touchdown [s].
    """
    landed = since
    keep_largest(stand.peak_tilt, tilt(truth.base_orientation))
    note_feet(stand, truth.contact_touched, limits, landed >= times.slip_delay - 1e-9)
    if stand.steps[()] != 0:
        landed = min(landed, stand.now[()] - largest_of(stand.step_end))
    if stand.judged_time[()] == NEVER and landed >= times.rest_time - 1e-9:
        note_rest(stand, truth, limits)
        jump.ground_low[()] = jump.ground_high[()] = truth.ground_height[0]
        for point in range(1, truth.ground_height.shape[0]):
            keep_least(jump.ground_low, truth.ground_height[point])
            keep_largest(jump.ground_high, truth.ground_height[point])
    if landed >= times.rest_time + times.settle_time - 1e-9:
        ask(verdict, _RESTED, landed)


@kernel
def ask(verdict: Verdict, ending: int, landed: float) -> None:
    """Ask for the end of the run, unless the same tick has asked for it already."""
    if verdict.ending[0] == 0:
        verdict.ending[0], verdict.landed[0] = ending, landed
