"""What ``BalanceTarget`` does in every tick, as kernels: following the plan, and balancing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array,
    Array0D,
    Array1D,
    Array2D,
    Array3D,
    Flags0D,
    Flags1D,
    Indices0D,
    Matrix3,
    Rows3,
    Vector3,
)
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.rotations import (
    conjugate,
    exponential,
    from_matrix,
    logarithm,
    mean_heading,
    multiply,
)
from ..signals import Phase

BY_FEET, BY_PATTERN, BY_BASE = 0, 1, 2
"""What tells the heading: the feet's own directions, the pattern in which they stand, the base."""

_THRUST, _LANDING, _RECOVER = int(Phase.THRUST), int(Phase.LANDING), int(Phase.RECOVER)


class Plan(NamedTuple):
    """The fields of ``JumpReference`` that are followed."""

    time: Array0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    com: Vector3
    com_velocity: Vector3
    com_acceleration: Vector3
    angular_momentum: Vector3
    angular_momentum_rate: Vector3
    orientation: Array1D
    angular_velocity: Vector3
    foot_position: Rows3
    foot_yaw: Array1D
    joint_position: Array1D
    joint_velocity: Array1D
    joint_acceleration: Array1D


class Present(NamedTuple):
    """The fields of ``PhaseState`` and ``DynamicsTerms`` that say how the robot stands."""

    phase: Indices0D
    time_in_phase: Array0D
    foot_position: Rows3
    foot_rotation: Array3D
    base_rotation: Matrix3
    mass_matrix: Array2D


class Aim(NamedTuple):
    """The fields of ``WholeBodyTarget``."""

    com: Vector3
    com_velocity: Vector3
    com_acceleration: Vector3
    angular_momentum: Vector3
    angular_momentum_rate: Vector3
    orientation: Array1D
    angular_velocity: Vector3
    joint_position: Array1D
    joint_velocity: Array1D
    joint_acceleration: Array1D


class Memory(NamedTuple):
    """The fields of ``BalanceMemory``."""

    standing_height: Array0D
    started: Flags0D
    trim: Vector3
    origin: Vector3
    heading: Array0D
    off_place: Vector3


class Gains(NamedTuple):
    """Parameters that may change during a run, each an array of one element but for ``corrections``
    (2, 3), of velocity [m/s] and angular momentum [N m s]."""

    landing_depth: Array1D
    rise_time: Array1D
    trim_rate: Array1D
    trim_limit: Array1D
    place_gain: Array1D
    place_limit: Array1D
    place_time: Array1D
    corrections: Rows3


class Stand(NamedTuple):
    """Of the robot and its clock: what tells the heading, which feet count in it (n_feet,), the mass of
    the description [kg], and the period [s]."""

    kind: int
    counted: Flags1D
    mass: float
    period: float


class Scratch(NamedTuple):
    """``turn`` and ``quaternion`` (4,); ``vector``, the ``middle`` of the feet and their planned one (3,)."""

    turn: Array1D
    quaternion: Array1D
    vector: Vector3
    middle: Array1D
    planned_middle: Vector3


@kernel
def aim(
    plan: Plan, present: Present, stand: Stand, gains: Gains, memory: Memory, out: Aim,
    scratch: Scratch,
) -> None:  # fmt: skip
    """One tick of ``BalanceTarget``."""
    phase = present.phase[()]
    middle_point(present.foot_position, scratch.middle)
    middle_point(plan.foot_position, scratch.planned_middle)
    planned = planned_heading(plan.foot_yaw, stand.counted)
    heading = measured_heading(plan, present, stand, planned, scratch)
    if not memory.started[()]:
        memory.standing_height[()] = plan.com[2]
        memory.heading[()] = heading - planned
        turn_about_vertical(scratch.planned_middle, memory.heading[()], scratch.vector)
        np.subtract(scratch.middle, scratch.vector, memory.origin)
        memory.started[()] = True
    goes_on = plan.lift_off_time[()] > plan.time[()]
    if phase < _LANDING or (phase == _LANDING and goes_on):
        turn = heading - planned
        follow(plan, present, stand, turn, out, scratch)
        if gains.place_gain[0] > 0.0:
            correct_place(plan, gains, memory, out, scratch)
        if phase == _THRUST:
            correct_lift_off(plan, present, stand, turn, gains, out, scratch.vector)
    else:
        balance(present, stand, heading, gains, memory, out, scratch)
    for joint in range(plan.joint_position.shape[0]):
        out.joint_position[joint] = plan.joint_position[joint]
        out.joint_velocity[joint] = plan.joint_velocity[joint]
        out.joint_acceleration[joint] = plan.joint_acceleration[joint]


