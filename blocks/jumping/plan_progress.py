"""The reading time of a plan, from the progress of the robot's thrust, fall or rotation."""

from __future__ import annotations

import math
from typing import Literal

from ...mathematics.arrays import Array1D, Array2D, Matrix3
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import atan2
from ...mathematics.kernel import kernel
from ...mathematics.rotations import pitch_angle, wrap
from ...mathematics.stance_feet import has_contact
from ...planner.library.jump_table import PITCH, FlightRotation, TableRows
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DelayEstimate, DynamicsTerms, JumpReference, Phase
from .jump_phase import planned_touchdown_height, time_to_height
from .table_reading import locate, read_table

FASTEST = 0.5
"""Largest change of a plan's speed, as a share of time."""
SLOWEST = 0.5
"""Vertical speed [m/s] below which a height makes no difference to the apex yet."""
LEAST_PUSH = 8.0
"""Acceleration [m/s^2] by which at least a delay of the plan is taken to speed the robot up."""
SETTLED = 0.02
"""Time after lift-off [s] from which the measured momentum is that of the flight."""
FULL = 0.95
"""The rate of rotation is measured while the planned one is at least this share of its greatest."""
SPIN_TIME, SPIN_RANGE = 0.03, 0.2
"""Time constant of its mean [s], and by what share it may differ from the plan's."""
TUCKED_SHIFT, OPEN_SHIFT = 0.3, 0.4
"""Largest change of a plan's speed before and after the legs have left the tuck, as a share of time."""
CLOSING = 0.008
"""Time before touchdown [s] from which the plan is on time again."""


class Turning(Parameters):
    """Retiming of a somersault's flight; see ``follow_turn``."""

    gain: float = parameter(
        50.0, unit="1/s", ge=0.0, text="rate at which an error of the rotation is corrected"
    )
    early: float = parameter(
        0.04, unit="s", ge=0.0, le=0.1, text="largest advance of the legs' leaving the tuck"
    )
    late: float = parameter(
        0.005, unit="s", ge=0.0, le=0.05,
        text="largest delay of it; then they must hurry, and their feet are faster at touchdown",
    )  # fmt: skip
    aim: float = parameter(
        0.0, unit="rad", ge=-0.5, le=0.5,
        text="excess of the body's rotation over the planned one at touchdown",
    )  # fmt: skip


class ProgressParameters(Parameters):
    """Parameters that keep ``JumpPlan`` in time with the robot."""

    by: Literal["progress", "clock"] = parameter(
        "progress",
        text="condition that ends the thrust: the speed reached, if `terms` is wired, or time",
    )
    progress_time: float = parameter(
        0.06, unit="s", gt=0.0, text="time before lift-off in which the motion counts"
    )
    progress_gain: float = parameter(
        40.0, unit="1/s", ge=0.0, text="rate at which an error of the speed is corrected"
    )
    progress_limit: float = parameter(
        0.008, unit="s", ge=0.0, le=0.05, text="largest change of a thrust's end"
    )
    toes_gain: float = parameter(
        5.0, unit="1/s", ge=0.0, text="rate at which the plan is kept in time with such a fall"
    )
    turning: Turning | None = parameter(
        None, text="timing of a somersault by its rotation in flight; none: by the clock"
    )


class PlanProgress(Signal):
    """The state of ``JumpPlan``."""

    late = Field(unit="s", text="delay of the plan's reading time behind the clock")
    before = Field(unit="s", text="``late`` when the last part of the thrust began")
    spin = Field(unit="", text="rate of a somersault, as a share of the plan's rate")


class ProgressConstants(Signal):
    """Constants derived from the parameters, the plan and the wires."""

    lead = Field(unit="s", text="delay from sensing to torque; negative: the one at ``delay``")
    follows_motion = Field(dtype="bool", text="thrusts and falls end when the robot's do")
    follows_turn = Field(dtype="bool", text="the plan is a somersault that is retimed")
    gain = Field(unit="1/s", text="``Turning.gain``")
    early = Field(unit="s", text="``Turning.early``")
    late = Field(unit="s", text="``Turning.late``")
    aim = Field(unit="rad", text="``Turning.aim``")
    period = Field(unit="s", text="of the block")
    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")


