"""The targets of the whole-body controller: the plan, and after it balance over the feet."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from ...mathematics.arrays import Array1D, Flags1D, Vector3
from ...mathematics.elementary import atan2, sincos
from ...mathematics.interpolation import lengthen, minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.rotations import (
    conjugate,
    exponential,
    from_matrix,
    logarithm,
    mean_heading,
    multiply,
    pattern_turn,
    turn_about_vertical,
    wrap,
    yaw,
)
from ...mathematics.stance_feet import find_stance_feet, mean_position
from ...robots.limb import FootKind, foot_shape
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, ThreeNumbers, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, Phase, PhaseState, WholeBodyTarget


class BalanceMemory(Signal):
    """The state of ``BalanceTarget``."""

    standing_height = Field(unit="m", text="planned height of the centre of mass in the first tick")
    started = Field(dtype="bool", text="that height is known")
    trim = Field(3, unit="rad", frame="body", text="rotation added to the level target")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    heading = Field(unit="rad", frame="world", text="heading of the plan's x axis")
    off_place = Field(3, unit="m", frame="world", text="the feet's offset from their planned place")


class HeadingSource(IntEnum):
    """The source of the robot's heading."""

    FEET = 0
    """The feet's own directions."""
    PATTERN = 1
    """The pattern in which the feet stand."""
    BASE = 2
    """The base."""


class BalanceConstants(Signal):
    """Constants of the robot's description."""

    heading_source = Field(dtype="int64", values=HeadingSource, text="source of the heading")
    counted = Field("n_feet", dtype="bool", text="each foot counts in the heading")
    nominal_mass = Field(unit="kg", text="mass by the description")
    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")


class BalanceScratch(Signal):
    """Scratch memory of one step of ``BalanceTarget``."""

    turn = Field(4, text="quaternion of a heading")
    quaternion = Field(4, text="a quaternion")
    vector = Field(3, text="a vector")
    stands = Field("n_feet", dtype="bool", text="the feet that the plan is taken relative to")
    counted = Field("n_feet", dtype="bool", text="those of them that have a heading")
    pattern = Field(("n_feet", 3), unit="m", frame="world", text="their planned places")
    middle = Field(3, unit="m", frame="world", text="mean of the feet's places")
    planned_middle = Field(3, unit="m", frame="world", text="mean of their planned places")


class BalanceParameters(Parameters):
    """The parameters of ``BalanceTarget``."""

    landing_depth: float = live_parameter(
        0.06, unit="m", ge=0.0, le=0.5, text="depth below standing held after touchdown"
    )
    rise_time: float = live_parameter(
        0.6, unit="s", gt=0.0, text="time to rise from there to standing height"
    )
    trim_rate: float = live_parameter(
        3.0, unit="1/s", ge=0.0, le=20.0, text="integral gain on a steady tilt"
    )
    trim_limit: float = live_parameter(
        0.08, unit="rad", ge=0.0, le=0.5, text="largest trim about each axis"
    )
    velocity_correction: ThreeNumbers = live_parameter(
        (0.0, 0.0, 0.0),
        unit="m/s",
        text="added to the planned velocity of the centre of mass at lift-off, in the plan's axes",
    )
    momentum_correction: ThreeNumbers = live_parameter(
        (0.0, 0.0, 0.0),
        unit="N m s",
        text="added to the planned angular momentum at lift-off, in the plan's axes",
    )

    place_gain: float = live_parameter(
        0.0,
        ge=0.0,
        le=1.0,
        text="share of the feet's position error that the next jump corrects",
    )
    place_limit: float = live_parameter(
        0.03, unit="m", ge=0.0, le=0.2, text="largest change of a jump's length"
    )
    place_time: float = live_parameter(
        0.2, unit="s", gt=0.0, le=1.0, text="time from its begin to lift-off"
    )