@kernel
def planned_heading(foot_yaw: Array1D, counted: Flags1D) -> float:
    """The mean of the planned headings [rad] of the feet that count."""
    count, planned = 0, 0.0
    for foot in range(counted.shape[0]):
        count += 1 if counted[foot] else 0
    for foot in range(counted.shape[0]):
        if counted[foot]:
            planned += foot_yaw[foot] / count
    return planned


@kernel
def measured_heading(
    plan: Plan, present: Present, stand: Stand, planned: float, scratch: Scratch
) -> float:
    """The feet's heading [rad], by their own directions or by the pattern they stand in."""
    if stand.kind == BY_FEET:
        return mean_heading(present.foot_rotation, stand.counted)
    if stand.kind == BY_BASE:
        rotation = present.base_rotation
        return math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
    return planned + pattern_turn(
        plan.foot_position, scratch.planned_middle, present.foot_position, scratch.middle
    )


@kernel
def set_heading(angle: float, quaternion: Array1D) -> None:
    """The unit quaternion of a rotation about the vertical by ``angle`` [rad]."""
    quaternion[0], quaternion[1] = 0.0, 0.0
    quaternion[2], quaternion[3] = math.sin(0.5 * angle), math.cos(0.5 * angle)


@kernel
def follow(
    plan: Plan, present: Present, stand: Stand, turn: float, out: Aim, scratch: Scratch
) -> None:
    """Write the plan relative to the measured feet; ``turn`` is the angle of its rotation [rad].

    The plan's momenta are those of the description's mass.
    """
    np.subtract(plan.com, scratch.planned_middle, scratch.vector)
    turn_about_vertical(scratch.vector, turn, out.com)
    np.add(out.com, scratch.middle, out.com)
    turn_about_vertical(plan.com_velocity, turn, out.com_velocity)
    turn_about_vertical(plan.com_acceleration, turn, out.com_acceleration)
    turn_about_vertical(plan.angular_momentum, turn, out.angular_momentum)
    turn_about_vertical(plan.angular_momentum_rate, turn, out.angular_momentum_rate)
    mass = present.mass_matrix[0, 0]
    heavier = (mass if mass != 0.0 else stand.mass) / stand.mass
    out.angular_momentum[:] = out.angular_momentum * heavier
    out.angular_momentum_rate[:] = out.angular_momentum_rate * heavier
    out.angular_velocity[:] = plan.angular_velocity
    set_heading(turn, scratch.turn)
    multiply(scratch.turn, plan.orientation, out.orientation)


@kernel
def correct_place(plan: Plan, gains: Gains, memory: Memory, out: Aim, scratch: Scratch) -> None:
    """Change the length of the next jump to correct the feet's position error."""
    lift_off, duration = plan.lift_off_time[()], gains.place_time[0]
    flight = plan.touchdown_time[()] - lift_off
    share = 1.0 - (lift_off - plan.time[()]) / duration
    if share <= 0.0:
        turn_about_vertical(scratch.planned_middle, memory.heading[()], scratch.vector)
        np.add(memory.origin, scratch.vector, scratch.vector)
        np.subtract(scratch.middle, scratch.vector, memory.off_place)
        return
    lengthen(
        memory.off_place, gains.place_gain[0], gains.place_limit[0], flight,
        duration, share, out.com, out.com_velocity, out.com_acceleration,
    )  # fmt: skip


@kernel
def correct_lift_off(
    plan: Plan, present: Present, stand: Stand, turn: float, gains: Gains, out: Aim, vector: Vector3
) -> None:
    """Add the known corrections of velocity and momentum during the thrust."""
    largest = 0.0
    for i in range(2):
        for k in range(3):
            largest = max(largest, abs(gains.corrections[i, k]))
    if largest == 0.0:
        return
    elapsed = present.time_in_phase[()]
    left = plan.lift_off_time[()] - plan.time[()]
    duration = max(elapsed + left, stand.period)
    share = min(elapsed / duration, 1.0)
    turn_about_vertical(gains.corrections[1], turn, vector)
    add_quadratic_growth(vector, share, duration, out.angular_momentum, out.angular_momentum_rate)
    turn_about_vertical(gains.corrections[0], turn, vector)
    add_quadratic_growth(vector, share, duration, out.com_velocity, out.com_acceleration)
    out.com[:] = out.com + vector * (duration * share * share * share / 3.0)


