"""Moves the landing of a jump that is under way: its centre of mass by the thrust, its feet in flight."""

from __future__ import annotations

import math

from ....blocks.signals import DynamicsTerms, JumpReference
from ....mathematics.arrays import Array1D, Array2D
from ....mathematics.elementary import sincos
from ....mathematics.kernel import kernel
from ....mathematics.rotations import multiply, rotate_back
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal

AHEAD, ASIDE, UP, TURN = range(4)
"""The axes of a landing: in the jump's frame [m], and the feet's heading [rad]."""
RAISED = 0.7
"""Share of the flight at which the feet have gained their landing's extra height, so that they pass over the edge."""


class RetargetParameters(Parameters):
    """Limits to moving the landing of a jump under way."""

    retarget_time: float = parameter(
        0.1, unit="s", ge=0.02, le=1.0,
        text="time before lift-off until which the thrust may be changed to move a landing",
    )  # fmt: skip
    retarget_window: float = parameter(
        0.3, unit="s", gt=0.0, le=1.0, text="longest time before lift-off at which that begins"
    )
    retarget_acceleration: float = parameter(
        3.0, unit="m/s^2", ge=0.0, le=20.0,
        text="of the centre of mass for it, ahead, aside and vertically at most",
    )  # fmt: skip
    retarget_braking: float = parameter(
        1.0, unit="m/s^2", ge=0.0, le=20.0,
        text="the same backwards; at the end of a thrust there are only the toes to brake with",
    )  # fmt: skip
    retarget_spin: float = parameter(
        20.0, unit="rad/s^2", ge=0.0, le=200.0, text="of the body for it, about the vertical"
    )
    retarget_limit: float = parameter(
        0.05, unit="m", ge=0.0, le=0.3, text="largest shift of a landing ahead and aside"
    )
    retarget_height: float = parameter(
        0.03, unit="m", ge=0.0, le=0.2, text="largest change of its height"
    )
    retarget_turn: float = parameter(
        0.35, unit="rad", ge=0.0, le=1.5, text="largest change of its heading"
    )
    foothold_time: float = parameter(
        0.1, unit="s", ge=0.02, le=1.0,
        text="time before touchdown until which the footholds may be moved in flight",
    )  # fmt: skip
    foothold_limit: float = parameter(
        0.02, unit="m", ge=0.0, le=0.2,
        text="largest shift of the feet from where the centre of mass needs them, ahead and aside",
    )  # fmt: skip
    foothold_turn: float = parameter(
        0.15, unit="rad", ge=0.0, le=1.0, text="largest turn of the feet in flight"
    )


class MovedLanding(Signal):
    """Differences of the jump under way from its plan. Rows of four are ahead, aside, up [m] and turn [rad]."""

    moves = Field(
        dtype="int64", text="number of times its landing has been moved; zero: as planned"
    )
    landing = Field(4, text="shift of the feet's landing")
    thrown = Field(4, text="share of the shift that the thrust does")
    thrust_began = Field(4, unit="s", text="start of the thrust's change, in plan time")
    place = Field(4, text="of the body from its plan then")
    rate = Field(4, text="its rate")
    acceleration = Field(4, text="the rate of that")
    final_rate = Field(4, text="the rate with which the body lifts off")
    swing_began = Field(unit="s", text="start of the feet's change, in plan time")
    swing = Field(4, text="of the feet from their plan then")
    swing_rate = Field(4, text="its rate")


class MotionScratch(Signal):
    """Scratch memory for moving a plan."""

    quaternion = Field(4, unit="", text="a rotation about the vertical")
    axis = Field(3, unit="", text="the vertical")
    spin = Field(3, text="a rotation about the vertical, in the body's axes")
    middle = Field(3, unit="m", text="of the planned feet")
    middle_rate = Field(3, unit="m/s", text="its velocity")


