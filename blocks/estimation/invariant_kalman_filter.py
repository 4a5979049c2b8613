"""Estimates the base's pose and velocity by an invariant Kalman filter with contacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Vector3
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import atan2
from ...mathematics.inertial_filter import (
    STARTING_RATE,
    misalignment,
    orientation_from_gravity,
    propagate,
    rotate_in_world,
)
from ...mathematics.invariant_filter import (
    add_contact_noise,
    error_transition,
    input_jacobian,
    propagate_covariance,
    sample_deviations,
    vector_deviation,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, to_matrix
from ...robots.contact_kinematics import (
    ContactGeometry,
    ContactKinematics,
    ContactMotion,
    RigidBodies,
    contact_motion,
    differentiate_contacts,
)
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters
from ..signals import BaseState, ContactState, EstimatorHealth, ImuReading, JointState
from .invariant_update import (
    InvariantConstants,
    InvariantEstimate,
    InvariantFilterParameters,
    InvariantScratch,
    add_contacts,
    define_world,
    use_contacts,
    use_ground,
)

_FASTEST_TURN = 100.0
_STRONGEST_FORCE = 1000.0
"""Sensor values are limited to these [rad/s, m/s^2], so that nothing can overflow."""
_START_TURN = 0.05
_START_SPEED = 0.01
_START_PLACE = 0.02
"""Standard deviations at the start [rad, m/s, m], before the feet have been used."""
_STEP_TURN = 0.05
_STEP_SPEED = 1.0
_STEP_PLACE = 1e-3
"""The same at a start in a step, of tilt and velocity; the last also of the heading [rad]."""


class TrackedContacts(NamedTuple):
    """Places of the contact points: see ``ContactKinematics``. ``tracked`` are those of the filter, which does without
    ``joint_rates``: they are zero."""

    bodies: RigidBodies
    contacts: ContactGeometry
    tracked: ContactGeometry
    joint_rates: Array1D
    motion: ContactMotion


def tracked_points(robot: RobotDescription) -> tuple[Array, Array]:
    """Return the points of the feet that stand still on the ground, and their heights above it.

    A foot that rolls over its toe by the angle a moves the centre of the toe's rubber, of radius r, by
    r a. The point of the foot that was lowest moves by r (a - sin a) only, a hundredth of that. So the
    filter tracks this point. A foot that is a ball has no such point: there it is the centre.

    Returns:
        (n_contacts, 3) [m, link frame] and (n_contacts,) [m].
    """
    points = np.array([contact.position for contact in robot.contacts], np.float64).reshape(-1, 3)
    heights = np.zeros(len(robot.contacts))
    for ball in ball_feet(robot):
        points[ball.point], heights[ball.point] = ball.centre, ball.radius
    return points, heights


class InvariantKalmanFilter(Block):
    """A contact-aided right-invariant extended Kalman filter (Hartley et al. 2020).

    Same ports as ``StateEstimator``: ``set: {estimator.use: blocks.InvariantKalmanFilter}``.

    **State.** X = (R, v, p, d_1 .. d_N) on SE_{2+N}(3): the base's orientation, velocity and
    position and the contact points that stand on the ground; the biases of gyroscope and
    accelerometer; and the offsets of the joint encoders, which limit the accuracy on a robot whose
    offsets are larger than its encoder noise. The error is xi = log(X_est X^-1).

    **Prediction.** The state is propagated by the IMU, as in ``StateEstimator``, and the covariance
    by a transition that does not depend on the trajectory (``mathematics/invariant_filter``). In flight
    there is only the prediction.

    **Contacts.** A point that is reported active, while the IMU measures support, is added to the
    state at the position that leg kinematics measure: the point of the foot that is lowest while the
    foot is flat, or the centre of a foot that is a ball. From then on it stands still except for the
    process noise ``contact_noise`` of the point and that of its foot,
    sqrt(slide_noise^2 + (impact_slide (|f| - g))^2), because feet slide a little at impacts and
    hard pushes. The measurement update is R h(q) + p - d = 0. If a residual is too unlikely
    (``gate``, chi-squared with three degrees of freedom) the point has slipped or lifted: it is
    removed from the state and added again at its present position, so that nothing is learnt from
    it. While all points are rejected, process noise is added to the velocity until one is accepted.

    **Ground.** At the start all points are at height zero. Until the first flight all points that stand
    are at one height, with ``level_ground`` also after it; without it nothing is assumed there. Errors of
    the height are correlated in time, so the heights count as one measurement per ``ground_time``, not per tick.

    **Saturation.** A sample at the end of the given range is a bound, not a value. Its axis has the
    standard deviation ``saturated_rate`` or ``saturated_force``, so the covariance grows as it
    should, and other measurements get more weight. A rate that is saturated in flight is not known
    at all; ``health`` reports that.

    It starts at the first sample, with the robot standing on level ground, or in a step as ``StateEstimator``: the
    world's origin is midway between the soles and x is the heading of the feet. Yaw and horizontal position drift
    from jump to jump. The block never waits and raises no errors in a run.
    """

    Params = InvariantFilterParameters
    Constants = InvariantConstants
    Scratch = InvariantScratch
    needs = ("floating base", "imu", "feet")
    params: InvariantFilterParameters
    constants: InvariantConstants
    scratch: InvariantScratch

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a start on ground that leans."""
        if isinstance(params, InvariantFilterParameters) and any(params.slope):
            ahead, left = map(math.degrees, params.slope)
            yield UnmetRequirement(
                "this filter takes the ground on which it begins for level",
                parameter="slope",
                expected="a start on level ground",
                found=f"ground that rises by {ahead:.4g} deg ahead and {left:.4g} deg to the left",
                fix=f"{context.path}.use: blocks.StateEstimator",
            )

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="points that carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    health = Output(EstimatorHealth, text="standard deviations of the estimate")
    estimate = State(InvariantEstimate, text="the filter")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the number of vectors in the state and the size of the error."""
        assert robot is not None
        n = len(robot.contacts)
        return {"n_vectors": 2 + n, "n_errors": 15 + 3 * n + len(robot.joints)}

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        kinematics = ContactKinematics(robot)
        points, constants.height[:] = tracked_points(robot)
        constants.foot[:] = robot.foot_of_contact()
        constants.heading_levers[:] = kinematics.heading_levers
        self.legs = TrackedContacts(
            kinematics.bodies,
            kinematics.contacts,
            kinematics.contacts._replace(centre=points),
            np.zeros(len(robot.joints)),
            kinematics.motion,
        )  # fmt: skip

    def prepare(self) -> None:
        params, constants = self.params, self.constants
        constants.place_noise[:] = params.kinematics_noise**2 * np.eye(3)
        constants.gyro_range = math.inf if params.gyro_range is None else params.gyro_range
        limit = params.accelerometer_range
        constants.accelerometer_range = math.inf if limit is None else limit
        error_transition(GRAVITY, self.period, constants.transition)

    @kernel
    @staticmethod
    def step(
        imu: ImuReading,
        joints: JointState,
        contacts: ContactState,
        base: BaseState,
        health: EstimatorHealth,
        estimate: InvariantEstimate,
        legs: TrackedContacts,
        params: InvariantFilterParameters,
        constants: InvariantConstants,
        scratch: InvariantScratch,
        period: float,
    ) -> None:
        take_samples(imu, estimate, params, constants, scratch, health)
        if estimate.started:
            predict(estimate, params, constants, scratch, period)
        else:
            orientation_from_gravity(scratch.force, estimate.orientation)
        scratch.used_offset[:] = estimate.encoder_offset
        scratch.angles[:] = joints.position - scratch.used_offset
        contact_motion(
            legs.bodies, legs.contacts, estimate.orientation, estimate.angular_velocity,
            scratch.angles, legs.joint_rates, legs.motion,
        )  # fmt: skip
        differentiate_contacts(legs.bodies, legs.tracked, scratch.centres, scratch.centre_jacobians)
        to_matrix(estimate.orientation, scratch.rotation)
        if not estimate.started:
            stands = is_standing(joints, contacts, estimate.angular_velocity)
            start(estimate, legs.motion, contacts, stands, params, constants, scratch)
        use_contacts(contacts, estimate, params, constants, scratch, health, period)
        if params.level_ground or not estimate.flown:
            use_ground(estimate, params, constants, scratch, health, period)
        publish(estimate, scratch, health, base)


@kernel
def take_samples(
    imu: ImuReading,
    estimate: InvariantEstimate,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
    health: EstimatorHealth,
) -> None:
    """Take the IMU's sample without biases, and its noise for each axis, by whether it is saturated."""
    rate, force, noise = scratch.rate, scratch.force, scratch.noise
    rate[:] = min(max(imu.angular_velocity, -_FASTEST_TURN), _FASTEST_TURN)
    force[:] = min(max(imu.specific_force, -_STRONGEST_FORCE), _STRONGEST_FORCE)
    health.gyro_saturated = sample_deviations(
        rate, constants.gyro_range, params.gyro_noise, params.saturated_rate,
        estimate.saturated_run[:3], noise[:3],
    )  # fmt: skip
    health.accelerometer_saturated = sample_deviations(
        force, constants.accelerometer_range, params.accelerometer_noise, params.saturated_force,
        estimate.saturated_run[3:], noise[3:],
    )  # fmt: skip
    if health.gyro_saturated or health.accelerometer_saturated:
        estimate.saturated_ticks += 1
    health.saturated_ticks = estimate.saturated_ticks
    scratch.last_rate[:] = estimate.angular_velocity
    estimate.angular_velocity[:] = rate - estimate.gyro_bias
    for k in range(3):
        aliased = params.gyro_aliasing * (estimate.angular_velocity[k] - scratch.last_rate[k])
        noise[k] = math.sqrt(noise[k] * noise[k] + aliased * aliased)
    force[:] -= estimate.accelerometer_bias