@kernel
def balance(
    present: Present, stand: Stand, heading: float, gains: Gains, memory: Memory, out: Aim,
    scratch: Scratch,
) -> None:  # fmt: skip
    """Aim at the middle of the feet and a level base, and rise when the phase is RECOVER."""
    depth, duration = gains.landing_depth[0], gains.rise_time[0]
    share, rate, bend = 0.0, 0.0, 0.0
    if present.phase[()] == _RECOVER:
        share, rate, bend = minimum_jerk(present.time_in_phase[()] / duration)
    for k in range(3):
        out.com[k] = scratch.middle[k]
        out.com_velocity[k], out.com_acceleration[k] = 0.0, 0.0
        out.angular_velocity[k], out.angular_momentum[k] = 0.0, 0.0
        out.angular_momentum_rate[k] = 0.0
    low = memory.standing_height[()] - depth
    out.com[2] = out.com[2] + (low + share * depth)
    out.com_velocity[2] = rate * depth / duration
    out.com_acceleration[2] = bend * depth / (duration * duration)
    set_heading(heading, scratch.turn)
    quaternion, trim = scratch.quaternion, memory.trim
    from_matrix(present.base_rotation, quaternion)
    conjugate(quaternion, quaternion)
    multiply(quaternion, scratch.turn, quaternion)
    logarithm(quaternion, scratch.vector)
    gain = gains.trim_rate[0] * stand.period
    integrate_trim(scratch.vector, gain, gains.trim_limit[0], trim)
    exponential(trim, quaternion)
    multiply(scratch.turn, quaternion, out.orientation)


@kernel
def middle_point(points: Rows3, out: Vector3) -> None:
    """The mean of points (n, 3)."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        out[:] += points[i] / points.shape[0]


@kernel
def pattern_turn(
    planned: Array2D, planned_middle: Array1D, points: Array2D, middle: Array1D
) -> float:
    """The rotation [rad] of a pattern of points (n, 3) about the vertical, by least squares.

    Args:
        planned, planned_middle: the pattern before the rotation, and its middle (3,).
        points, middle: the same points now, and their middle.
    """
    sine = cosine = 0.0
    for i in range(planned.shape[0]):
        ax, ay = float(planned[i, 0] - planned_middle[0]), float(planned[i, 1] - planned_middle[1])
        bx, by = float(points[i, 0] - middle[0]), float(points[i, 1] - middle[1])
        sine += ax * by - ay * bx
        cosine += ax * bx + ay * by
    return math.atan2(sine, cosine)


@kernel
def turn_about_vertical(vector: Array1D, angle: float, out: Array1D) -> None:
    """Rotate a vector (3,) about the world's z axis by ``angle`` [rad]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = vector[0], vector[1]
    out[0], out[1], out[2] = cosine * x - sine * y, sine * x + cosine * y, vector[2]


@kernel
def lengthen(
    off_place: Array,
    gain: float,
    limit: float,
    flight: float,
    duration: float,
    share: float,
    place: Array,
    velocity: Array,
    acceleration: Array,
) -> None:
    """Add the correction of the feet's position error to a jump's motion; see ``BalanceTarget``.

    Args:
        off_place: the horizontal position error of the feet, (3,) [m].
        gain: the share of the error that is corrected.
        limit: the largest change of the jump's length [m].
        flight: the duration of the planned flight [s].
        duration, share: how long before lift-off the correction begins [s], and the share of that
            time which is over, 0 to 1.
        place, velocity, acceleration: of the centre of mass, (3,) each; they are changed.
    """
    u = min(max(share, 0.0), 1.0)
    grown, rate, _ = minimum_jerk(u)
    square = float(off_place[0]) ** 2 + float(off_place[1]) ** 2
    size = gain * math.sqrt(square)
    kept = 1.0 if size <= limit else limit / size
    for k in range(2):
        speed = -kept * gain * float(off_place[k]) / (flight + 0.5 * duration)
        place[k] += speed * duration * u * u * u * u * (2.5 + u * (u - 3.0))
        velocity[k] += speed * grown
        acceleration[k] += speed * rate / duration


@kernel
def add_quadratic_growth(
    goal: Array, share: float, duration: float, value: Array, rate: Array
) -> None:
    """Add to ``value`` (3,) a term that grows with the square of time to ``goal`` (3,).

    Args:
        share: the share of ``duration`` [s] that is over, 0 to 1.
        value, rate: a quantity and its time derivative; share^2 goal is added to the one, and the
            derivative of that to the other.
    """
    for k in range(3):
        value[k] += share * share * float(goal[k])
        rate[k] += 2.0 * share / duration * float(goal[k])


@kernel
def integrate_trim(error: Array1D, gain: float, limit: float, trim: Array1D) -> None:
    """One step of the integral of the tilt about x and y, within the limit; z stays zero."""
    for k in range(2):
        trim[k] = min(max(trim[k] + gain * error[k], -limit), limit)
    trim[2] = 0.0
