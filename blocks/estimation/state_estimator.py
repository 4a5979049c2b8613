"""Estimates the base's pose and velocity from the IMU, the joint encoders and the contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...mathematics.arrays import Array1D, Flags1D, Vector3
from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import (
    StandingPoints,
    correct_tilt_from_gravity,
    misalignment,
    rotate_in_world,
    turn_to_level,
    weigh_contacts,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, rotate_back, wrap
from ...runtime.language.block import State
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, ImuReading, JointState
from .inertial_estimator import (
    BaseEstimate,
    BiasSamples,
    InertialConstants,
    InertialEstimator,
    InertialParameters,
    InertialScratch,
    LegKinematics,
    correct_motion,
    count_standing,
    forget,
    forget_samples,
    is_unaccelerated,
    largest_of,
    learn_bias,
    limit,
    predict,
    publish,
    set_point_positions,
)

_SHORTEST_LINE = 0.06
_LONGEST_LINE = 2.0
"""Times [s] over which lines are fitted to the angles by the ground: at first, and at most."""
_LINE_NOISE = 6e-8
"""Squared uncertainty of a line's slope times its duration cubed [rad^2 s]: 0.5 mrad of white noise in 20 ms."""
_GROUND_TIME = 1.0
"""Time constant of the correction by the ground [s] after a step, when feet may roll."""
_SETTLING = 0.3
"""Time [s] in which the velocity settles after a start in a step: it is from one sample, whose error is not the tilt's. From
then on the time constant of the tilt correction by velocity is the time since the start, as the tilt is hardly known."""
_NOTICING = 0.1
"""Time [s] after the start in which a robot that stands is seen at rest."""
_UNREST_TIME = 0.3
_FIRST_UNREST = 0.1
_LARGEST_UNREST = 0.3
"""The low-pass of the standing points' speed [s], and that speed [m/s] at a start in a step, and at most."""
_SOLE_TIME = 1.0
_RIGID_TIME = 1.0 / 3.0
_LEAN_TIME = 2.0
_LARGEST_LEAN = 0.1
"""Time constants [s] of the correction by a standing sole whose leg yields, by one whose leg does not, and of the sole's
mean tilt; and how far [rad] a sole may seem to tilt from its mean: one that tilts farther rolls. All after a start in a step."""
_FIRST_WOBBLE = 3e-4
_OFFSET_WOBBLE = 3e-5
_YIELD_TIME = 0.25
"""Squared turn [rad^2] of standing soles that is expected at first, of a degree, and that offsets of encoders make: soles that
turn by less have legs that do not yield. And the time [s] over which what a leg yields is correlated."""
_REST_TIME = 2.0
"""Time constant [s] with which the gyroscope's bias is learnt at rest after a step."""


class GroundTrust(Signal):
    """Trust in points and ground."""

    gate = Field(unit="m/s", text="speed with which a standing point may seem to move")
    touched = Field(dtype="bool", text="a point has ever had contact")
    flown = Field(dtype="bool", text="all points have lost contact since the start")
    facing = Field(dtype="bool", text="the feet's heading has been noted")
    heading = Field(unit="rad", frame="world", text="direction of the feet while they stand")
    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")
    stepped = Field(dtype="bool", text="a point has been without contact since the start")
    unrest = Field(unit="m/s", text="speed at which the stillest point seems to move, low-passed")
    lean = Field(
        ("n_feet", 2),
        unit="rad",
        frame="world",
        text="turn that would lay each sole flat, low-passed",
    )
    wobble = Field(unit="rad^2", text="squared turn of standing soles, low-passed")
    waited = Field(
        unit="s", text="time since the start without rest; infinite once the robot has rested"
    )
    age = Field(unit="s", text="time since the start in a step; infinite if the robot stood there")