@kernel
def thrust_motion(
    moved: MovedLanding, axis: int, lift_off: float, time: float
) -> tuple[float, float, float]:
    """Return the difference of a thrust from its plan on an axis at a plan time: place, rate and acceleration.

    From r_0 with the acceleration a_0 the rate goes to v at lift-off, after T_p, where the acceleration
    is the plan's again. With u the share of T_p that is over::

        a(u) = (1 - u) (a_0 (1 - 3 u) + 6 (v - r_0) u / T_p)
    """
    duration = lift_off - moved.thrust_began[axis]
    since = time - moved.thrust_began[axis]
    start, a, v = moved.rate[axis], moved.acceleration[axis] * duration, moved.final_rate[axis]
    u = min(max(since / duration, 0.0), 1.0)
    square = u * u
    rate = start + a * u * (1.0 - u * (2.0 - u)) + (v - start) * square * (3.0 - 2.0 * u)
    way = start * u + a * square * (0.5 - u * (2.0 / 3.0 - 0.25 * u))
    way += (v - start) * square * u * (1.0 - 0.5 * u)
    place = moved.place[axis] + duration * way + v * max(since - duration, 0.0)
    grown = (1.0 - u) * (a * (1.0 - 3.0 * u) + 6.0 * (v - start) * u) / duration
    return place, rate, grown


@kernel
def fastest_change(acceleration: float, limit: float, duration: float) -> float:
    """Return the largest rise of the rate of ``thrust_motion`` within its ``duration``, if a(u) <= ``limit`` from
    ``acceleration`` on.

    The largest a(u) of (1 - u) (a_0 + c u) is (c + a_0)^2 / (4 c), so c <= 2 A - a_0 + 2 sqrt(A^2 - A a_0).
    """
    square = max(limit * (limit - acceleration), 0.0)
    steepest = 2.0 * limit - acceleration + 2.0 * math.sqrt(square)
    return (steepest + 3.0 * acceleration) * duration / 6.0


@kernel
def add_velocity_change(
    moved: MovedLanding,
    axis: int,
    wanted: float,
    reference: JumpReference,
    params: RetargetParameters,
    most: float,
) -> None:
    """Let the thrust move the landing on an axis by as much of ``wanted`` as it can, and by at most ``most``, from the plan."""
    lift_off, touchdown = reference.lift_off_time, reference.touchdown_time
    now = max(reference.time, lift_off - params.retarget_window)
    place, rate, acceleration = 0.0, 0.0, 0.0
    if moved.moves > 0:
        place, rate, acceleration = thrust_motion(moved, axis, lift_off, now)
    duration, flight = lift_off - now, touchdown - lift_off
    limit = params.retarget_spin if axis == TURN else params.retarget_acceleration
    braking = params.retarget_braking if axis == AHEAD else limit
    fastest = rate + fastest_change(acceleration, limit, duration)
    slowest = rate - fastest_change(-acceleration, braking, duration)
    gained = flight + 0.5 * duration
    carried = place + duration * (0.5 * rate + acceleration * duration / 12.0)
    final = (min(max(wanted, -most), most) - carried) / gained
    final = min(max(final, slowest), fastest)
    moved.thrust_began[axis] = now
    moved.place[axis], moved.rate[axis] = place, rate
    moved.acceleration[axis], moved.final_rate[axis] = acceleration, final
    moved.thrown[axis] = carried + final * gained
    moved.landing[axis] = moved.thrown[axis]
    moved.swing_began = lift_off
    moved.swing[axis], moved.swing_rate[axis] = 0.0, 0.0


@kernel
def move_footholds(moved: MovedLanding, axis: int, wanted: float, most: float) -> None:
    """Let the feet land by as much of ``wanted`` from the plan as they can: within ``most`` of where they are thrown."""
    low, high = moved.thrown[axis] - most, moved.thrown[axis] + most
    moved.landing[axis] = min(max(wanted, low), high)


@kernel
def begin_swing(moved: MovedLanding, reference: JumpReference) -> None:
    """Keep where the feet are in flight, from where they will be moved elsewhere."""
    for axis in range(4):
        place, rate = 0.0, 0.0
        if moved.moves > 0:
            place, rate = swing_motion(moved, axis, reference, moved.swing_began)
        moved.swing[axis], moved.swing_rate[axis] = place, rate
    moved.swing_began = reference.time