@kernel
def predict(
    estimate: InvariantEstimate,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
    period: float,
) -> None:
    """Propagate the state and the covariance over the period before this tick."""
    covariance, vectors = estimate.covariance, scratch.middle_vectors
    propagate(
        estimate.orientation, estimate.vectors[1], estimate.vectors[0], scratch.last_rate,
        estimate.angular_velocity, scratch.force, period, scratch.middle, scratch.acceleration,
    )  # fmt: skip
    to_matrix(scratch.middle, scratch.rotation)
    vectors[:] = estimate.vectors
    vectors[0, :] -= 0.5 * period * scratch.acceleration
    vectors[1, :] -= 0.5 * period * vectors[0]
    input_jacobian(
        scratch.rotation, vectors, estimate.present, GRAVITY, period, scratch.input_jacobian
    )
    bias = 3 + 3 * vectors.shape[0]
    propagate_covariance(
        constants.transition, scratch.input_jacobian, bias, scratch.noise, covariance,
        scratch.scaled, scratch.product,
    )  # fmt: skip
    x, y, z = scratch.force[0], scratch.force[1], scratch.force[2]
    pressed = params.impact_slide * max(math.sqrt(x * x + y * y + z * z) - GRAVITY, 0.0)
    slide = math.sqrt(params.slide_noise * params.slide_noise + pressed * pressed)
    add_contact_noise(
        constants.foot, estimate.present, params.contact_noise, slide, period, covariance
    )
    gyro_walk, accelerometer_walk = params.gyro_bias_walk, params.accelerometer_bias_walk
    for k in range(bias, bias + 3):
        covariance[k, k] += gyro_walk * gyro_walk * period
        covariance[k + 3, k + 3] += accelerometer_walk * accelerometer_walk * period


