"""Estimates the base's pose and velocity from the IMU, the joint encoders and the contacts."""

from __future__ import annotations

from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import (
    correct_tilt_from_gravity,
    misalignment,
    rotate_in_world,
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
    count_standing,
    forget,
    forget_samples,
    is_unaccelerated,
    learn_bias,
    limit,
    predict,
    set_point_positions,
    use_contacts,
)


class GroundTrust(Signal):
    """Trust in points and ground."""

    gate = Field(unit="m/s", text="speed with which a standing point may seem to move")
    touched = Field(dtype="bool", text="a point has ever had contact")
    flown = Field(dtype="bool", text="all points have lost contact since the start")
    facing = Field(dtype="bool", text="the feet's heading has been noted")
    heading = Field(unit="rad", frame="world", text="direction of the feet while they stand")
    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")


class StateEstimatorParameters(InertialParameters):
    """The parameters of ``StateEstimator``."""

    gate: float = live_parameter(
        0.08, unit="m/s", gt=0.0, text="speed at which a point is trusted by a quarter"
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


class StateEstimator(InertialEstimator):
    """A complementary filter for the floating base (paper, II-B) that weighs its contacts.

    **Prediction.** The angular velocity w, which is the gyroscope minus its bias, is integrated to
    the orientation R. The specific force f, which is the accelerometer minus its bias, is rotated
    to the world and integrated to velocity and position::

        R' = R [w]x,   v' = R f + g,   p' = v

    **Correction by the legs.** Let r_i(q) be a contact point relative to the base. If the point is
    at rest in the world at a_i, then v = -R (J_i q' + w x r_i) and p = a_i - R r_i. The estimate is
    corrected towards both with the gains ``velocity_gain`` and ``position_gain`` per tick, so the
    legs' noise is averaged over 1/gain ticks; there is no lag, because the IMU predicts the motion
    meanwhile. a_i is set when the point touches down.

    **Differences from the paper's filter** (``ComplementaryFilter``), which matter for jumps:

    * A point has the weight 1 / (1 + (e / gate)^2)^2, where e is its speed by the predicted base
      velocity, and no point counts while the IMU measures no support. So slipping feet, heels that
      lift and contacts that a latch still holds after lift-off do not disturb the velocity at
      lift-off. ``gate`` grows while all points are rejected or in the air, so that the estimate
      recovers from a wrong prediction.
    * While all points are in contact and the robot moves slowly, before the first flight, the feet are flat on level ground.
      Or it leans by ``slope``. Then the heights of the points give the tilt, as exactly as the encoder offsets allow (about
      3 mrad, where a biased accelerometer has 10 mrad), and the feet give the heading while they
      stand. The drift of both, by a least-squares line over up to 250 ticks, gives the gyroscope's
      bias. While the robot stands still before the first flight, the accelerometer's reading minus
      gravity gives its bias, which would cause a drift in flight. After a flight the feet may stand at
      different heights, so only the accelerometer corrects the tilt, unless all ground is
      level by ``level_ground``.

    **Flight.** While no point is trusted there is only the prediction. ``flight: imu`` integrates
    the IMU. ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms; from
    then on the CoM falls freely, and the base follows from the joints. That does not drift, but it
    also does not notice a push.

    It starts at the first sample, or in a gantry when the first point touches the ground, with the robot standing on level ground, or ground of that ``slope``: the world's
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
            trust.facing = False
        if trust.gate == 0.0:  # the first tick: the feet point along x
            trust.gate = params.gate
            trust.facing = True
        still = fastest < params.still_rate
        if not trust.flown:
            learn_accelerometer_bias(estimate, learning, constants, scratch, still)
        if is_unaccelerated(scratch.force):
            if fastest < params.slow_rate and (params.level_ground or not trust.flown):
                align_with_ground(estimate, trust, legs, constants, scratch)
            elif still:
                correct_tilt_from_gravity(
                    estimate.orientation, scratch.force, params.tilt_gain, scratch.vector
                )
        set_point_positions(estimate, legs)
        trusted, support = trust_points(estimate, trust, legs, params, constants, scratch)
        use_contacts(estimate, legs, base, params, constants, scratch, trusted, support)


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
    learn_bias(learning, constants.block_size, bias, 3.0)


@kernel
def align_with_ground(
    estimate: BaseEstimate,
    trust: GroundTrust,
    legs: LegKinematics,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> None:
    """Correct tilt and heading by the points, and the gyroscope's bias by the drift of both."""
    motion, error, drift = legs.motion, scratch.error, scratch.vector
    # Least squares over all ticks so far, then over the last 250: angle and its drift.
    trust.aligned = min(trust.aligned + 1, 250)
    n = max(trust.aligned, 30)
    angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
    misalignment(
        estimate.orientation, motion.points, motion.forward, constants.gradient, error, drift
    )
    if not trust.facing:
        trust.heading = -error[2]
        trust.facing = True
    error[2] = wrap(error[2] + trust.heading)
    limit(error, 0.05, error)
    rotate_back(estimate.orientation, error, drift)
    estimate.gyro_bias[:] -= drift * (drift_gain / constants.period)
    error[:] *= angle_gain
    rotate_in_world(estimate.orientation, error[0], error[1], error[2])


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
        gate += 0.1 * (params.gate - gate)
    trust.gate = min(gate, 10.0)
    return trusted, support