class BalanceTarget(Block):
    """Follows the plan until its last touchdown, then balances over the middle of the feet.

    It serves any number of feet. Their middle is the mean of the sole centres, and their heading
    is the mean of the headings of the line and flat feet. Point feet have no heading of their own:
    that of several point feet is the rotation, by least squares, of the pattern in which they stand
    from the planned pattern; that of a single one is the heading of the base. Before lift-off the feet are
    those that carry load in the plan.

    Before the last touchdown the target's positions and heading are the plan's, shifted and rotated
    with the measured feet. The plan is relative to the feet, so a drift of the estimated position
    or heading does not matter. Its angular momentum and the rate of that are scaled with the mass
    of the model at ``terms``.

    So the error of each landing would add to the next one, unless ``place_gain`` feeds the position
    back. In the last T_p = ``place_time`` before a lift-off it changes the length of the jump. Let
    e be the estimated position of the feet's middle minus the planned one, and T_f the planned
    flight time. Then

        d = -place_gain e, of a length of at most place_limit
        v(t) = v_d s(u),   s = 10 u^3 - 15 u^4 + 6 u^5,   u = 1 - (t_lo - t) / T_p,
        v_d = d / (T_f + T_p / 2)

    v is added to the velocity of the centre of mass, its integral to the position and its
    derivative to the acceleration: at touchdown they have moved it by d. The plan's place in the
    world is set in the first tick. An error of the feet's heading is not corrected.

    After the last touchdown the centre of mass goes over the middle of the sole centres, at
    ``landing_depth`` below standing height. When the phase is RECOVER it rises to standing height
    with minimum jerk within ``rise_time``. The base goes level, with the heading of the feet. Joint
    friction leaves a small steady tilt, which the integral ``trim`` removes,

        trim' = trim_rate Log(R' R_level), within trim_limit,    R_target = R_level Exp(trim),

    about the body's x and y axes. The targets of angular momentum and its rate are zero.

    A robot that differs from its model misses the plan at lift-off in much the same way in every
    jump of a task. ``velocity_correction`` dv and ``momentum_correction`` dk compensate the known
    part of that error: with u, from 0 to 1, the share of a thrust of duration T that is over, the
    plan becomes

        v + u^2 dv,   a + 2 u dv / T,   p + T u^3 dv / 3,   k + u^2 dk,   k' + 2 u dk / T.

    The block does not plan steps: the feet stay where they are.
    """

    needs = ("floating base", "feet")
    Params = BalanceParameters
    Constants = BalanceConstants
    Scratch = BalanceScratch
    params: BalanceParameters
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase the robot is in")
    terms = Input(DynamicsTerms, text="the present state")
    target = Output(WholeBodyTarget, text="present target")
    memory = State(BalanceMemory, text="standing height and trim")

    def setup(self) -> None:
        robot = self.robot
        feet = range(len(robot.feet))
        heads = np.array([foot_shape(robot, foot)[0] != FootKind.POINT for foot in feet])
        source = HeadingSource.BASE if len(feet) == 1 else HeadingSource.PATTERN
        self.constants.heading_source = HeadingSource.FEET if heads.any() else source
        self.constants.counted[:] = heads if heads.any() else True
        self.constants.nominal_mass = robot.total_mass
        self.constants.foot_of_point[:] = robot.foot_of_contact()

    @kernel
    @staticmethod
    def step(
        reference: JumpReference,
        phase: PhaseState,
        terms: DynamicsTerms,
        target: WholeBodyTarget,
        memory: BalanceMemory,
        constants: BalanceConstants,
        scratch: BalanceScratch,
        params: BalanceParameters,
        period: float,
    ) -> None:
        count = choose_feet(reference, phase, constants, scratch)
        mean_position(terms.foot_position, scratch.stands, count, scratch.middle)
        mean_position(reference.foot_position, scratch.stands, count, scratch.planned_middle)
        planned = planned_heading(reference, scratch.counted)
        heading = measured_heading(reference, terms, planned, count, constants, scratch)
        if not memory.started or reference.time < 0.0:  # the plan has not begun
            memory.standing_height = reference.com[2]
            memory.heading = heading - planned
            turn_about_vertical(scratch.planned_middle, memory.heading, scratch.vector)
            memory.origin[:] = scratch.middle - scratch.vector
            memory.started = True
        goes_on = reference.lift_off_time > reference.time
        if phase.phase < Phase.LANDING or (phase.phase == Phase.LANDING and goes_on):
            turn = heading - planned
            follow_reference(reference, terms, turn, target, constants, scratch)
            if params.place_gain > 0.0:
                correct_position(reference, memory, target, scratch, params)
            if phase.phase == Phase.THRUST:
                correct_lift_off(reference, phase, turn, target, scratch, params, period)
        else:
            balance(phase, terms, heading, memory, target, scratch, params, period)
        target.joint_position[:] = reference.joint_position
        target.joint_velocity[:] = reference.joint_velocity
        target.joint_acceleration[:] = reference.joint_acceleration