class StateEstimatorParameters(InertialParameters):
    """The parameters of ``StateEstimator``."""

    gate: float = live_parameter(
        0.08, unit="m/s", gt=0.0, text="speed at which a point is trusted by a quarter"
    )
    unrest_factor: float = live_parameter(
        6.0,
        ge=0.0,
        text="the gate is at least this many times the speed of points that should stand",
    )
    gate_growth: float = live_parameter(
        2.0, unit="m/s^2", ge=0.0, text="growth rate of the gate while all points are rejected"
    )
    support: float = live_parameter(
        4.0, unit="m/s^2", gt=0.0, text="upward specific force at which contacts count in full"
    )
    level_ground: bool = parameter(
        False, text="also after the first flight all points that stand are at one height"
    )
    slow_rate: float = live_parameter(
        1.5, unit="rad/s", gt=0.0, text="rate of base and joints below which feet are flat"
    )
    tilt_time: float = live_parameter(
        1.0, unit="s", gt=0.0, text="time constant of the tilt correction by velocity, after a step"
    )
    flexion: float = live_parameter(
        0.6,
        ge=0.0,
        le=1.0,
        text="share of a sole's apparent tilt by which its leg is turned, after a start in a step",
    )
    keep_soles: bool = parameter(
        False, text="after a start at rest, too, soles correct the attitude from the first step on"
    )
    bias_spread: float = live_parameter(
        0.01,
        unit="rad/s",
        gt=0.0,
        text="standard deviation of the gyroscope's bias, before it is learnt",
    )


