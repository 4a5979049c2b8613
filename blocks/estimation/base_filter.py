"""What the estimators that integrate the IMU have in common, as kernels: see ``InertialEstimator``."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array1D,
    Flags0D,
    Flags1D,
    Indices0D,
    Vector3,
    Vector4,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import (
    StandingPoints,
    misalignment,
    propagate,
    stand_on,
    turn,
    upright,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate
from ...robots.contact_kinematics import ContactMotion, Contacts, Measured, Rigid, contact_motion

_FASTEST_TURN = 100.0
_STRONGEST_FORCE = 1000.0
_FASTEST_JOINT = 1000.0
"""Sensor values are limited to these [rad/s, m/s^2, rad/s], so that nothing can overflow."""
_IMPACT = 0.05
"""A change of the CoM's velocity in one tick [m/s] that ends a free fall."""


class Sample(NamedTuple):
    """The sensors' sample of a tick, and the same within limits.

    ``angular_velocity``, ``specific_force`` (3,) and ``joint_velocity`` (n_joints,) are inputs;
    ``gyro``, ``force`` and ``joint_rates`` are what the filter uses, ``force`` without its bias.
    """

    angular_velocity: Vector3
    specific_force: Vector3
    joint_velocity: Array1D
    gyro: Vector3
    force: Vector3
    joint_rates: Array1D


class Filter(NamedTuple):
    """The fields of ``BaseEstimate``."""

    position: Vector3
    orientation: Vector4
    velocity: Vector3
    angular_velocity: Vector3
    gyro_bias: Vector3
    accelerometer_bias: Vector3
    mean_rate: Vector3
    mean_joint_rate: Array1D
    ballistic_velocity: Vector3
    flight_ticks: Indices0D
    started: Flags0D


class Learning(NamedTuple):
    """The fields of ``BiasSamples``."""

    samples: Indices0D
    filled: Indices0D
    held: Indices0D
    filling_sum: Vector3
    held_sum: Vector3


class Legs(NamedTuple):
    """The legs' kinematics: see ``ContactKinematics`` and ``StandingPoints``."""

    rigid: Rigid
    contacts: Contacts
    measured: Measured
    seen: ContactMotion
    points: StandingPoints


class Settings(NamedTuple):
    """Parameters that may change during a run, each (1,)."""

    velocity_gain: Array1D
    position_gain: Array1D
    tilt_gain: Array1D
    still_rate: Array1D


class Fixed(NamedTuple):
    """What does not change: the ``period`` [s], the ``watch_share`` of the motion's low-pass, the samples
    of a ``block``, whether the flight is ``ballistic``, and whether the filter ``starts_level``."""

    period: float
    watch_share: float
    block: int
    ballistic: bool
    starts_level: bool


class Scratch(NamedTuple):
    """Memory of a tick: the angular velocity of the tick before, and vectors."""

    last_rate: Vector3
    error: Vector3
    spare: Vector3
    middle: Array1D
    acceleration: Array1D


class Base(NamedTuple):
    """The fields of ``BaseState``."""

    position: Vector3
    orientation: Vector4
    linear_velocity: Vector3
    angular_velocity: Vector3


class Estimator(NamedTuple):
    """All that the kernels of an estimator work on."""

    sample: Sample
    filter: Filter
    learning: Learning
    legs: Legs
    settings: Settings
    fixed: Fixed
    scratch: Scratch
    base: Base


@kernel
def limit(values: Array1D, largest: float, out: Array1D) -> None:
    """Values within plus and minus ``largest``; what is not a number stays so."""
    out[:] = max(min(values, largest), -largest)  # type: ignore[assignment]  # of each element


@kernel
def count_standing(active: Flags1D) -> int:
    """The number of points in contact."""
    standing = 0
    for point in range(active.shape[0]):
        standing += bool(active[point])
    return standing


@kernel
def watch_motion(estimator: Estimator) -> float:
    """Low-pass all rates over 20 ms.

    Returns the fastest rate of base and joints [rad/s]; infinite unless all points stand.
    """
    estimate, sample = estimator.filter, estimator.sample
    share, fastest = estimator.fixed.watch_share, 0.0
    for i in range(3):
        mean = estimate.mean_rate[i]
        mean += share * (sample.gyro[i] - mean)
        estimate.mean_rate[i] = mean
        fastest = max(fastest, abs(mean))
    for i in range(sample.joint_rates.shape[0]):
        mean = estimate.mean_joint_rate[i]
        mean += share * (sample.joint_rates[i] - mean)
        estimate.mean_joint_rate[i] = mean
        fastest = max(fastest, abs(mean))
    active = estimator.legs.points.active
    return fastest if count_standing(active) == active.shape[0] else math.inf


@kernel
def start(estimator: Estimator) -> None:
    """Start with the robot standing on level ground at the origin, its feet heading along x."""
    estimate, scratch, seen = estimator.filter, estimator.scratch, estimator.legs.seen
    error, spare, legs = scratch.error, scratch.spare, estimator.legs
    upright(estimator.sample.force, estimate.orientation)
    contact_motion(legs.rigid, legs.contacts, legs.measured, seen)
    for _ in range(20):
        misalignment(estimate.orientation, seen.points, seen.forward, error, spare)
        limit(error, 0.2, error)
        if not estimator.fixed.starts_level:
            error[0] = error[1] = 0.0
        turn(estimate.orientation, error[0], error[1], error[2])
    for foot in range(seen.soles.shape[0]):
        rotate(estimate.orientation, seen.soles[foot], spare)
        estimate.position[:2] -= spare[:2] / seen.soles.shape[0]
    for point in range(seen.points.shape[0]):
        rotate(estimate.orientation, seen.points[point], spare)
        estimate.position[2] -= spare[2] / seen.points.shape[0]
    for joint in range(estimate.mean_joint_rate.shape[0]):
        estimate.mean_joint_rate[joint] = 1.0  # it counts as moving until it is seen at rest
    estimate.started[()] = True