@kernel
def is_standing(joints: JointState, contacts: ContactState, rate: Vector3) -> bool:
    """Check whether the robot stands on all points, though not all report it: it is at rest, or hangs in a gantry."""
    standing = 0
    for point in range(contacts.active.shape[0]):
        standing += bool(contacts.active[point])
    fastest = 0.0
    for i in range(joints.velocity.shape[0]):
        fastest = max(fastest, abs(joints.velocity[i]))
    for k in range(3):
        fastest = max(fastest, abs(rate[k]))
    return standing == 0 or standing == contacts.active.shape[0] or fastest < STARTING_RATE


@kernel
def start(
    estimate: InvariantEstimate,
    motion: ContactMotion,
    contacts: ContactState,
    stands: bool,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
) -> None:
    """Start at the origin, the feet heading along x: standing on level ground, or in a step."""
    error, place, vector = scratch.residual, estimate.vectors[1], scratch.vector
    scratch.believed[:] = True
    if not stands:
        scratch.believed[:] = contacts.active
    for _ in range(20):
        flat = misalignment(
            estimate.orientation, motion.points, scratch.believed, motion.forward,
            constants.gradient, error, vector,
        )  # fmt: skip
        if not flat:
            rotate(estimate.orientation, motion.forward, vector)
            error[2] = -atan2(vector[1], vector[0])
        error[:] = min(max(error, -0.2), 0.2)
        rotate_in_world(estimate.orientation, error[0], error[1], error[2])
    to_matrix(estimate.orientation, scratch.rotation)
    soles, standing = motion.soles.shape[0], 0
    for sole in range(soles):
        rotate(estimate.orientation, motion.soles[sole], vector)
        place[:2] -= vector[:2] / soles
    for point in range(constants.foot.shape[0]):
        standing += bool(scratch.believed[point])
    for point in range(constants.foot.shape[0]):
        if scratch.believed[point]:
            rotate(estimate.orientation, scratch.centres[point], vector)
            place[2] += (constants.height[point] - vector[2]) / standing
    start_covariance(estimate, params, stands)
    estimate.started = True
    add_contacts(estimate, constants, scratch)
    if stands:
        define_world(estimate, params, constants, scratch)