class StateEstimator(InertialEstimator):
    """A complementary filter for the floating base (paper, II-B) that weighs its contacts.

    **Prediction.** The angular velocity w, which is the gyroscope minus its bias, is integrated to
    the orientation R. The specific force f, which is the accelerometer minus its bias, is rotated
    to the world and integrated to velocity and position::

        R' = R [w]x,   v' = R f + g,   p' = v

    **Correction by the legs.** Let r_i(q) be a contact point relative to the base. If the point is
    at rest in the world at a_i, then v = -R (J_i q' + w x r_i) and p = a_i - R r_i. The estimate is
    corrected towards both with the gains ``velocity_gain`` and ``position_gain`` per second, so the
    legs' noise is averaged over 1/gain; there is no lag, because the IMU predicts the motion
    meanwhile. a_i is set when the point touches down, and again while its weight is below 1/4. All gains and times
    are per second, so the estimate does not depend on the rate of the ticks.

    **Differences from the paper's filter** (``ComplementaryFilter``), which matter for jumps:

    * A point has the weight 1 / (1 + (e / gate)^2)^2, where e is its speed by the predicted base
      velocity, and no point counts while the IMU measures no support. So slipping feet, heels that
      lift and contacts that a latch still holds after lift-off do not disturb the velocity at
      lift-off. ``gate`` grows while all points are rejected or in the air, so that the estimate
      recovers from a wrong prediction. Feet of real legs roll and yield: the stillest point of a stance moves by
      50 mm/s and more, where a simulator's stands still. So the gate is at least ``unrest_factor`` times the speed at
      which the stillest points have seemed to move lately.
    * While all points are in contact and the robot moves slowly, before the first flight, the feet are flat on level ground.
      Or it leans by ``slope``. Then the heights of the points give the tilt, as exactly as the encoder offsets allow (about
      3 mrad, where a biased accelerometer has 10 mrad), and the feet give the heading while they
      stand. Until the first step the drift of both, by a least-squares line over up to 2 s, gives the gyroscope's
      bias, weighed against ``bias_spread`` and never beyond three times of it: what a short time tells is not believed. After a step the ground corrects the
      tilt with a time constant of 1 s only, the heading is that of the new stance, and the bias is learnt at rest.
    * After the first step the velocity by the legs corrects the tilt, in single support, too: a tilt error e is a false
      acceleration g x e, which the residual of the velocity shows. Its time constant is ``tilt_time``. While the robot stands still before the first flight, the accelerometer's reading minus
      gravity gives its bias, which would cause a drift in flight. After a flight the feet may stand at
      different heights, so only the accelerometer corrects the tilt, unless all ground is
      level by ``level_ground``.

    **Flight.** While no point is trusted there is only the prediction. ``flight: imu`` integrates
    the IMU. ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms; from
    then on the CoM falls freely, and the base follows from the joints. That does not drift, but it
    also does not notice a push.

    It starts at the first sample, or in a gantry when the first point touches the ground, with the robot standing on level ground, or ground of that ``slope``; or in a step,
    if a rate is above 0.5 rad/s, also with all points in contact: then only the points in contact are on the ground, they give the first velocity, the tilt is
    theirs, beside their line the accelerometer's where they lie in one, and the result has a warning. From then on, with ``keep_soles`` also
    after a start at rest, each sole that stands keeps its attitude: what seems to change in its tilt moves the leg's points by the share ``flexion``, for a leg yields
    under its load and encoders do not see it, and corrects the tilt within 1 s, or a third of it where soles hardly turn; there it
    corrects the heading, too. What has to be corrected again and again is the gyroscope's bias. The world's
    origin is midway between the soles, and x is the heading of the feet; for feet of one contact point it is
    the heading of the pattern in which they stand. Yaw and horizontal position drift. After a jump
    the height of the ground is known only through the anchors. The block never waits and raises no
    errors in a run.
    """

    Params = StateEstimatorParameters
    starts_level = True
    params: StateEstimatorParameters
    trust = State(GroundTrust, text="trust in points and ground")

    @kernel
    @staticmethod
    def step(
        imu: ImuReading,
        joints: JointState,
        base: BaseState,
        estimate: BaseEstimate,
        learning: BiasSamples,
        trust: GroundTrust,
        legs: LegKinematics,
        params: StateEstimatorParameters,
        constants: InertialConstants,
        scratch: InertialScratch,
    ) -> None:
        trust.touched = trust.touched or count_standing(legs.points.active) > 0
        if estimate.started and not trust.touched:  # in a gantry every tick is the first one
            forget(estimate)
        airborne = estimate.started and count_standing(legs.points.active) == 0
        fastest = predict(imu, joints, estimate, legs, constants, scratch)
        if airborne and trust.aligned > 0:
            trust.flown = True
        if trust.gate == 0.0:  # the first tick: the feet point along x
            trust.facing = True
            trust.wobble = _FIRST_WOBBLE
            trust.stepped = not estimate.stood
            trust.unrest = _FIRST_UNREST if trust.stepped else 0.0
            trust.gate = max(params.gate, params.unrest_factor * trust.unrest)
            trust.age = 0.0 if trust.stepped else math.inf
            trust.waited = 0.0 if count_standing(legs.points.active) > 0 else math.inf
        elif fastest == math.inf:  # a foot that steps points elsewhere afterwards
            trust.facing = False
            trust.stepped = True
            if params.keep_soles and trust.age == math.inf:
                trust.age = _LONGEST_LINE  # what the age is asked for is known by then
        trust.age += constants.period
        if trust.waited < math.inf and estimate.stood:
            watch_for_step(estimate, trust, params, constants, fastest)
        still = fastest < params.still_rate
        if not trust.flown:
            learn_accelerometer_bias(estimate, learning, constants, scratch, still)
        if is_unaccelerated(scratch.force):
            if fastest < params.slow_rate and (params.level_ground or not trust.flown):
                align_with_ground(estimate, trust, legs, params, constants, scratch)
            elif still:
                correct_tilt_from_gravity(
                    estimate.orientation, scratch.force, constants.tilt_gain, scratch.vector
                )
        set_point_positions(estimate, legs)
        if trust.age < math.inf:
            use_soles(estimate, trust, legs, params, constants, scratch)
        trusted, support = trust_points(estimate, trust, legs, params, constants, scratch)
        correct_motion(estimate, legs, params, constants, scratch, trusted, support)
        if trust.stepped:
            correct_attitude(estimate, trust, params, constants, scratch, support)
            if trust.age < math.inf:
                learn_gyro_bias(estimate, trust, params, scratch)
            if still:
                share = constants.period / _REST_TIME
                estimate.gyro_bias[:] += share * (estimate.mean_rate - estimate.gyro_bias)
                limit(estimate.gyro_bias, 3.0 * params.bias_spread, estimate.gyro_bias)
        publish(estimate, base)

    def warnings(self) -> Sequence[str]:
        """Say when the estimate began in a step."""
        if not self.estimate.started or self.estimate.stood:
            return ()
        return (
            (
                "the estimate began while the robot was stepping: its tilt is known to some degrees for the first "
                "second, and the gyroscope's bias hardly for the first two"
            ),
        )


@kernel
def watch_for_step(
    estimate: BaseEstimate,
    trust: GroundTrust,
    params: StateEstimatorParameters,
    constants: InertialConstants,
    fastest: float,
) -> None:
    """Notice that the start was in a step: the robot steps and has not been at rest, slow as it was at first."""
    trust.waited += constants.period
    if (
        max(largest_of(estimate.mean_rate), largest_of(estimate.mean_joint_rate))
        < params.still_rate
    ):
        trust.waited = math.inf
    elif fastest == math.inf and trust.waited > _NOTICING:
        estimate.stood = False
        trust.unrest = _FIRST_UNREST
        trust.age = 0.0


