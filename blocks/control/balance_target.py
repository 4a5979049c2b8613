"""The targets of the whole-body controller: the plan, and after it balance over the feet."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...mathematics.polynomials import minimum_jerk
from ...mathematics.rotations import (
    conjugate,
    exponential,
    from_matrix,
    logarithm,
    mean_heading,
    multiply,
)
from ...robots.limb import FootKind, foot_shape
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, Phase, PhaseState, WholeBodyTarget

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


class BalanceMemory(Signal):
    """The state of ``BalanceTarget``."""

    standing_height = Field(unit="m", text="planned height of the centre of mass in the first tick")
    started = Field(dtype="bool", text="whether that height is known")
    trim = Field(3, unit="rad", frame="body", text="rotation added to the level target")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    heading = Field(unit="rad", frame="world", text="heading of the plan's x axis")
    off_place = Field(3, unit="m", frame="world", text="the feet's offset from their planned place")


class BalanceTarget(Block):
    """Follows the plan until its last touchdown, then balances over the middle of the feet.

    It serves any number of feet. Their middle is the mean of the sole centres, and their heading
    is the mean of the headings of the line and flat feet. Point feet have no heading of their own:
    that of several point feet is the rotation, by least squares, of the pattern in which they stand
    from the planned pattern; that of a single one is the heading of the base.

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

    class Params(Parameters):
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
        velocity_correction: Vector = live_parameter(
            (0.0, 0.0, 0.0),
            unit="m/s",
            text="added to the planned velocity of the centre of mass at lift-off, in the plan's axes",
        )
        momentum_correction: Vector = live_parameter(
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
            0.2, unit="s", gt=0.0, le=1.0, text="how long before lift-off it begins"
        )

    needs = ("floating base", "feet")
    params: Params
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase the robot is in")
    terms = Input(DynamicsTerms, text="the present state")
    target = Output(WholeBodyTarget, text="what to achieve now")
    memory = State(BalanceMemory, text="standing height and trim")

    def setup(self) -> None:
        self._quaternion = np.zeros(4)
        self._turn = np.zeros(4)
        self._vector = np.zeros(3)
        self._middle = np.zeros(3)
        self._planned_middle = np.zeros(3)
        robot = self.robot
        self._feet, self._mass = len(robot.feet), robot.total_mass
        kinds = [foot_shape(robot, foot)[0] for foot in range(self._feet)]
        self._heads = np.array([kind != FootKind.POINT for kind in kinds])
        self._counted = np.ones(self._feet, bool) if not self._heads.any() else self._heads
        self._count, self._base_counts = int(self._counted.sum()), np.ones(1, bool)
        self.on_parameters()

    def on_parameters(self) -> None:
        p = self.params
        self._corrections = np.array([p.velocity_correction, p.momentum_correction])
        self._corrects = bool(self._corrections.any())
        self._corrections.flags.writeable = False

    def step(self) -> None:
        phase, reference = int(self.phase.phase), self.reference
        middle_point(self.terms.foot_position, self._middle)
        heading = self._heading()
        if not self.memory.started:
            self._begin(heading)
        goes_on = float(reference.lift_off_time) > float(reference.time)
        if phase < Phase.LANDING or (phase == Phase.LANDING and goes_on):
            turn = self._follow(heading)
            if self._corrects and phase == Phase.THRUST:
                self._correct(turn)
        else:
            self._balance(phase, heading)
        self.target.joint_position[...] = reference.joint_position
        self.target.joint_velocity[...] = reference.joint_velocity
        self.target.joint_acceleration[...] = reference.joint_acceleration

    def _begin(self, heading: float) -> None:
        """Note the planned standing height, and the place of the plan in the world."""
        memory, reference = self.memory, self.reference
        memory.standing_height[()] = reference.com[2]
        memory.heading[()] = heading - self._planned_heading()
        middle_point(reference.foot_position, self._planned_middle)
        turn_about_vertical(self._planned_middle, float(memory.heading), self._vector)
        np.subtract(self._middle, self._vector, out=memory.origin)
        memory.started[()] = True

    def _heading(self) -> float:
        """The feet's heading [rad], by their own directions or by the pattern they stand in."""
        terms, reference = self.terms, self.reference
        if self._heads.any():
            return mean_heading(terms.foot_rotation, self._heads)
        if self._feet == 1:
            return mean_heading(terms.base_rotation[None], self._base_counts)
        middle_point(reference.foot_position, self._planned_middle)
        return self._planned_heading() + pattern_turn(
            reference.foot_position, self._planned_middle, terms.foot_position, self._middle
        )

    def _planned_heading(self) -> float:
        planned = 0.0
        for foot in range(self._feet):
            if self._counted[foot]:
                planned += float(self.reference.foot_yaw[foot]) / self._count
        return planned

    def _follow(self, heading: float) -> float:
        """Write the plan relative to the measured feet; returns the angle of its rotation [rad]."""
        reference, target = self.reference, self.target
        middle_point(reference.foot_position, self._planned_middle)
        turn = heading - self._planned_heading()
        for name in ("com", "com_velocity", "com_acceleration", "angular_momentum",
                     "angular_momentum_rate"):  # fmt: skip
            out = getattr(target, name)
            source = getattr(reference, name)
            if name == "com":
                np.subtract(source, self._planned_middle, out=self._vector)
                turn_about_vertical(self._vector, turn, out)
                np.add(out, self._middle, out=out)
            else:
                turn_about_vertical(source, turn, out)
        # The plan's momenta are those of the description's mass.
        heavier = (float(self.terms.mass_matrix[0, 0]) or self._mass) / self._mass
        target.angular_momentum *= heavier
        target.angular_momentum_rate *= heavier
        self._set_heading(turn)
        multiply(self._turn, reference.orientation, target.orientation)
        target.angular_velocity[...] = reference.angular_velocity
        if self.params.place_gain > 0.0:
            self._correct_place()
        return turn

    def _correct_place(self) -> None:
        """Change the length of the next jump to correct the feet's position error."""
        p, reference, target, memory = self.params, self.reference, self.target, self.memory
        lift_off = float(reference.lift_off_time)
        flight = float(reference.touchdown_time) - lift_off
        share = 1.0 - (lift_off - float(reference.time)) / p.place_time
        if share <= 0.0:
            turn_about_vertical(self._planned_middle, float(memory.heading), self._vector)
            np.add(memory.origin, self._vector, out=self._vector)
            np.subtract(self._middle, self._vector, out=memory.off_place)
            return
        lengthen(
            memory.off_place, p.place_gain, p.place_limit, flight, p.place_time, share,
            target.com, target.com_velocity, target.com_acceleration,
        )  # fmt: skip

    def _correct(self, turn: float) -> None:
        """Add the known corrections of velocity and momentum during the thrust."""
        target, elapsed = self.target, float(self.phase.time_in_phase)
        left = float(self.reference.lift_off_time) - float(self.reference.time)
        duration = max(elapsed + left, self.period)
        share = min(elapsed / duration, 1.0)
        turn_about_vertical(self._corrections[1], turn, self._vector)
        add_quadratic_growth(
            self._vector, share, duration, target.angular_momentum, target.angular_momentum_rate
        )
        turn_about_vertical(self._corrections[0], turn, self._vector)
        add_quadratic_growth(
            self._vector, share, duration, target.com_velocity, target.com_acceleration
        )
        np.multiply(self._vector, duration * share**3 / 3.0, out=self._vector)
        np.add(target.com, self._vector, out=target.com)

    def _balance(self, phase: int, heading: float) -> None:
        p, target, trim = self.params, self.target, self.memory.trim
        standing = float(self.memory.standing_height)
        share = rate = bend = 0.0
        if phase == Phase.RECOVER:
            share, rate, bend = minimum_jerk(float(self.phase.time_in_phase) / p.rise_time)
        low = standing - p.landing_depth
        target.com[...] = self._middle
        target.com[2] += low + share * p.landing_depth
        target.com_velocity[...] = 0.0
        target.com_velocity[2] = rate * p.landing_depth / p.rise_time
        target.com_acceleration[...] = 0.0
        target.com_acceleration[2] = bend * p.landing_depth / (p.rise_time * p.rise_time)
        target.angular_velocity[...] = 0.0
        target.angular_momentum[...] = 0.0
        target.angular_momentum_rate[...] = 0.0
        self._set_heading(heading)
        from_matrix(self.terms.base_rotation, self._quaternion)
        conjugate(self._quaternion, self._quaternion)
        multiply(self._quaternion, self._turn, self._quaternion)
        logarithm(self._quaternion, self._vector)
        integrate_trim(self._vector, p.trim_rate * self.period, p.trim_limit, trim)
        exponential(trim, self._quaternion)
        multiply(self._turn, self._quaternion, target.orientation)

    def _set_heading(self, angle: float) -> None:
        self._turn[0] = self._turn[1] = 0.0
        self._turn[2], self._turn[3] = math.sin(0.5 * angle), math.cos(0.5 * angle)


@kernel
def middle_point(points: Array, out: Array) -> None:
    """The mean of points (n, 3)."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        for k in range(3):
            out[k] += float(points[i, k]) / points.shape[0]


@kernel
def pattern_turn(planned: Array, planned_middle: Array, points: Array, middle: Array) -> float:
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
def turn_about_vertical(vector: Array, angle: float, out: Array) -> None:
    """Rotate a vector (3,) about the world's z axis by ``angle`` [rad]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = float(vector[0]), float(vector[1])
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
    size = gain * math.hypot(float(off_place[0]), float(off_place[1]))
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
def integrate_trim(error: Array, gain: float, limit: float, trim: Array) -> None:
    """One step of the integral of the tilt about x and y, within the limit; z stays zero."""
    for k in range(2):
        trim[k] = min(max(float(trim[k]) + gain * float(error[k]), -limit), limit)
    trim[2] = 0.0
