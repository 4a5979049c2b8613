"""The common base of the estimators of the floating base that integrate the IMU."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, NamedTuple

from ...mathematics.arrays import Array1D, Flags1D, Vector3
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import atan2, cos, expm1, sin
from ...mathematics.inertial_filter import (
    STARTING_RATE,
    StandingPoints,
    correct_by_contacts,
    misalignment,
    orientation_from_gravity,
    propagate,
    rotate_in_world,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate
from ...robots.contact_kinematics import (
    ContactGeometry,
    ContactKinematics,
    ContactMotion,
    RigidBodies,
    contact_motion,
)
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, TwoNumbers, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, ContactState, ImuReading, JointState

_FASTEST_TURN = 100.0
_STRONGEST_FORCE = 1000.0
_FASTEST_JOINT = 1000.0
"""Sensor values are limited to these [rad/s, m/s^2, rad/s], so that nothing can overflow."""
_IMPACT = 25.0
"""An acceleration of the CoM beyond gravity [m/s^2] that ends a free fall."""


class BaseEstimate(Signal):
    """The state of an estimator of the base."""

    position = Field(3, unit="m", frame="world", text="base origin")
    orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="at the last tick, without bias")
    gyro_bias = Field(3, unit="rad/s", frame="body", text="learnt while standing still")
    accelerometer_bias = Field(3, unit="m/s^2", frame="body", text="learnt while standing still")
    mean_rate = Field(3, unit="rad/s", frame="body", text="low-passed gyroscope")
    mean_joint_rate = Field("n_joints", unit="rad/s", text="low-passed joint velocities")
    anchor = Field(("n_contacts", 3), unit="m", frame="world", text="places where the points stand")
    anchored = Field("n_contacts", dtype="bool", text="points with an anchor")
    ballistic_velocity = Field(
        3, unit="m/s", frame="world", text="velocity of the CoM at the start of the free fall"
    )
    flight_ticks = Field(dtype="int64", text="ticks since the last trusted contact")
    started = Field(dtype="bool", text="the first sample has been seen")
    stood = Field(dtype="bool", text="at the first sample all points stood on the ground")


class BiasSamples(Signal):
    """Means that are being formed: sums over the present block of samples and the one before."""

    samples = Field(dtype="int64", text="samples the mean is made of")
    filled = Field(dtype="int64", text="samples in the block being filled")
    held = Field(dtype="int64", text="samples in the block before, none or a full block")
    filling_sum = Field(3, frame="body", text="sum of the samples whose mean is the learnt bias")
    held_sum = Field(3, frame="body", text="the same sum of the block before")


class InertialParameters(Parameters):
    """The parameters of estimators that integrate the IMU."""

    flight: Literal["imu", "ballistic"] = parameter(
        "imu", text="the prediction in flight: by the IMU, or by a free fall of the CoM"
    )
    slope: TwoNumbers = parameter(
        (0.0, 0.0), unit="rad", text="slope of the ground ahead and to the left at the start"
    )
    velocity_gain: float = live_parameter(
        15.0, unit="1/s", gt=0.0, text="gain of the legs' velocity correction"
    )
    position_gain: float = live_parameter(
        50.0, unit="1/s", gt=0.0, text="gain of the legs' position correction"
    )
    tilt_gain: float = live_parameter(
        1.0, unit="1/s", ge=0.0, text="gain of the accelerometer's tilt correction"
    )
    still_rate: float = live_parameter(
        0.08,
        unit="rad/s",
        gt=0.0,
        text="rate of base and joints below which the robot stands still",
    )


class InertialConstants(Signal):
    """Numbers of the filter."""

    period = Field(unit="s", text="of a tick")
    velocity_gain = Field(unit="", text="share of the legs' velocity correction in a tick")
    position_gain = Field(unit="", text="share of the legs' position correction in a tick")
    tilt_gain = Field(unit="", text="share of the accelerometer's tilt correction in a tick")
    relaxing = Field(unit="", text="share by which the gate of speeds closes in a tick")
    filtering = Field(unit="", text="share of a change that the low-pass takes over in a tick")
    block_size = Field(dtype="int64", text="samples in a block from which a bias is learnt")
    longest_mean = Field(dtype="int64", text="samples after which a bias is a running mean")
    starts_level = Field(dtype="bool", text="the contact points give the first tilt")
    gradient = Field(2, unit="", text="slope of the ground ahead and to the left at the start")


class InertialScratch(Signal):
    """Intermediate values of a tick."""

    gyro = Field(3, unit="rad/s", frame="body", text="the gyroscope's sample within limits")
    force = Field(3, unit="m/s^2", frame="body", text="the accelerometer's, without its bias")
    joint_rates = Field("n_joints", unit="rad/s", text="joint velocities within limits")
    last_rate = Field(3, unit="rad/s", frame="body", text="angular velocity of the tick before")
    middle = Field(4, text="orientation in the middle of the tick")
    acceleration = Field(3, text="an acceleration, or a change of velocity")
    error = Field(3, text="a rotation vector")
    residual = Field(3, unit="m/s", frame="world", text="of the velocity, by the points that stand")
    vector = Field(3, text="a vector")
    place = Field(("n_contacts", 3), unit="m", frame="world", text="points from the base")
    rate = Field(("n_contacts", 3), unit="m/s", frame="world", text="their velocities from there")
    standing = Field("n_contacts", dtype="bool", text="points that stand at the start")
    weight = Field("n_contacts", unit="", text="trust in each point, 0 to 1")


class LegKinematics(NamedTuple):
    """Places of the contact points: see ``ContactKinematics`` and ``StandingPoints``."""

    bodies: RigidBodies
    contacts: ContactGeometry
    motion: ContactMotion
    points: StandingPoints


class InertialEstimator(Block):
    """The base of estimators that integrate the IMU and are corrected by the legs (paper, II-B).

    ``StateEstimator`` describes how the state is predicted, in contact and in flight, how the legs correct it,
    and where it starts.

    The step of a derived class calls ``predict``, corrects the orientation, weighs the points, and
    ends with ``correct_motion`` and ``publish``.
    """

    Params = InertialParameters
    Constants = InertialConstants
    Scratch = InertialScratch
    needs = ("floating base", "imu", "feet")
    starts_level: ClassVar[bool]
    """True if the first tilt is taken from the contact points; otherwise it is from the accelerometer."""

    params: InertialParameters
    constants: InertialConstants
    scratch: InertialScratch

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="points that carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    estimate = State(BaseEstimate, text="the filter")
    learning = State(BiasSamples, text="samples from which a bias is learnt")

    def setup(self) -> None:
        estimate, scratch = self.estimate, self.scratch
        kinematics = ContactKinematics(self.robot)
        self.legs = LegKinematics(
            kinematics.bodies,
            kinematics.contacts,
            kinematics.motion,
            StandingPoints(
                scratch.place, scratch.rate, self.contacts.active, scratch.weight,
                estimate.anchor, estimate.anchored,
            ),
        )  # fmt: skip

    def prepare(self) -> None:
        constants, period = self.constants, self.period
        constants.period = period
        constants.velocity_gain = -expm1(-self.params.velocity_gain * period)
        constants.position_gain = -expm1(-self.params.position_gain * period)
        constants.tilt_gain = -expm1(-self.params.tilt_gain * period)
        constants.relaxing = -expm1(-period / 0.02)
        constants.filtering = -expm1(-period / 0.02)
        constants.block_size = max(round(0.03 / period), 1)
        constants.longest_mean = max(round(2.0 / period), 1)
        constants.starts_level = self.starts_level
        for axis, angle in enumerate(self.params.slope):
            constants.gradient[axis] = sin(angle) / cos(angle)


@kernel
def predict(
    imu: ImuReading,
    joints: JointState,
    estimate: BaseEstimate,
    legs: LegKinematics,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> float:
    """Take the sample and integrate it over the tick, or start.

    Returns what ``watch_motion`` returns, and zero in the tick in which the filter starts.
    """
    limit(imu.angular_velocity, _FASTEST_TURN, scratch.gyro)
    limit(imu.specific_force, _STRONGEST_FORCE, scratch.force)
    limit(joints.velocity, _FASTEST_JOINT, scratch.joint_rates)
    scratch.force[:] -= estimate.accelerometer_bias
    scratch.last_rate[:] = estimate.angular_velocity
    estimate.angular_velocity[:] = scratch.gyro - estimate.gyro_bias
    if not estimate.started:
        start(joints, estimate, legs, constants, scratch)
        return 0.0
    propagate(
        estimate.orientation, estimate.position, estimate.velocity, scratch.last_rate,
        estimate.angular_velocity, scratch.force, constants.period, scratch.middle,
        scratch.acceleration,
    )  # fmt: skip
    contact_motion(
        legs.bodies, legs.contacts, estimate.orientation, estimate.angular_velocity, joints.position,
        scratch.joint_rates, legs.motion,
    )  # fmt: skip
    return watch_motion(estimate, legs, constants, scratch)


@kernel
def limit(values: Array1D, largest: float, out: Array1D) -> None:
    """Values within plus and minus ``largest``; what is not a number stays so."""
    out[:] = max(min(values, largest), -largest)  # type: ignore[assignment]  # of each element


@kernel
def start(
    joints: JointState,
    estimate: BaseEstimate,
    legs: LegKinematics,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> None:
    """Start with the robot at the origin, its feet heading along x: standing on all points, or in a step."""
    motion, points = legs.motion, legs.points
    error, vector, standing = scratch.error, scratch.vector, scratch.standing
    orientation_from_gravity(scratch.force, estimate.orientation)
    contact_motion(
        legs.bodies, legs.contacts, estimate.orientation, estimate.angular_velocity, joints.position,
        scratch.joint_rates, motion,
    )  # fmt: skip
    count = count_standing(points.active)
    rate = max(largest_of(estimate.angular_velocity), largest_of(scratch.joint_rates))
    stands = count == 0 or rate < STARTING_RATE
    standing[:] = True
    if not stands:
        standing[:] = points.active
    for _ in range(20):
        flat = misalignment(
            estimate.orientation, motion.points, standing, motion.forward, constants.gradient, error,
            vector,
        )  # fmt: skip
        limit(error, 0.2, error)
        if not constants.starts_level:
            error[0] = error[1] = 0.0
        if not flat:
            rotate(estimate.orientation, motion.forward, vector)
            error[2] = max(min(-atan2(vector[1], vector[0]), 0.2), -0.2)
        rotate_in_world(estimate.orientation, error[0], error[1], error[2])
    for foot in range(motion.soles.shape[0]):
        rotate(estimate.orientation, motion.soles[foot], vector)
        estimate.position[:2] -= vector[:2] / motion.soles.shape[0]
    set_point_positions(estimate, legs)
    count = count_standing(standing)
    for point in range(standing.shape[0]):
        if standing[point]:
            place = points.places[point]
            x, y = estimate.position[0] + place[0], estimate.position[1] + place[1]
            height = place[2] - constants.gradient[0] * x - constants.gradient[1] * y
            estimate.position[2] -= height / count
            if not stands:
                estimate.velocity[:] -= points.rates[point] / count
    estimate.mean_joint_rate[:] = 1.0  # it counts as moving until it is seen at rest
    estimate.started = True
    estimate.stood = stands


@kernel
def forget(estimate: BaseEstimate) -> None:
    """Let the next tick be the first one again; what has been learnt of the sensors stays."""
    estimate.started = False
    estimate.position[:] = 0.0
    estimate.velocity[:] = 0.0
    estimate.anchored[:] = False
    estimate.flight_ticks = 0


@kernel
def watch_motion(
    estimate: BaseEstimate,
    legs: LegKinematics,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> float:
    """Low-pass all rates over 20 ms.

    Returns the fastest rate of base and joints [rad/s]; infinite unless all points stand.
    """
    estimate.mean_rate[:] += constants.filtering * (scratch.gyro - estimate.mean_rate)
    estimate.mean_joint_rate[:] += constants.filtering * (
        scratch.joint_rates - estimate.mean_joint_rate
    )
    active = legs.points.active
    if count_standing(active) < active.shape[0]:
        return math.inf
    return max(largest_of(estimate.mean_rate), largest_of(estimate.mean_joint_rate))


@kernel
def largest_of(values: Array1D) -> float:
    """Return the largest magnitude among some values."""
    largest = 0.0
    for i in range(values.shape[0]):
        largest = max(largest, abs(values[i]))
    return largest


@kernel
def count_standing(active: Flags1D) -> int:
    """Count the points in contact."""
    standing = 0
    for point in range(active.shape[0]):
        standing += bool(active[point])
    return standing


@kernel
def is_unaccelerated(force: Array1D) -> bool:
    """Check whether the accelerometer reads about 1 g, so that it shows the vertical."""
    x, y, z = force[0], force[1], force[2]
    return abs(math.sqrt(x * x + y * y + z * z) - GRAVITY) <= 0.1 * GRAVITY


@kernel
def forget_samples(learning: BiasSamples) -> None:
    """Begin a new block of samples, since the robot moves."""
    learning.filled = 0
    learning.held = 0
    learning.filling_sum[:] = 0.0


@kernel
def learn_bias(
    learning: BiasSamples, constants: InertialConstants, bias: Vector3, prior: float
) -> None:
    """Count a sample that has been added to ``filling_sum``, and update the bias (3,).

    A full block of samples counts only once the block after it is full too, so that samples
    from the beginning of a motion, which is noticed late, are left out. The mean starts from
    zero with the weight of ``prior`` [s] of samples: the usual ratio of the variances of noise and
    bias.
    """
    learning.filled += 1
    filled = learning.filled
    if filled < constants.block_size:
        return
    if learning.held > 0:
        learning.samples = min(learning.samples + filled, constants.longest_mean)
        weight = learning.samples + prior / constants.period
        bias[:] += (learning.held_sum - filled * bias) / weight
    learning.held_sum[:] = learning.filling_sum
    learning.filling_sum[:] = 0.0
    learning.held = filled
    learning.filled = 0


@kernel
def set_point_positions(estimate: BaseEstimate, legs: LegKinematics) -> None:
    """Rotate the places and rates of the points to the world, by the corrected orientation."""
    motion, points = legs.motion, legs.points
    for point in range(motion.points.shape[0]):
        rotate(estimate.orientation, motion.points[point], points.places[point])
        rotate(estimate.orientation, motion.rates[point], points.rates[point])


@kernel
def correct_motion(
    estimate: BaseEstimate,
    legs: LegKinematics,
    params: InertialParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
    trusted: float,
    support: float,
) -> None:
    """Correct velocity and position by the points that stand.

    Args:
        trusted: the largest weight of a point.
        support: a factor from 0 to 1 on all corrections by contacts.
    """
    airborne = trusted * support < 0.25 or count_standing(legs.points.active) == 0
    estimate.flight_ticks = estimate.flight_ticks + 1 if airborne else 0
    correct_by_contacts(
        legs.points, support * constants.velocity_gain, support * constants.position_gain,
        estimate.position, estimate.velocity, scratch.residual,
    )  # fmt: skip
    if params.flight == "ballistic":
        fall_freely(estimate, legs, constants, scratch)


@kernel
def publish(estimate: BaseEstimate, base: BaseState) -> None:
    """Publish the pose and the velocity of the base."""
    base.position[:] = estimate.position
    base.linear_velocity[:] = estimate.velocity
    base.angular_velocity[:] = estimate.angular_velocity
    base.orientation[:] = estimate.orientation


@kernel
def fall_freely(
    estimate: BaseEstimate,
    legs: LegKinematics,
    constants: InertialConstants,
    scratch: InertialScratch,
) -> None:
    """Let the centre of mass fall freely in flight, and the base follow from the joints."""
    ticks, velocity, change = estimate.flight_ticks, scratch.vector, scratch.acceleration
    if ticks == 0:
        return
    rotate(estimate.orientation, legs.motion.com_velocity, velocity)
    velocity[:] += estimate.velocity
    velocity[2] += GRAVITY * constants.period * ticks  # as it was at the start of the fall
    change[:] = velocity - estimate.ballistic_velocity
    if ticks <= max(round(0.02 / constants.period), 1):
        estimate.ballistic_velocity[:] += change / ticks
    elif largest_of(change) < _IMPACT * constants.period:
        estimate.velocity[:] -= change
    else:
        estimate.flight_ticks = 0  # keep the velocity by the IMU