@kernel
def correct_attitude(
    estimate: BaseEstimate,
    trust: GroundTrust,
    params: StateEstimatorParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
    support: float,
) -> None:
    """Correct the attitude by the soles, if they wrote to ``error``, and the tilt by the velocity of the standing points, too.

    A tilt error is a false acceleration. The soles' heading counts as far as the legs are rigid.
    """
    residual, error = scratch.residual, scratch.error
    if trust.age == math.inf:
        error[:] = 0.0
    if trust.age >= _SETTLING:
        limit(residual, 0.3, residual)
        time = min(trust.age, params.tilt_time)
        gain = support * constants.velocity_gain / (GRAVITY * time)
        error[0] -= gain * residual[1]
        error[1] += gain * residual[0]
    rigid = _OFFSET_WOBBLE / (_OFFSET_WOBBLE + trust.wobble)
    rotate_in_world(estimate.orientation, error[0], error[1], rigid * error[2])


@kernel
def learn_accelerometer_bias(
    estimate: BaseEstimate,
    learning: BiasSamples,
    constants: InertialConstants,
    scratch: InertialScratch,
    still: bool,
) -> None:
    """While the robot stands still, learn the mean of the accelerometer minus gravity."""
    if not still:
        forget_samples(learning)
        return
    bias, gravity = estimate.accelerometer_bias, scratch.vector
    gravity[0], gravity[1], gravity[2] = 0.0, 0.0, GRAVITY
    rotate_back(estimate.orientation, gravity, gravity)
    learning.filling_sum[:] = learning.filling_sum + scratch.force + bias - gravity
    learn_bias(learning, constants, bias, 0.006)