@kernel
def start_covariance(
    estimate: InvariantEstimate, params: InvariantFilterParameters, stands: bool
) -> None:
    """Set the variances before the feet have been used; no contact point is in the state."""
    bias = 9 + 3 * estimate.present.shape[0]
    for k in range(estimate.covariance.shape[0]):
        deviation = params.encoder_offset
        if k < 9:
            deviation = _START_TURN if k < 3 else (_START_SPEED if k < 6 else _START_PLACE)
            if not stands:  # heading and place are defined by the start, the rest is hardly known
                deviation = _STEP_TURN if k < 2 else (_STEP_SPEED if 3 <= k < 6 else _STEP_PLACE)
        elif k < bias:
            deviation = 0.0
        elif k < bias + 6:
            deviation = params.gyro_bias if k < bias + 3 else params.accelerometer_bias
        estimate.covariance[k, k] = deviation * deviation


@kernel
def publish(
    estimate: InvariantEstimate,
    scratch: InvariantScratch,
    health: EstimatorHealth,
    base: BaseState,
) -> None:
    """Write the estimate and how far it is to be trusted."""
    covariance, vectors = estimate.covariance, estimate.vectors
    estimate.angular_velocity[:] = scratch.rate - estimate.gyro_bias
    base.angular_velocity[:] = estimate.angular_velocity
    base.position[:] = vectors[1]
    base.linear_velocity[:] = vectors[0]
    base.orientation[:] = estimate.orientation
    health.velocity_std = vector_deviation(covariance, 3, vectors[0])
    health.position_std = vector_deviation(covariance, 6, vectors[1])
    health.tilt_std = math.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0))
    health.yaw_std = math.sqrt(max(covariance[2, 2], 0.0))