@kernel
def follow_plan(
    now: float,
    terms: DynamicsTerms,
    delay: DelayEstimate,
    reference: JumpReference,
    progress: PlanProgress,
    table: TableRows,
    rotation: FlightRotation,
    params: ProgressParameters,
    constants: ProgressConstants,
) -> None:
    """Read the plan at the time ``now`` [s] of the run, and keep it in time with the robot."""
    time = read_plan(now, delay, reference, progress, table, constants)
    keep_in_time(time, terms, reference, progress, rotation, params, constants)


@kernel
def read_plan(
    now: float,
    delay: DelayEstimate,
    reference: JumpReference,
    progress: PlanProgress,
    table: TableRows,
    constants: ProgressConstants,
) -> float:
    """Read the plan at the time ``now`` [s] of the run; returns its time."""
    time, lead = plan_time(now, delay, progress, constants)
    read_table(table, time, lead, constants.period, reference)
    return time


@kernel
def plan_time(
    now: float, delay: DelayEstimate, progress: PlanProgress, constants: ProgressConstants
) -> tuple[float, float]:
    """Return the plan's time at the time ``now`` of the run, and the delay that is left to compensate [s]."""
    lead = delay.delay if constants.lead < 0.0 else constants.lead
    early = min(delay.ahead, lead)
    return now - progress.late + early, lead - early


@kernel
def keep_in_time(
    time: float,
    terms: DynamicsTerms,
    reference: JumpReference,
    progress: PlanProgress,
    rotation: FlightRotation,
    params: ProgressParameters,
    constants: ProgressConstants,
) -> None:
    """Hasten or delay the plan, which is ``reference`` at ``time`` [s], as the robot is ahead of it or behind."""
    if constants.follows_motion:
        follow_thrust(time, terms, reference, progress, params, constants)
        follow_fall(time, terms, reference, progress, params, constants)
    if constants.follows_turn:
        follow_turn(time, terms, reference, rotation, progress, constants)


@kernel
def speed_error(height: float, speed: float, planned_height: float, planned_speed: float) -> float:
    """Return the excess of the robot's speed [m/s] over that of the planned apex; negative if it is too slow.

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
    """Return the change [s] of a plan's delay in one period, so that the thrust ends at the planned apex.

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


@kernel
def follow_thrust(
    time: float,
    terms: DynamicsTerms,
    reference: JumpReference,
    progress: PlanProgress,
    params: ProgressParameters,
    constants: ProgressConstants,
) -> None:
    """Delay or hasten the end of a thrust by the speed and height of the centre of mass.

    ``reference`` is the plan at ``time`` [s].
    """
    left = reference.lift_off_time - time
    if reference.phase != Phase.THRUST or not 0.0 < left <= params.progress_time:
        progress.before = progress.late
        return
    error = speed_error(
        terms.com[2] - mean_height(terms.foot_position, reference, constants),
        terms.com_velocity[2],
        reference.com[2] - mean_height(reference.foot_position, reference, constants),
        reference.com_velocity[2],
    )
    push, before = reference.com_acceleration[2], progress.before
    late, limit = progress.late - before, params.progress_limit
    late += delay_change(error, push, params.progress_gain, FASTEST, constants.period)
    progress.late = before + min(max(late, -limit), limit)


@kernel
def follow_fall(
    time: float,
    terms: DynamicsTerms,
    reference: JumpReference,
    progress: PlanProgress,
    params: ProgressParameters,
    constants: ProgressConstants,
) -> None:
    """Hasten or delay a flight whose toes land first, so that it ends when the fall does.

    ``reference`` is the plan at ``time`` [s].
    """
    if reference.phase != Phase.FLIGHT or not reference.toes_first:
        return
    left = reference.touchdown_time - time
    sinking = GRAVITY * left - reference.com_velocity[2]
    lowest = reference.com[2] - 0.5 * (sinking - reference.com_velocity[2]) * left
    fall = time_to_fall(terms.com[2] - lowest, terms.com_velocity[2])
    rate = params.toes_gain * (fall - left)
    rate = min(max(rate, -FASTEST), FASTEST)
    progress.late += rate * constants.period


@kernel
def time_to_fall(height: float, speed: float) -> float:
    """Return the time [s] in which a body that is thrown up at ``speed`` [m/s] falls by ``height`` [m]."""
    square = speed * speed + 2.0 * GRAVITY * max(height, 0.0)
    return (speed + math.sqrt(square)) / GRAVITY