@kernel
def align_with_ground(
    estimate: BaseEstimate,
    trust: GroundTrust,
    legs: LegKinematics,
    params: StateEstimatorParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> None:
    """Correct tilt and heading by the points, and the gyroscope's bias by the drift of both."""
    motion, error, drift = legs.motion, scratch.error, scratch.vector
    # A line by least squares, over all ticks so far or over the longest time: angle and its drift.
    trust.aligned += 1
    time = min(max(trust.aligned * constants.period, _SHORTEST_LINE), _LONGEST_LINE)
    n = time / constants.period
    angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
    variance = params.bias_spread * params.bias_spread
    drift_gain *= variance / (variance + _LINE_NOISE / (time * time * time))
    if trust.stepped:
        angle_gain, drift_gain = min(constants.period / _GROUND_TIME, 1.0), 0.0
    misalignment(
        estimate.orientation, motion.points, legs.points.active, motion.forward, constants.gradient,
        error, drift,
    )  # fmt: skip
    if not trust.facing:
        trust.heading = -error[2]
        trust.facing = True
    error[2] = wrap(error[2] + trust.heading)
    limit(error, 0.05, error)
    rotate_back(estimate.orientation, error, drift)
    estimate.gyro_bias[:] -= drift * (drift_gain / constants.period)
    limit(estimate.gyro_bias, 3.0 * params.bias_spread, estimate.gyro_bias)
    error[:] *= angle_gain
    rotate_in_world(estimate.orientation, error[0], error[1], error[2])


@kernel
def use_soles(
    estimate: BaseEstimate,
    trust: GroundTrust,
    legs: LegKinematics,
    params: StateEstimatorParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> None:
    """Write to ``error`` the turn that standing soles ask for, and move their points to where they are if their legs have yielded.

    A standing sole keeps its attitude. If it seems to change, the estimate turns, or the leg yields under its load, which
    encoders do not see. In both cases the leg's points are turned back about the base. The more the soles turn, the less
    they are believed; what does not change of the tilt of soles that turn, as the slope of the ground, is left alone.
    """
    points, owners = legs.points, legs.contacts.foot
    error, turn, standing = scratch.error, scratch.vector, scratch.standing
    error[:] = 0.0
    rigid = _OFFSET_WOBBLE / (_OFFSET_WOBBLE + trust.wobble)
    passing = (1.0 - rigid) * min(constants.period / _LEAN_TIME, 1.0)
    for foot in range(trust.lean.shape[0]):
        for point in range(standing.shape[0]):
            standing[point] = points.active[point] and owners[point] == foot
        if count_standing(standing) == 0:
            continue
        turn_of_sole(estimate.position, points, standing, constants.gradient, turn)
        lean = trust.lean[foot]
        lean[0] += passing * (turn[0] - lean[0])
        lean[1] += passing * (turn[1] - lean[1])
        x, y = turn[0] - lean[0], turn[1] - lean[1]
        ratio = 1.0 + (x * x + y * y) / (_LARGEST_LEAN * _LARGEST_LEAN)
        part = 1.0 / (ratio * ratio)
        x, y = part * x, part * y
        z = max(min(turn[2], _LARGEST_LEAN), -_LARGEST_LEAN)
        squared = x * x + y * y + z * z
        trust.wobble += min(constants.period / _UNREST_TIME, 1.0) * (squared - trust.wobble)
        trust.wobble = max(trust.wobble, squared)
        rigid = _OFFSET_WOBBLE / (_OFFSET_WOBBLE + trust.wobble)
        gain = min(constants.period * ((1.0 - rigid) / _SOLE_TIME + rigid / _RIGID_TIME), 1.0)
        error[0] += gain * x
        error[1] += gain * y
        error[2] += gain * z
        x, y = params.flexion * x, params.flexion * y
        for point in range(standing.shape[0]):
            if standing[point]:
                place = points.places[point]
                ahead, left, up = place[0], place[1], place[2]
                place[0] = ahead + y * up
                place[1] = left - x * up
                place[2] = up + x * left - y * ahead


@kernel
def turn_of_sole(
    position: Vector3, points: StandingPoints, standing: Flags1D, gradient: Array1D, out: Vector3
) -> None:
    """Compute the rotation vector [rad, world] that lays some points on the ground, and turns them as they touched down."""
    places, anchors = points.places, points.anchors
    n, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    for i in range(standing.shape[0]):
        if standing[i]:
            n, mx, my, mz = n + 1.0, mx + places[i, 0], my + places[i, 1], mz + places[i, 2]
    each = 1.0 / n
    mx, my, mz = each * mx, each * my, each * mz
    xx, xy, yy, xz, yz, across = 1e-12, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(standing.shape[0]):
        if standing[i]:
            x, y, z = places[i, 0] - mx, places[i, 1] - my, places[i, 2] - mz
            z -= gradient[0] * x + gradient[1] * y
            xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
            if points.anchored[i]:
                u, v = position[0] + places[i, 0], position[1] + places[i, 1]
                across += x * (anchors[i, 1] - v) - y * (anchors[i, 0] - u)
    turn_to_level(xx, xy, yy, xz, yz, out)
    out[2] = across / (xx + yy)


@kernel
def learn_gyro_bias(
    estimate: BaseEstimate,
    trust: GroundTrust,
    params: StateEstimatorParameters,
    scratch: InertialScratch,
) -> None:
    """Learn the gyroscope's bias after a start in a step, by the turn in ``error`` that soles and velocity ask for in a tick.

    The gain is that of a line by least squares over the time since the start, weighed against ``bias_spread`` by what the
    soles turn.
    """
    body = scratch.vector
    time = min(max(trust.age, _SHORTEST_LINE), _LONGEST_LINE)
    variance = params.bias_spread * params.bias_spread
    noise = 12.0 * _YIELD_TIME * trust.wobble
    gain = 6.0 * _SOLE_TIME * variance * time / (variance * (time * time * time) + noise)
    rotate_back(estimate.orientation, scratch.error, body)
    estimate.gyro_bias[:] -= gain * body
    limit(estimate.gyro_bias, 3.0 * params.bias_spread, estimate.gyro_bias)


@kernel
def trust_points(
    estimate: BaseEstimate,
    trust: GroundTrust,
    legs: LegKinematics,
    params: StateEstimatorParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> tuple[float, float]:
    """Write the weight of every point.

    Returns the largest weight, and a factor from 0 to 1 on all corrections by contacts.
    """
    points, force, growth = legs.points, scratch.vector, params.gate_growth
    gate = trust.gate
    trusted = weigh_contacts(points.rates, points.active, estimate.velocity, gate, points.weights)
    rotate(estimate.orientation, scratch.force, force)
    support = min(max(force[2] / params.support, 0.0), 1.0)
    if count_standing(points.active) == 0:
        gate += 0.05 * growth * constants.period
    elif trusted < 0.25:
        gate += growth * constants.period
    else:
        speed = min(gate * math.sqrt(1.0 / math.sqrt(trusted) - 1.0), _LARGEST_UNREST)
        trust.unrest += min(constants.period / _UNREST_TIME, 1.0) * (speed - trust.unrest)
        gate += constants.relaxing * (max(params.gate, params.unrest_factor * trust.unrest) - gate)
    trust.gate = min(gate, 10.0)
    return trusted, support