@kernel
def swing_motion(
    moved: MovedLanding, axis: int, reference: JumpReference, began: float
) -> tuple[float, float]:
    """Return the difference of the feet from their plan on an axis: place and rate. They land at rest, as planned."""
    touchdown = reference.touchdown_time
    if axis == UP and moved.landing[UP] > 0.0:
        touchdown = began + RAISED * (touchdown - began)
    duration = touchdown - began
    if reference.time <= began or duration <= 0.0:
        return moved.swing[axis], moved.swing_rate[axis]
    u = min((reference.time - began) / duration, 1.0)
    start, way = moved.swing_rate[axis] * duration, moved.landing[axis] - moved.swing[axis]
    square, left = u * u, 1.0 - u
    grown = square * u * (10.0 - u * (15.0 - 6.0 * u))
    place = (
        moved.swing[axis] + way * grown + start * u * (1.0 - square * (6.0 - u * (8.0 - 3.0 * u)))
    )
    rate = 30.0 * way * square * left * left
    rate += start * (1.0 - square * (18.0 - u * (32.0 - 15.0 * u)))
    return place, rate / duration


@kernel
def move_landing(
    reference: JumpReference, terms: DynamicsTerms, moved: MovedLanding, scratch: MotionScratch
) -> None:
    """Move the plan at this instant: its body from the change of the thrust on, and its feet in flight."""
    lift_off, touchdown = reference.lift_off_time, reference.touchdown_time
    time = min(reference.time, touchdown)
    flies = reference.time <= touchdown
    for axis in range(3):
        place, rate, acceleration = thrust_motion(moved, axis, lift_off, time)
        reference.com[axis] += place
        if flies:
            reference.com_velocity[axis] += rate
            reference.com_acceleration[axis] += acceleration
    turn, rate, acceleration = thrust_motion(moved, TURN, lift_off, time)
    turn_body(
        turn, rate if flies else 0.0, acceleration if flies else 0.0, reference, terms, scratch
    )
    turn_feet(reference, moved, scratch)
    for axis in range(3):
        place, rate = swing_motion(moved, axis, reference, moved.swing_began)
        for foot in range(reference.foot_position.shape[0]):
            reference.foot_position[foot, axis] += place
            reference.foot_velocity[foot, axis] += rate


@kernel
def turn_body(
    turn: float,
    rate: float,
    acceleration: float,
    reference: JumpReference,
    terms: DynamicsTerms,
    scratch: MotionScratch,
) -> None:
    """Turn the planned body about the vertical. The momentum is that of the whole robot in its present pose."""
    inertia = 0.0
    for k in range(3):
        inertia += terms.centroidal_matrix[5, 3 + k] * terms.base_rotation[2, k]
    reference.angular_momentum[2] += inertia * rate
    reference.angular_momentum_rate[2] += inertia * acceleration
    turned, spin = scratch.quaternion, scratch.spin
    turned[0], turned[1] = 0.0, 0.0
    turned[2], turned[3] = sincos(0.5 * turn)
    multiply(turned, reference.orientation, reference.orientation)
    scratch.axis[0], scratch.axis[1], scratch.axis[2] = 0.0, 0.0, 1.0
    rotate_back(reference.orientation, scratch.axis, spin)
    reference.angular_velocity[:] += spin * rate
    reference.angular_acceleration[:] += spin * acceleration


@kernel
def turn_feet(reference: JumpReference, moved: MovedLanding, scratch: MotionScratch) -> None:
    """Turn the planned feet about their middle. The jump's direction stays."""
    turn, rate = swing_motion(moved, TURN, reference, moved.swing_began)
    sine, cosine = sincos(turn)
    middle_of(reference.foot_position, scratch.middle)
    middle_of(reference.foot_velocity, scratch.middle_rate)
    for foot in range(reference.foot_position.shape[0]):
        place, speed = reference.foot_position[foot], reference.foot_velocity[foot]
        x, y = place[0] - scratch.middle[0], place[1] - scratch.middle[1]
        u, v = speed[0] - scratch.middle_rate[0], speed[1] - scratch.middle_rate[1]
        ahead, aside = cosine * x - sine * y, sine * x + cosine * y
        place[0], place[1] = scratch.middle[0] + ahead, scratch.middle[1] + aside
        speed[0] = scratch.middle_rate[0] + cosine * u - sine * v - rate * aside
        speed[1] = scratch.middle_rate[1] + sine * u + cosine * v + rate * ahead
        reference.foot_yaw[foot] += turn


@kernel
def middle_of(points: Array2D, out: Array1D) -> None:
    """Compute the mean of points (n, 3)."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        out[:] += points[i] / points.shape[0]