@kernel
def predict(estimator: Estimator) -> float:
    """Take the sample and integrate it over the tick, or start.

    Returns what ``watch_motion`` returns, and zero in the tick in which the filter starts.
    """
    estimate, sample, scratch = estimator.filter, estimator.sample, estimator.scratch
    legs, fastest = estimator.legs, 0.0
    limit(sample.angular_velocity, _FASTEST_TURN, sample.gyro)
    limit(sample.specific_force, _STRONGEST_FORCE, sample.force)
    limit(sample.joint_velocity, _FASTEST_JOINT, sample.joint_rates)
    started = bool(estimate.started[()])
    if started:
        fastest = watch_motion(estimator)
    sample.force[:] -= estimate.accelerometer_bias
    scratch.last_rate[:] = estimate.angular_velocity
    estimate.angular_velocity[:] = sample.gyro - estimate.gyro_bias
    if started:
        propagate(
            estimate.orientation, estimate.position, estimate.velocity, scratch.last_rate,
            estimate.angular_velocity, sample.force, estimator.fixed.period, scratch.middle,
            scratch.acceleration,
        )  # fmt: skip
        contact_motion(legs.rigid, legs.contacts, legs.measured, legs.seen)
    else:
        start(estimator)
    return fastest


@kernel
def place_points(estimator: Estimator) -> None:
    """Turn the places and rates of the points to the world, by the corrected orientation."""
    seen, points = estimator.legs.seen, estimator.legs.points
    orientation = estimator.filter.orientation
    for point in range(seen.points.shape[0]):
        rotate(orientation, seen.points[point], points.places[point])
        rotate(orientation, seen.rates[point], points.rates[point])


@kernel
def is_unaccelerated(force: Array1D) -> bool:
    """Whether the accelerometer reads about 1 g, so that it shows the vertical."""
    x, y, z = force[0], force[1], force[2]
    return abs(math.sqrt(x * x + y * y + z * z) - GRAVITY) <= 0.1 * GRAVITY


@kernel
def forget_samples(learning: Learning) -> None:
    """Begin a new block of samples, since the robot moves."""
    learning.filled[()] = learning.held[()] = 0
    learning.filling_sum[:] = 0.0


@kernel
def learn_bias(learning: Learning, block: int, bias: Vector3, prior: float) -> None:
    """Count a sample that has been added to ``filling_sum``, and update the bias (3,).

    A full block of samples counts only once the block after it is full too, so that samples
    from the beginning of a motion, which is noticed late, are left out. The mean starts from
    zero with the weight of ``prior`` samples: the usual ratio of the variances of noise and
    bias.
    """
    filled = learning.filled[()] + 1
    learning.filled[()] = filled
    if filled < block:
        return
    if learning.held[()] > 0:
        samples = min(learning.samples[()] + filled, 1000)
        learning.samples[()] = samples
        bias[:] += (learning.held_sum - filled * bias) / (samples + prior)
    learning.held_sum[:] = learning.filling_sum
    learning.filling_sum[:] = 0.0
    learning.held[()], learning.filled[()] = filled, 0


@kernel
def fall_freely(estimator: Estimator) -> None:
    """In flight, let the centre of mass fall freely and the base follow from the joints."""
    estimate, scratch, period = estimator.filter, estimator.scratch, estimator.fixed.period
    ticks, fall, change = estimate.flight_ticks[()], scratch.spare, scratch.acceleration
    if ticks == 0:
        return
    average = max(round(0.02 / period), 1)
    rotate(estimate.orientation, estimator.legs.seen.com_velocity, fall)
    largest = 0.0
    for axis in range(3):
        fall[axis] += estimate.velocity[axis]
        if axis == 2:
            fall[axis] += GRAVITY * period * ticks
        change[axis] = fall[axis] - estimate.ballistic_velocity[axis]
        largest = max(largest, abs(change[axis]))
    if ticks <= average:
        for axis in range(3):
            estimate.ballistic_velocity[axis] += change[axis] / ticks
    elif largest < _IMPACT:
        for axis in range(3):
            estimate.velocity[axis] -= change[axis]
    else:
        estimate.flight_ticks[()] = 0  # an impact: keep the velocity by the IMU


@kernel
def use_contacts(estimator: Estimator, trusted: float, support: float) -> None:
    """Correct velocity and position by the points that stand, and publish the base's motion.

    Args:
        trusted: the largest weight of a point.
        support: a factor from 0 to 1 on all corrections by contacts.
    """
    estimate, settings, base = estimator.filter, estimator.settings, estimator.base
    points = estimator.legs.points
    airborne = trusted * support < 0.25 or count_standing(points.active) == 0
    estimate.flight_ticks[()] = estimate.flight_ticks[()] + 1 if airborne else 0
    stand_on(
        points, support * settings.velocity_gain[0],
        support * settings.position_gain[0], estimate.position, estimate.velocity,
    )  # fmt: skip
    if estimator.fixed.ballistic:
        fall_freely(estimator)
    base.position[:] = estimate.position
    base.linear_velocity[:] = estimate.velocity
    base.angular_velocity[:] = estimate.angular_velocity
    base.orientation[:] = estimate.orientation
