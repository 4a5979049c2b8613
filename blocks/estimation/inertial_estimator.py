"""The common base of the estimators of the floating base that integrate the IMU."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, NamedTuple

from ...mathematics.arrays import Array1D, Flags1D, Vector3
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import cos, sin
from ...mathematics.inertial_filter import (
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
_IMPACT = 0.05
"""A change of the CoM's velocity in one tick [m/s] that ends a free fall."""


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
        0.03, gt=0.0, le=1.0, text="gain of the legs' velocity correction, per tick"
    )
    position_gain: float = live_parameter(
        0.05, gt=0.0, le=1.0, text="gain of the legs' position correction, per tick"
    )
    tilt_gain: float = live_parameter(
        0.002, ge=0.0, le=1.0, text="gain of the accelerometer's tilt correction, per tick"
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
    filtering = Field(unit="", text="share of a change that the low-pass takes over in a tick")
    block_size = Field(dtype="int64", text="samples in a block from which a bias is learnt")
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
    vector = Field(3, text="a vector")
    place = Field(("n_contacts", 3), unit="m", frame="world", text="points from the base")
    rate = Field(("n_contacts", 3), unit="m/s", frame="world", text="their velocities from there")
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
    ends with ``use_contacts``.
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
        constants.filtering = min(period / 0.02, 1.0)
        constants.block_size = max(round(0.03 / period), 1)
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
    """Start with the robot standing at the origin, its feet heading along x."""
    motion, error, vector = legs.motion, scratch.error, scratch.vector
    orientation_from_gravity(scratch.force, estimate.orientation)
    contact_motion(
        legs.bodies, legs.contacts, estimate.orientation, estimate.angular_velocity, joints.position,
        scratch.joint_rates, motion,
    )  # fmt: skip
    for _ in range(20):
        misalignment(
            estimate.orientation, motion.points, motion.forward, constants.gradient, error, vector
        )
        limit(error, 0.2, error)
        if not constants.starts_level:
            error[0] = error[1] = 0.0
        rotate_in_world(estimate.orientation, error[0], error[1], error[2])
    for foot in range(motion.soles.shape[0]):
        rotate(estimate.orientation, motion.soles[foot], vector)
        estimate.position[:2] -= vector[:2] / motion.soles.shape[0]
    for point in range(motion.points.shape[0]):
        rotate(estimate.orientation, motion.points[point], vector)
        x, y = estimate.position[0] + vector[0], estimate.position[1] + vector[1]
        height = vector[2] - constants.gradient[0] * x - constants.gradient[1] * y
        estimate.position[2] -= height / motion.points.shape[0]
    estimate.mean_joint_rate[:] = 1.0  # it counts as moving until it is seen at rest
    estimate.started = True


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
def learn_bias(learning: BiasSamples, block_size: int, bias: Vector3, prior: float) -> None:
    """Count a sample that has been added to ``filling_sum``, and update the bias (3,).

    A full block of samples counts only once the block after it is full too, so that samples
    from the beginning of a motion, which is noticed late, are left out. The mean starts from
    zero with the weight of ``prior`` samples: the usual ratio of the variances of noise and
    bias.
    """
    learning.filled += 1
    filled = learning.filled
    if filled < block_size:
        return
    if learning.held > 0:
        learning.samples = min(learning.samples + filled, 1000)
        bias[:] += (learning.held_sum - filled * bias) / (learning.samples + prior)
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
def use_contacts(
    estimate: BaseEstimate,
    legs: LegKinematics,
    base: BaseState,
    params: InertialParameters,
    constants: InertialConstants,
    scratch: InertialScratch,
    trusted: float,
    support: float,
) -> None:
    """Correct velocity and position by the points that stand, and publish the base's motion.

    Args:
        trusted: the largest weight of a point.
        support: a factor from 0 to 1 on all corrections by contacts.
    """
    airborne = trusted * support < 0.25 or count_standing(legs.points.active) == 0
    estimate.flight_ticks = estimate.flight_ticks + 1 if airborne else 0
    correct_by_contacts(
        legs.points, support * params.velocity_gain, support * params.position_gain,
        estimate.position, estimate.velocity,
    )  # fmt: skip
    if params.flight == "ballistic":
        fall_freely(estimate, legs, constants, scratch)
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
    elif largest_of(change) < _IMPACT:
        estimate.velocity[:] -= change
    else:
        estimate.flight_ticks = 0  # keep the velocity by the IMU