@kernel
def choose_feet(
    reference: JumpReference,
    phase: PhaseState,
    constants: BalanceConstants,
    scratch: BalanceScratch,
) -> int:
    """Find the feet that the plan is taken relative to, and those whose heading counts; returns how many the former are.

    Before lift-off they are those that carry load in the plan, later all of them.
    """
    count: int = scratch.stands.shape[0]
    scratch.stands[:] = True
    if phase.phase < Phase.FLIGHT:
        count = find_stance_feet(reference.contact, constants.foot_of_point, scratch.stands)
    headed = 0
    for foot in range(scratch.stands.shape[0]):
        scratch.counted[foot] = constants.counted[foot] and scratch.stands[foot]
        headed += 1 if scratch.counted[foot] else 0
    if headed == 0:
        scratch.counted[:] = constants.counted
    return count


@kernel
def planned_heading(reference: JumpReference, counted: Flags1D) -> float:
    """Return the mean of the planned headings [rad] of the feet that count."""
    count, planned = 0, 0.0
    for foot in range(counted.shape[0]):
        count += 1 if counted[foot] else 0
    for foot in range(counted.shape[0]):
        if counted[foot]:
            planned += reference.foot_yaw[foot] / count
    return planned


@kernel
def measured_heading(
    reference: JumpReference,
    terms: DynamicsTerms,
    planned: float,
    count: int,
    constants: BalanceConstants,
    scratch: BalanceScratch,
) -> float:
    """Measure the feet's heading [rad], by their own directions or by the pattern they stand in. The pattern of a
    single one has none: then it is the angle by which the base is turned from the plan."""
    if constants.heading_source == HeadingSource.FEET:
        return mean_heading(terms.foot_rotation, scratch.counted)
    if constants.heading_source == HeadingSource.BASE:
        return atan2(terms.base_rotation[1, 0], terms.base_rotation[0, 0])
    if count == 1:
        base = atan2(terms.base_rotation[1, 0], terms.base_rotation[0, 0])
        return planned + wrap(base - yaw(reference.orientation))
    for foot in range(scratch.stands.shape[0]):  # a foot in the middle has no say
        scratch.pattern[foot, :] = scratch.planned_middle
        if scratch.stands[foot]:
            scratch.pattern[foot, :] = reference.foot_position[foot]
    return planned + pattern_turn(
        scratch.pattern, scratch.planned_middle, terms.foot_position, scratch.middle
    )


@kernel
def set_heading(angle: float, quaternion: Array1D) -> None:
    """Set the unit quaternion of a rotation about the vertical by ``angle`` [rad]."""
    quaternion[0], quaternion[1] = 0.0, 0.0
    quaternion[2], quaternion[3] = sincos(0.5 * angle)


@kernel
def follow_reference(
    reference: JumpReference,
    terms: DynamicsTerms,
    turn: float,
    target: WholeBodyTarget,
    constants: BalanceConstants,
    scratch: BalanceScratch,
) -> None:
    """Write the plan relative to the measured feet; ``turn`` is the angle of its rotation [rad].

    The plan's momenta are those of the description's mass.
    """
    scratch.vector[:] = reference.com - scratch.planned_middle
    turn_about_vertical(scratch.vector, turn, target.com)
    target.com[:] = target.com + scratch.middle
    turn_about_vertical(reference.com_velocity, turn, target.com_velocity)
    turn_about_vertical(reference.com_acceleration, turn, target.com_acceleration)
    turn_about_vertical(reference.angular_momentum, turn, target.angular_momentum)
    turn_about_vertical(reference.angular_momentum_rate, turn, target.angular_momentum_rate)
    mass = terms.mass_matrix[0, 0]
    if mass == 0.0:
        mass = constants.nominal_mass
    heavier = mass / constants.nominal_mass
    target.angular_momentum[:] = target.angular_momentum * heavier
    target.angular_momentum_rate[:] = target.angular_momentum_rate * heavier
    target.angular_velocity[:] = reference.angular_velocity
    target.angular_acceleration[:] = reference.angular_acceleration
    set_heading(turn, scratch.turn)
    multiply(scratch.turn, reference.orientation, target.orientation)


