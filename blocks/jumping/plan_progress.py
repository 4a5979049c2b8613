"""How far a plan's thrust has come, by the motion and not by the clock."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array,
    Array0D,
    Array1D,
    Array2D,
    Flags0D,
    Indices0D,
    Indices1D,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ..signals import DynamicsTerms, JumpReference, Phase

SLOWEST = 0.5
"""Vertical speed [m/s] below which a height makes no difference to the apex yet."""
LEAST_PUSH = 8.0
"""Acceleration [m/s^2] by which at least a delay of the plan is taken to speed the robot up."""


@kernel
def speed_error(height: float, speed: float, planned_height: float, planned_speed: float) -> float:
    """By how much [m/s] the robot is too fast for the planned apex, or too slow, if negative.

    The apex of a throw is z + v^2 / (2 g), so a height error dz counts like the speed error
    g dz / v.

    Args:
        height, planned_height: of the centre of mass above the feet [m].
        speed, planned_speed: upwards [m/s].
    """
    error = speed - planned_speed
    if planned_speed > SLOWEST:
        error += GRAVITY * (height - planned_height) / planned_speed
    return error


@kernel
def delay_change(error: float, push: float, gain: float, fastest: float, period: float) -> float:
    """The change [s] of a plan's delay in one period, so that the thrust ends at the planned apex.

    A thrust that ends later by d makes the robot faster by its acceleration times d.

    Args:
        error: from ``speed_error`` [m/s].
        push: the planned upward acceleration [m/s^2].
        gain: the rate at which the error is corrected [1/s].
        fastest: the largest rate of the delay, as a share of time.
        period: of the block [s].
    """
    rate = -gain * error / max(push, LEAST_PUSH)
    return min(max(rate, -fastest), fastest) * period


class Motion(NamedTuple):
    """The measured or the planned motion that tells the progress.

    ``com`` and ``com_velocity`` (3,) [m, m/s], and ``foot_position`` (n_feet, 3) [m], all in the world.
    """

    com: Array1D
    com_velocity: Array1D
    foot_position: Array2D


class Planned(NamedTuple):
    """What else the plan says: its phase, when it lifts off [s], of shape () each, and the
    acceleration of the centre of mass [m/s^2, world], (3,)."""

    phase: Indices0D
    lift_off_time: Array0D
    com_acceleration: Array1D


class ProgressSettings(NamedTuple):
    """The parameters of ``JumpPlan`` about progress, the largest rate of the delay, and the period."""

    time: float
    gain: float
    limit: float
    fastest: float
    period: float


class Flight(NamedTuple):
    """What else the plan says of a flight: its phase, when it ends [s], and whether the toes land first,
    of shape () each."""

    phase: Indices0D
    touchdown_time: Array0D
    toes_first: Flags0D


class FallSettings(NamedTuple):
    """The parameters of ``JumpPlan`` about such a flight, the largest rate of the delay, and the period."""

    gain: float
    fastest: float
    period: float


class Progress(NamedTuple):
    """The fields of ``PlanProgress``, of shape () each."""

    late: Array0D
    before: Array0D


@kernel
def plan_instant(
    present: Indices1D,
    base_period: float,
    late: Array0D,
    lead: Array0D,
    ahead: Array0D,
    hold: float,
    instant: Array1D,
) -> None:
    """The instant at which the plan is read.

    Args:
        present: the tick, (1,).
        base_period: the seconds of a tick.
        late: how much later than by the clock the plan is read [s], of shape ().
        lead: how far ahead the feedforward is read [s], of shape ().
        ahead: how much of that all of the plan is read ahead [s], of shape ().
        hold: the seconds over which the feedforward is the mean.
        instant: the time, the lead and the hold [s], (3,).
    """
    early = min(ahead[()], lead[()])
    instant[0] = base_period * present[0] - late[()] + early
    instant[1] = lead[()] - early
    instant[2] = hold


@kernel
def follow_motion(
    instant: Array1D,
    measured: Motion,
    reference: Motion,
    planned: Planned,
    settings: ProgressSettings,
    progress: Progress,
) -> None:
    """Delay or hasten the end of a thrust by the speed and height of the centre of mass.

    Args:
        instant: as ``plan_instant`` writes it; all others but ``measured`` are of that instant.
    """
    left = planned.lift_off_time[()] - instant[0]
    if planned.phase[()] != Phase.THRUST or not 0.0 < left <= settings.time:
        progress.before[()] = progress.late[()]
        return
    error = speed_error(
        measured.com[2] - mean_height(measured.foot_position),
        measured.com_velocity[2],
        reference.com[2] - mean_height(reference.foot_position),
        reference.com_velocity[2],
    )
    push, before = planned.com_acceleration[2], progress.before[()]
    late = progress.late[()] - before
    late += delay_change(error, push, settings.gain, settings.fastest, settings.period)
    late = min(max(late, -settings.limit), settings.limit)
    progress.late[()] = before + late


@kernel
def follow_fall(
    instant: Array1D,
    measured: Motion,
    reference: Motion,
    planned: Flight,
    settings: FallSettings,
    progress: Progress,
) -> None:
    """Hasten or delay a flight whose toes land first, so that it ends when the fall does.

    Args:
        instant: as ``plan_instant`` writes it; all others but ``measured`` are of that instant.
    """
    if planned.phase[()] != Phase.FLIGHT or not planned.toes_first[()]:
        return
    left = planned.touchdown_time[()] - instant[0]
    sinking = GRAVITY * left - reference.com_velocity[2]
    lowest = reference.com[2] - 0.5 * (sinking - reference.com_velocity[2]) * left
    fall = time_to_fall(measured.com[2] - lowest, measured.com_velocity[2])
    rate = settings.gain * (fall - left)
    rate = min(max(rate, -settings.fastest), settings.fastest)
    progress.late[()] = progress.late[()] + rate * settings.period


@kernel
def time_to_fall(height: float, speed: float) -> float:
    """The time [s] in which a body that is thrown up at ``speed`` [m/s] falls by ``height`` [m]."""
    square = speed * speed + 2.0 * GRAVITY * max(height, 0.0)
    return (speed + math.sqrt(square)) / GRAVITY


@kernel
def mean_height(position: Array2D) -> float:
    """The mean height [m] of positions (n, 3)."""
    total = 0.0
    for i in range(position.shape[0]):
        total += position[i, 2]
    return total / len(position)


def following_calls(
    instant: Array,
    terms: DynamicsTerms,
    reference: JumpReference,
    thrust: ProgressSettings,
    fall: FallSettings,
    progress: Progress,
) -> tuple[KernelCall, KernelCall]:
    """The calls of ``follow_motion`` and ``follow_fall``, with the measured ``terms``."""
    measured, planned = (
        Motion(*(getattr(signal, name) for name in Motion._fields)) for signal in (terms, reference)
    )
    others = Planned(*(getattr(reference, name) for name in Planned._fields))
    flight = Flight(*(getattr(reference, name) for name in Flight._fields))
    return (
        KernelCall(follow_motion, instant, measured, planned, others, thrust, progress),
        KernelCall(follow_fall, instant, measured, planned, flight, fall, progress),
    )
