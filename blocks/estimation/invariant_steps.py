"""A tick of the invariant Kalman filter as kernels: samples, prediction, contacts, ground."""

from __future__ import annotations

import math

from ...mathematics.arrays import (
    Array1D,
    Array2D,
    Flags1D,
    Indices1D,
    Matrix3,
    Vector3,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.extended_pose import retract
from ...mathematics.inertial_filter import misalignment, propagate, turn, upright
from ...mathematics.invariant_filter import (
    add_contact,
    add_contact_noise,
    correct,
    height_row,
    innovation,
    input_jacobian,
    measurement_jacobian,
    place_jacobian,
    propagate_covariance,
    remove_contact,
    sample_deviations,
    vector_deviation,
    weigh,
    world_definition_jacobian,
)
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_matrices, multiply_vector
from ...mathematics.rotations import rotate, to_matrix
from .invariant_records import Base, Estimate, Health, Points, Samples, Tuning, Work

_FASTEST_TURN = 100.0
_STRONGEST_FORCE = 1000.0
"""Sensor values are limited to these [rad/s, m/s^2], so that nothing can overflow."""
_START_TURN = 0.05
_START_SPEED = 0.01
_START_PLACE = 0.02
"""Standard deviations at the start [rad, m/s, m], before the feet have been used."""
_EXACT = 1e-5
"""Standard deviation [m] of measurements that hold by the definition of the world frame."""
_OPENING = 1.0
"""Process noise of the velocity while no standing point agrees with it [m/s per root second]."""


@kernel
def take_samples(
    gyro: Vector3,
    force: Vector3,
    position: Array1D,
    foot: Indices1D,
    estimate: Estimate,
    tuning: Tuning,
    samples: Samples,
    work: Work,
    health: Health,
) -> None:
    """Take the readings of the IMU, predict by them, and take the joints' ``position`` (n_joints,).

    ``foot`` (N,) is the foot of every contact point.
    """
    for k in range(3):
        samples.rate[k] = min(max(gyro[k], -_FASTEST_TURN), _FASTEST_TURN)
        samples.force[k] = min(max(force[k], -_STRONGEST_FORCE), _STRONGEST_FORCE)
    find_sample_noise(estimate, tuning, samples, health)
    for k in range(3):
        work.last_rate[k] = estimate.angular_velocity[k]
        rate = float(samples.rate[k]) - float(estimate.gyro_bias[k])
        estimate.angular_velocity[k] = rate
        aliased = tuning.gyro_aliasing * (rate - float(work.last_rate[k]))
        noise = float(samples.noise[k])
        samples.noise[k] = math.sqrt(noise * noise + aliased * aliased)
        samples.force[k] = float(samples.force[k]) - float(estimate.accelerometer_bias[k])
    if estimate.started[()]:
        predict(foot, estimate, tuning, samples, work)
    else:
        upright(samples.force, estimate.orientation)
    for joint in range(position.shape[0]):
        samples.used[joint] = estimate.encoder_offset[joint]
        samples.angles[joint] = position[joint] - float(samples.used[joint])


@kernel
def find_sample_noise(estimate: Estimate, tuning: Tuning, samples: Samples, health: Health) -> None:
    """The noise of this tick's samples for each axis, by whether it is saturated."""
    run = estimate.saturated_run
    turning = sample_deviations(
        samples.rate, tuning.gyro_range, tuning.gyro_noise, tuning.saturated_rate, run[:3],
        samples.noise[:3],
    )  # fmt: skip
    pushing = sample_deviations(
        samples.force, tuning.accelerometer_range, tuning.accelerometer_noise,
        tuning.saturated_force, run[3:], samples.noise[3:],
    )  # fmt: skip
    if turning or pushing:
        estimate.saturated_ticks[()] = int(estimate.saturated_ticks[()]) + 1
    health.gyro_saturated[()] = turning
    health.accelerometer_saturated[()] = pushing
    health.saturated_ticks[()] = int(estimate.saturated_ticks[()])


@kernel
def predict(
    foot: Indices1D, estimate: Estimate, tuning: Tuning, samples: Samples, work: Work
) -> None:
    """Propagate the state and the covariance over the period before this tick."""
    covariance, vectors, period = estimate.covariance, work.middle_vectors, tuning.period
    propagate(
        estimate.orientation, estimate.vectors[1], estimate.vectors[0], work.last_rate,
        estimate.angular_velocity, samples.force, period, work.middle, work.acceleration,
    )  # fmt: skip
    to_matrix(work.middle, work.rotation)
    for k in range(vectors.shape[0]):
        for axis in range(3):
            vectors[k, axis] = estimate.vectors[k, axis]
    for axis in range(3):
        vectors[0, axis] -= 0.5 * period * float(work.acceleration[axis])
        vectors[1, axis] -= 0.5 * period * float(vectors[0, axis])
    input_jacobian(work.rotation, vectors, estimate.present, GRAVITY, period, work.reach)
    bias = 3 + 3 * vectors.shape[0]
    propagate_covariance(
        work.transition, work.reach, bias, samples.noise, covariance, work.scaled, work.product
    )
    x, y, z = float(samples.force[0]), float(samples.force[1]), float(samples.force[2])
    pressed = tuning.impact_slide * max(math.sqrt(x * x + y * y + z * z) - GRAVITY, 0.0)
    slide = math.sqrt(tuning.slide_noise * tuning.slide_noise + pressed * pressed)
    add_contact_noise(foot, estimate.present, tuning.contact_noise, slide, period, covariance)
    for k in range(3):
        walk = tuning.gyro_bias_walk
        covariance[bias + k, bias + k] += walk * walk * period
        walk = tuning.accelerometer_bias_walk
        covariance[bias + 3 + k, bias + 3 + k] += walk * walk * period


@kernel
def use_contacts(
    active: Flags1D,
    estimate: Estimate,
    tuning: Tuning,
    samples: Samples,
    points: Points,
    work: Work,
    health: Health,
    base: Base,
) -> None:
    """Start, or correct by the points that stand, once the kinematics have been evaluated."""
    to_matrix(estimate.orientation, work.rotation)
    if not estimate.started[()]:
        start(estimate, tuning, samples, points, work)
    rotate(estimate.orientation, samples.force, work.spare)
    supported = float(work.spare[2]) >= tuning.support or bool(health.accelerometer_saturated[()])
    refused = agreed = False
    for point in range(active.shape[0]):
        believed = supported and bool(active[point])
        work.believed[point] = believed
        health.trusted[point] = False
        if not estimate.present[point]:
            continue
        if believed:
            measure_point(point, estimate, samples, points, work)
            measurement_jacobian(point, work.sensitivity)
            innovation(point, work.world_point, estimate.vectors, work.residual)
            if weigh_residual(work.place_noise, estimate, work) <= tuning.gate:
                correct_estimate(work.place_noise, estimate, work)
                health.trusted[point] = agreed = True
                continue
            refused = True
        estimate.present[point] = False
        remove_contact(point, estimate.covariance)
    if refused and not agreed:
        for k in range(3, 6):
            estimate.covariance[k, k] += _OPENING * _OPENING * tuning.period
    add_contacts(estimate, samples, points, work)
    if tuning.level or tuning.flat:
        use_ground(estimate, tuning, points, work, health)
    publish(estimate, samples, health, base)


@kernel
def measure_point(
    point: int, estimate: Estimate, samples: Samples, points: Points, work: Work
) -> None:
    """Measure a point's position relative to the base, in the world, and its Jacobian."""
    jacobian = points.jacobians[point]
    multiply_matrices(work.rotation, jacobian, work.world_jacobian)
    # Corrected for changes of the encoder offsets since the kinematics were evaluated.
    for joint in range(work.shift.shape[0]):
        work.shift[joint] = float(estimate.encoder_offset[joint]) - float(samples.used[joint])
    multiply_vector(jacobian, work.shift, work.spare)
    for k in range(3):
        work.spare[k] = float(points.centres[point, k]) - float(work.spare[k])
    multiply_vector(work.rotation, work.spare, work.world_point)
    offsets = estimate.covariance.shape[0] - work.shift.shape[0]
    place_jacobian(work.world_jacobian, offsets, work.sensitivity)


@kernel
def start(estimate: Estimate, tuning: Tuning, samples: Samples, points: Points, work: Work) -> None:
    """Start with the robot standing on level ground at the origin, its feet heading along x."""
    residual, place = work.residual, estimate.vectors[1]
    for _ in range(20):
        misalignment(estimate.orientation, points.places, points.forward, residual, work.spare)
        for k in range(3):
            residual[k] = min(max(float(residual[k]), -0.2), 0.2)
        turn(estimate.orientation, float(residual[0]), float(residual[1]), float(residual[2]))
    to_matrix(estimate.orientation, work.rotation)
    soles, count = points.soles.shape[0], points.radius.shape[0]
    for sole in range(soles):
        rotate(estimate.orientation, points.soles[sole], work.spare)
        for axis in range(2):
            place[axis] -= float(work.spare[axis]) / soles
    for point in range(count):
        rotate(estimate.orientation, points.centres[point], work.spare)
        place[2] += (float(points.radius[point]) - float(work.spare[2])) / count
    bias, size = 9 + 3 * count, estimate.covariance.shape[0]
    for k in range(size):
        deviation = tuning.encoder_offset
        if k < 9:
            deviation = _START_TURN if k < 3 else (_START_SPEED if k < 6 else _START_PLACE)
        elif k < bias:
            deviation = 0.0
        elif k < bias + 6:
            deviation = tuning.gyro_bias if k < bias + 3 else tuning.accelerometer_bias
        estimate.covariance[k, k] = deviation * deviation
    estimate.started[()] = True
    for point in range(count):
        work.believed[point] = True
    add_contacts(estimate, samples, points, work)
    define_world(estimate, tuning, points, work)


@kernel
def define_world(estimate: Estimate, tuning: Tuning, points: Points, work: Work) -> None:
    """Apply the definition of the world frame as measurements: all points are at height zero,
    their mean is the origin, and x is the mean heading of the feet."""
    count = points.radius.shape[0]
    for point in range(count):
        work.standing[point] = point
    for first in range(0, count, 3):
        variance = tuning.ground_noise * tuning.ground_noise
        correct_heights(first, min(first + 3, count), -1, variance, estimate, points, work)
    world_definition_jacobian(points.levers, estimate.vectors, work.sensitivity)
    for row in range(3):
        work.residual[row] = 0.0
        for column in range(3):
            work.row_noise[row, column] = _EXACT * _EXACT if row == column else 0.0
    weigh_residual(work.row_noise, estimate, work)
    correct_estimate(work.row_noise, estimate, work)


@kernel
def add_contacts(estimate: Estimate, samples: Samples, points: Points, work: Work) -> None:
    """Add the points that are trusted and not yet in the state."""
    for point in range(points.radius.shape[0]):
        if not work.believed[point] or estimate.present[point]:
            continue
        measure_point(point, estimate, samples, points, work)
        add_contact(
            point, work.sensitivity, work.place_noise, estimate.covariance, work.rows, work.corner
        )
        for k in range(3):
            place = float(estimate.vectors[1, k]) + float(work.world_point[k])
            estimate.vectors[2 + point, k] = place
        estimate.present[point] = True


@kernel
def use_ground(
    estimate: Estimate, tuning: Tuning, points: Points, work: Work, health: Health
) -> None:
    """Correct by the heights of the points that stand: they are equal, or zero."""
    count, reference = 0, -1
    for point in range(points.radius.shape[0]):
        if not health.trusted[point]:
            continue
        if tuning.level and reference < 0:
            reference = point
            continue
        work.standing[count] = point
        count += 1
    variance = tuning.ground_noise * tuning.ground_noise
    variance *= max(tuning.ground_time / tuning.period, 1.0)
    for first in range(0, count, 3):
        last = min(first + 3, count)
        correct_heights(first, last, reference, variance, estimate, points, work)


@kernel
def correct_heights(
    first: int,
    last: int,
    reference: int,
    variance: float,
    estimate: Estimate,
    points: Points,
    work: Work,
) -> None:
    """Correct by the heights of up to three points, over the reference point or over zero.

    The points are those from ``first`` to before ``last`` in ``work.standing``.
    """
    sensitivity, noise = work.sensitivity, work.row_noise
    for row in range(3):
        work.residual[row] = 0.0
        for k in range(sensitivity.shape[1]):
            sensitivity[row, k] = 0.0
        for column in range(3):
            noise[row, column] = 1.0 if row == column else 0.0
    shared = variance if reference >= 0 else 0.0
    for row in range(last - first):
        point = int(work.standing[first + row])
        height = float(points.radius[point])
        if reference >= 0:
            height -= float(points.radius[reference])
        height_row(row, point, reference, height, estimate.vectors, sensitivity, work.residual)
        for column in range(last - first):
            noise[row, column] = shared + (variance if row == column else 0.0)
    weigh_residual(noise, estimate, work)
    correct_estimate(noise, estimate, work)


@kernel
def weigh_residual(noise: Array2D, estimate: Estimate, work: Work) -> float:
    """The squared Mahalanobis distance of the residual."""
    return weigh(
        estimate.covariance, work.sensitivity, noise, work.residual, work.seen, work.inverse,
        work.corner,
    )  # fmt: skip


@kernel
def correct_estimate(noise: Matrix3, estimate: Estimate, work: Work) -> None:
    """Correct the estimate and its covariance by the residual that has just been weighed."""
    correction, joints = work.correction, estimate.encoder_offset.shape[0]
    correct(
        estimate.covariance, work.sensitivity, noise, work.residual, work.seen, work.inverse,
        work.gain, correction,
    )  # fmt: skip
    offsets = estimate.covariance.shape[0] - joints
    retract(correction, estimate.orientation, estimate.vectors, work.turn, work.spare)
    for k in range(3):
        estimate.gyro_bias[k] += correction[offsets - 6 + k]
        estimate.accelerometer_bias[k] += correction[offsets - 3 + k]
    for joint in range(joints):
        estimate.encoder_offset[joint] += correction[offsets + joint]
    to_matrix(estimate.orientation, work.rotation)


@kernel
def publish(estimate: Estimate, samples: Samples, health: Health, base: Base) -> None:
    """Write the estimate and how far it is to be trusted."""
    covariance, vectors = estimate.covariance, estimate.vectors
    for k in range(3):
        rate = float(samples.rate[k]) - float(estimate.gyro_bias[k])
        estimate.angular_velocity[k] = base.angular_velocity[k] = rate
        base.position[k] = vectors[1, k]
        base.linear_velocity[k] = vectors[0, k]
        base.orientation[k] = estimate.orientation[k]
    base.orientation[3] = estimate.orientation[3]
    health.velocity_std[()] = vector_deviation(covariance, 3, vectors[0])
    health.position_std[()] = vector_deviation(covariance, 6, vectors[1])
    tilted = float(covariance[0, 0]) + float(covariance[1, 1])
    health.tilt_std[()] = math.sqrt(max(tilted, 0.0))
    health.yaw_std[()] = math.sqrt(max(float(covariance[2, 2]), 0.0))