@kernel
def correct_position(
    reference: JumpReference,
    memory: BalanceMemory,
    target: WholeBodyTarget,
    scratch: BalanceScratch,
    params: BalanceParameters,
) -> None:
    """Change the length of the next jump to correct the feet's position error."""
    lift_off, duration = reference.lift_off_time, params.place_time
    flight = reference.touchdown_time - lift_off
    share = 1.0 - (lift_off - reference.time) / duration
    if share <= 0.0:
        turn_about_vertical(scratch.planned_middle, memory.heading, scratch.vector)
        scratch.vector[:] = memory.origin + scratch.vector
        memory.off_place[:] = scratch.middle - scratch.vector
        return
    lengthen(
        memory.off_place, params.place_gain, params.place_limit, flight,
        duration, share, target.com, target.com_velocity, target.com_acceleration,
    )  # fmt: skip


@kernel
def correct_lift_off(
    reference: JumpReference,
    phase: PhaseState,
    turn: float,
    target: WholeBodyTarget,
    scratch: BalanceScratch,
    params: BalanceParameters,
    period: float,
) -> None:
    """Add the known corrections of velocity and momentum during the thrust."""
    largest = 0.0
    for k in range(3):
        velocity, momentum = params.velocity_correction[k], params.momentum_correction[k]
        largest = max(largest, abs(velocity), abs(momentum))
    if largest == 0.0:
        return
    elapsed = phase.time_in_phase
    left = reference.lift_off_time - reference.time
    duration = max(elapsed + left, period)
    share = min(elapsed / duration, 1.0)
    vector = scratch.vector
    turn_about_vertical(params.momentum_correction, turn, vector)
    add_quadratic_growth(
        vector, share, duration, target.angular_momentum, target.angular_momentum_rate
    )
    turn_about_vertical(params.velocity_correction, turn, vector)
    add_quadratic_growth(vector, share, duration, target.com_velocity, target.com_acceleration)
    target.com[:] = target.com + vector * (duration * share * share * share / 3.0)


@kernel
def balance(
    phase: PhaseState,
    terms: DynamicsTerms,
    heading: float,
    memory: BalanceMemory,
    target: WholeBodyTarget,
    scratch: BalanceScratch,
    params: BalanceParameters,
    period: float,
) -> None:
    """Aim at the middle of the feet and a level base, and rise when the phase is RECOVER."""
    depth, duration = params.landing_depth, params.rise_time
    share, rate, second = 0.0, 0.0, 0.0
    if phase.phase == Phase.RECOVER:
        share, rate, second = minimum_jerk(phase.time_in_phase / duration)
    for k in range(3):
        target.com[k] = scratch.middle[k]
        target.com_velocity[k], target.com_acceleration[k] = 0.0, 0.0
        target.angular_velocity[k], target.angular_momentum[k] = 0.0, 0.0
        target.angular_momentum_rate[k], target.angular_acceleration[k] = 0.0, 0.0
    low = memory.standing_height - depth
    target.com[2] = target.com[2] + (low + share * depth)
    target.com_velocity[2] = rate * depth / duration
    target.com_acceleration[2] = second * depth / (duration * duration)
    set_heading(heading, scratch.turn)
    quaternion, trim = scratch.quaternion, memory.trim
    from_matrix(terms.base_rotation, quaternion)
    conjugate(quaternion, quaternion)
    multiply(quaternion, scratch.turn, quaternion)
    logarithm(quaternion, scratch.vector)
    gain = params.trim_rate * period
    integrate_trim(scratch.vector, gain, params.trim_limit, trim)
    exponential(trim, quaternion)
    multiply(scratch.turn, quaternion, target.orientation)


@kernel
def add_quadratic_growth(
    goal: Vector3, share: float, duration: float, value: Vector3, rate: Vector3
) -> None:
    """Add to ``value`` (3,) a term that grows with the square of time to ``goal`` (3,).

    Args:
        share: the share of ``duration`` [s] that is over, 0 to 1.
        value, rate: a quantity and its time derivative; share^2 goal is added to the one, and the
            derivative of that to the other.
    """
    value[:] = value + share * share * goal
    rate[:] = rate + 2.0 * share / duration * goal


@kernel
def integrate_trim(error: Array1D, gain: float, limit: float, trim: Array1D) -> None:
    """One step of the integral of the tilt about x and y, within the limit; z stays zero."""
    for k in range(2):
        trim[k] = min(max(trim[k] + gain * error[k], -limit), limit)
    trim[2] = 0.0