@kernel
def mean_height(position: Array2D, reference: JumpReference, constants: ProgressConstants) -> float:
    """Return the mean height [m] of positions of feet (n, 3), of those that carry load in the plan; of all where none
    does."""
    total, count = 0.0, 0
    for foot in range(position.shape[0]):
        if has_contact(reference.contact, constants.foot_of_point, foot):
            total += position[foot, 2]
            count += 1
    if count:
        return total / count
    for foot in range(position.shape[0]):
        total += position[foot, 2]
    return total / len(position)


@kernel
def follow_turn(
    time: float,
    terms: DynamicsTerms,
    reference: JumpReference,
    rotation: FlightRotation,
    progress: PlanProgress,
    constants: ProgressConstants,
) -> None:
    """Hasten or slow down the plan in flight, by how far the robot has turned and how long it will fly.

    Let the plan be read at tau, with w(tau) its rate of rotation with the joints held, G(tau) the
    rest of this rotation until touchdown, and w_td its last rate. Let the robot turn c w where the
    plan turns w, and have turned further than the plan by s. Angular momentum is conserved, so::

        s' = w (c - tau'),     at touchdown:  s_td = s + (c - 1) G - w_td d

    where d is the shift that the plan still needs, with its legs out, to land when the robot
    falls onto its feet. A shift in the tuck instead changes s_td by w_td - w for every second of it::

        tau' = 1 + gain (s_td - aim) / (w - w_td)

    From when the legs are tucked until they are out, as far as d stays between -``early`` and ``late``.
    Then tau' is what makes d zero shortly before touchdown.

    ``reference`` is the plan at ``time`` [s], ``rotation`` that of its flight.
    """
    if reference.phase != Phase.FLIGHT or time < rotation.time[0] + SETTLED:
        progress.spin = 1.0
        return
    planned = reference.touchdown_time - time
    falls = time_to_height(
        terms.com[2], terms.com_velocity[2],
        planned_touchdown_height(reference.com[2], reference.com_velocity[2], planned),
    )  # fmt: skip
    tucked, out = rotation.marks[0], rotation.marks[1]
    if falls < CLOSING or time < tucked:
        return
    shift, period = planned - falls, constants.period
    if time >= out:
        change = shift / max(falls - CLOSING, period)
        progress.late -= min(max(change, -OPEN_SHIFT), OPEN_SHIFT) * period
        return
    rate = value_at(rotation.time, rotation.rate, time)
    left = value_at(rotation.time, rotation.left, time)
    lands = rotation.rate[rotation.rate.shape[0] - 1]
    sign = rotation.marks[3]
    if rate >= FULL * rotation.marks[2]:
        inertia = terms.centroidal_matrix[3 + PITCH, 3 + PITCH]
        spin = sign * terms.angular_momentum[PITCH] / (inertia * rate)
        spin = min(max(spin, 1.0 - SPIN_RANGE), 1.0 + SPIN_RANGE)
        progress.spin += (spin - progress.spin) * period / SPIN_TIME
    surplus = sign * turned_beyond(terms.base_rotation, reference.orientation)
    surplus += (progress.spin - 1.0) * left - lands * shift - constants.aim
    if rate == lands:  # the plan turns as fast as with its legs out: a shift would change nothing
        return
    change = constants.gain * surplus / (rate - lands)
    change = min(max(change, -TUCKED_SHIFT), TUCKED_SHIFT) * period
    progress.late -= min(max(change, shift - constants.late), shift + constants.early)


@kernel
def value_at(times: Array1D, values: Array1D, time: float) -> float:
    """Return the value at a time in a table that is linear between its rows; (n,) each."""
    low, share = locate(times, time)
    return float(values[low] + share * (values[low + 1] - values[low]))


@kernel
def turned_beyond(rotation: Matrix3, orientation: Array1D) -> float:
    """Return the angle [rad] by which a body of this ``rotation`` has turned further about its y axis than one of the
    planned ``orientation``, a quaternion x, y, z, w."""
    planned = pitch_angle(orientation)
    measured = atan2(-rotation[2, 0], rotation[0, 0])
    return wrap(measured - planned)
