"""Estimates the base's pose and velocity by an invariant Kalman filter with contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.extended_pose import retract
from ...mathematics.inertial_filter import misalignment, propagate, turn, upright
from ...mathematics.invariant_contacts import (
    add_contact,
    add_contact_noise,
    height_row,
    innovation,
    measurement_jacobian,
    place_jacobian,
    remove_contact,
    world_definition_jacobian,
)
from ...mathematics.invariant_propagation import (
    error_transition,
    input_jacobian,
    propagate_covariance,
    sample_deviations,
    vector_deviation,
)
from ...mathematics.kalman_update import correct, weigh
from ...mathematics.rotations import rotate, to_matrix
from ...robots.contact_kinematics import ContactKinematics
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters
from ..signals import BaseState, ContactState, EstimatorHealth, ImuReading, JointState
from .invariant_estimate import InvariantEstimate, InvariantFilterParameters

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


class InvariantKalmanFilter(Block):
    """A contact-aided right-invariant extended Kalman filter (Hartley et al. 2020).

    Same ports as ``StateEstimator``: ``set: {estimator.use: blocks.InvariantKalmanFilter}``.

    **State.** X = (R, v, p, d_1 .. d_N) on SE_{2+N}(3): the base's orientation, velocity and
    position and the contact points that stand on the ground; the biases of gyroscope and
    accelerometer; and the offsets of the joint encoders, which limit the accuracy on a robot whose
    offsets are larger than its encoder noise. The error is xi = log(X_est X^-1).

    **Prediction.** The state is propagated by the IMU, as in ``StateEstimator``, and the covariance
    by a transition that does not depend on the trajectory (``invariant_propagation``). In flight
    there is only the prediction.

    **Contacts.** A point that is reported active, while the IMU measures support, is added to the
    state at the position that leg kinematics measure. From then on it stands still except for the
    process noise ``contact_noise`` of the point and that of its foot,
    sqrt(slide_noise^2 + (impact_slide (|f| - g))^2), because feet slide a little at impacts and
    hard pushes. The measurement update is R h(q) + p - d = 0. If a residual is too unlikely
    (``gate``, chi-squared with three degrees of freedom) the point has slipped or lifted: it is
    removed from the state and added again at its present position, so that nothing is learnt from
    it. While all points are rejected, process noise is added to the velocity until one is accepted.

    **Ground.** With ``level`` all points that stand are at one height, with ``flat`` at the height
    zero of the start; ``unknown`` assumes nothing. Errors of the height are correlated in time, so
    the heights count as one measurement per ``ground_time``, not per tick.

    **Saturation.** A sample at the end of the given range is a bound, not a value. Its axis has the
    standard deviation ``saturated_rate`` or ``saturated_force``, so the covariance grows as it
    should, and other measurements get more weight. A rate that is saturated in flight is not known
    at all; ``health`` reports that.

    It starts at the first sample, with the robot standing on level ground: the world's origin is
    midway between the soles and x is the heading of the feet. Yaw and horizontal position drift
    from jump to jump. The block never waits and raises no errors in a run.
    """

    Params = InvariantFilterParameters
    needs = ("floating base", "imu", "feet")
    params: InvariantFilterParameters

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    health = Output(EstimatorHealth, text="standard deviations of the estimate")
    estimate = State(InvariantEstimate, text="the filter")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """The vectors of the state and the size of the error."""
        assert robot is not None
        n = len(robot.contacts)
        return {"n_vectors": 2 + n, "n_errors": 15 + 3 * n + len(robot.joints)}

    def setup(self) -> None:
        """The robot's kinematics, constant matrices and scratch memory."""
        robot, params = self.robot, self.params
        self._kinematics = ContactKinematics(robot)
        self._points, n_joints = len(robot.contacts), len(robot.joints)
        self._radius = [contact.radius for contact in robot.contacts]
        self._foot_of_point = np.array(robot.foot_of_contact(), dtype=np.int64)
        self._bias = 9 + 3 * self._points
        self._offsets = self._bias + 6
        n = self._offsets + n_joints
        self._transition = np.zeros((n, n))
        error_transition(GRAVITY, self.period, self._transition)
        self._reach, self._scaled = np.zeros((n, 6)), np.zeros((n, 6))
        self._product, self._correction = np.zeros((n, n)), np.zeros(n)
        self._sensitivity, self._rows = np.zeros((3, n)), np.zeros((3, n))
        self._seen, self._gain = np.zeros((n, 3)), np.zeros((n, 3))
        self._inverse, self._corner = np.zeros((3, 3)), np.zeros((3, 3))
        self._noise, self._residual = np.zeros(6), np.zeros(3)
        self._place_noise = params.kinematics_noise**2 * np.eye(3)
        self._row_noise, self._identity = np.eye(3), np.eye(3)
        self._rotation = np.zeros((3, 3))
        self._middle_vectors = np.zeros((2 + self._points, 3))
        self._world_jacobian = np.zeros((3, n_joints))
        self._world_point, self._spare = np.zeros(3), np.zeros(3)
        self._turn, self._middle, self._acceleration = np.zeros(4), np.zeros(4), np.zeros(3)
        self._angles, self._rates = np.zeros(n_joints), np.zeros(n_joints)
        self._used_offset = np.zeros(n_joints)
        self._gyro, self._force, self._last_rate = np.zeros(3), np.zeros(3), np.zeros(3)
        self._believed = np.zeros(self._points, dtype=np.bool_)

    def step(self) -> None:
        estimate, params = self.estimate, self.params
        np.clip(self.imu.angular_velocity, -_FASTEST_TURN, _FASTEST_TURN, out=self._gyro)
        np.clip(self.imu.specific_force, -_STRONGEST_FORCE, _STRONGEST_FORCE, out=self._force)
        self._find_sample_noise()
        self._last_rate[...] = estimate.angular_velocity
        np.subtract(self._gyro, estimate.gyro_bias, out=estimate.angular_velocity)
        for axis in range(3):
            change = float(estimate.angular_velocity[axis]) - float(self._last_rate[axis])
            self._noise[axis] = math.hypot(float(self._noise[axis]), params.gyro_aliasing * change)
        np.subtract(self._force, estimate.accelerometer_bias, out=self._force)
        if estimate.started[()]:
            self._predict()
            self._evaluate_kinematics()
        else:
            self._start()
        self._use_contacts()
        if params.ground != "unknown":
            self._use_ground()
        np.subtract(self._gyro, estimate.gyro_bias, out=estimate.angular_velocity)
        self._publish()

    def _find_sample_noise(self) -> None:
        """Compute the noise of this tick's samples for each axis, by whether it is saturated."""
        params, health, run = self.params, self.health, self.estimate.saturated_run
        health.gyro_saturated[()] = sample_deviations(
            self._gyro, params.gyro_range or math.inf, params.gyro_noise, params.saturated_rate,
            run[:3], self._noise[:3],
        )  # fmt: skip
        health.accelerometer_saturated[()] = sample_deviations(
            self._force, params.accelerometer_range or math.inf, params.accelerometer_noise,
            params.saturated_force, run[3:], self._noise[3:],
        )  # fmt: skip
        if health.gyro_saturated[()] or health.accelerometer_saturated[()]:
            self.estimate.saturated_ticks += 1
        health.saturated_ticks[()] = self.estimate.saturated_ticks

    def _predict(self) -> None:
        estimate, params, period = self.estimate, self.params, self.period
        covariance = estimate.covariance
        propagate(
            estimate.orientation, estimate.vectors[1], estimate.vectors[0], self._last_rate,
            estimate.angular_velocity, self._force, period, self._middle, self._acceleration,
        )  # fmt: skip
        to_matrix(self._middle, self._rotation)
        vectors = self._middle_vectors
        vectors[...] = estimate.vectors
        for axis in range(3):
            gained = 0.5 * period * float(self._acceleration[axis])
            vectors[0, axis] -= gained
            vectors[1, axis] -= 0.5 * period * float(vectors[0, axis])
        input_jacobian(self._rotation, vectors, estimate.present, GRAVITY, period, self._reach)
        propagate_covariance(
            self._transition, self._reach, self._bias, self._noise, covariance,
            self._scaled, self._product,
        )  # fmt: skip
        pressed = max(math.hypot(*self._force.tolist()) - GRAVITY, 0.0)
        slide = math.hypot(params.slide_noise, params.impact_slide * pressed)
        add_contact_noise(
            self._foot_of_point, estimate.present, params.contact_noise, slide, period, covariance
        )
        for first, walk in (
            (self._bias, params.gyro_bias_walk), (self._bias + 3, params.accelerometer_bias_walk),
        ):  # fmt: skip
            for k in range(first, first + 3):
                covariance[k, k] += walk * walk * period

    def _evaluate_kinematics(self) -> None:
        """Evaluate the leg kinematics at the joint readings minus the estimated offsets."""
        estimate, seen = self.estimate, self._kinematics
        self._used_offset[...] = estimate.encoder_offset
        np.subtract(self.joints.position, self._used_offset, out=self._angles)
        seen.evaluate(estimate.orientation, estimate.angular_velocity, self._angles, self._rates)
        seen.differentiate()
        to_matrix(estimate.orientation, self._rotation)

    def _measure_point(self, point: int) -> None:
        """Measure a point's position relative to the base, in the world, and its Jacobian."""
        estimate = self.estimate
        np.dot(self._rotation, self._kinematics.jacobians[point], out=self._world_jacobian)
        # Corrected for changes of the encoder offsets since the kinematics were evaluated.
        np.subtract(estimate.encoder_offset, self._used_offset, out=self._angles)
        np.dot(self._kinematics.jacobians[point], self._angles, out=self._spare)
        np.subtract(self._kinematics.centres[point], self._spare, out=self._spare)
        np.dot(self._rotation, self._spare, out=self._world_point)
        place_jacobian(self._world_jacobian, self._offsets, self._sensitivity)

    def _start(self) -> None:
        """Start with the robot standing on level ground at the origin, its feet heading along x."""
        estimate, params, seen = self.estimate, self.params, self._kinematics
        upright(self._force, estimate.orientation)
        self._evaluate_kinematics()
        for _ in range(20):
            misalignment(
                estimate.orientation, seen.points, seen.forward, self._residual, self._spare
            )
            np.clip(self._residual, -0.2, 0.2, out=self._residual)
            turn(estimate.orientation, *self._residual.tolist())
        to_matrix(estimate.orientation, self._rotation)
        position = estimate.vectors[1]
        for sole in seen.soles:
            rotate(estimate.orientation, sole, self._spare)
            for axis in range(2):
                position[axis] -= float(self._spare[axis]) / len(seen.soles)
        for point in range(self._points):
            rotate(estimate.orientation, seen.centres[point], self._spare)
            position[2] += (self._radius[point] - float(self._spare[2])) / self._points
        for first, last, deviation_at_start in (
            (0, 3, _START_TURN), (3, 6, _START_SPEED), (6, 9, _START_PLACE),
            (self._bias, self._bias + 3, params.gyro_bias),
            (self._bias + 3, self._offsets, params.accelerometer_bias),
            (self._offsets, estimate.covariance.shape[0], params.encoder_offset),
        ):  # fmt: skip
            for k in range(first, last):
                estimate.covariance[k, k] = deviation_at_start * deviation_at_start
        estimate.started[()] = True
        self._believed.fill(True)
        self._add_contacts()
        self._define_world()

    def _define_world(self) -> None:
        """Apply the definition of the world frame as measurements: all points are at height zero,
        their mean is the origin, and x is the mean heading of the feet."""
        n, vectors = self._points, self.estimate.vectors
        for first in range(0, n, 3):
            self._correct_heights(range(first, min(first + 3, n)), -1, self.params.ground_noise**2)
        world_definition_jacobian(self._kinematics.heading_levers, vectors, self._sensitivity)
        self._residual.fill(0.0)
        np.multiply(self._identity, _EXACT * _EXACT, out=self._row_noise)
        self._weigh(self._row_noise)
        self._correct(self._row_noise)

    def _use_contacts(self) -> None:
        """Correct by the points that stand; add those that touch down, remove those that leave."""
        estimate, params, trusted = self.estimate, self.params, self.health.trusted
        rotate(estimate.orientation, self._force, self._spare)
        supported = float(self._spare[2]) >= params.support
        supported = supported or bool(self.health.accelerometer_saturated[()])
        refused = agreed = False
        for point in range(self._points):
            believed = supported and bool(self.contacts.active[point])
            self._believed[point] = believed
            trusted[point] = False
            if not estimate.present[point]:
                continue
            if believed:
                self._measure_point(point)
                measurement_jacobian(point, self._sensitivity)
                innovation(point, self._world_point, estimate.vectors, self._residual)
                if self._weigh(self._place_noise) <= params.gate:
                    self._correct(self._place_noise)
                    trusted[point] = agreed = True
                    continue
                refused = True
            estimate.present[point] = False
            remove_contact(point, estimate.covariance)
        if refused and not agreed:
            for k in range(3, 6):
                estimate.covariance[k, k] += _OPENING * _OPENING * self.period
        self._add_contacts()

    def _add_contacts(self) -> None:
        """Add the points that are trusted and not yet in the state."""
        estimate = self.estimate
        for point in range(self._points):
            if not self._believed[point] or estimate.present[point]:
                continue
            self._measure_point(point)
            add_contact(
                point, self._sensitivity, self._place_noise, estimate.covariance,
                self._rows, self._corner,
            )  # fmt: skip
            np.add(estimate.vectors[1], self._world_point, out=estimate.vectors[2 + point])
            estimate.present[point] = True

    def _use_ground(self) -> None:
        """Correct by the heights of the points that stand: they are equal, or zero."""
        params, reference = self.params, -1
        standing = [point for point in range(self._points) if self.health.trusted[point]]
        if params.ground == "level" and standing:
            reference = standing.pop(0)
        variance = params.ground_noise**2 * max(params.ground_time / self.period, 1.0)
        for first in range(0, len(standing), 3):
            self._correct_heights(standing[first : first + 3], reference, variance)

    def _correct_heights(self, points: Sequence[int], reference: int, variance: float) -> None:
        """Correct by the heights of up to three points, over the reference point or over zero."""
        self._sensitivity.fill(0.0)
        self._residual.fill(0.0)
        vectors, noise = self.estimate.vectors, self._row_noise
        np.copyto(noise, self._identity)
        for row, point in enumerate(points):
            height = self._radius[point]
            if reference >= 0:
                height -= self._radius[reference]
            height_row(row, point, reference, height, vectors, self._sensitivity, self._residual)
            for column in range(len(points)):
                shared = variance if reference >= 0 else 0.0
                noise[row, column] = shared + (variance if row == column else 0.0)
        self._weigh(noise)
        self._correct(noise)

    def _weigh(self, noise: Array) -> float:
        """The squared Mahalanobis distance of the residual."""
        return weigh(
            self.estimate.covariance, self._sensitivity, noise, self._residual,
            self._seen, self._inverse, self._corner,
        )  # fmt: skip

    def _correct(self, noise: Array) -> None:
        """Correct the estimate and its covariance by the residual that has just been weighed."""
        estimate, correction = self.estimate, self._correction
        correct(
            estimate.covariance, self._sensitivity, noise, self._residual,
            self._seen, self._inverse, self._gain, self._product, correction,
        )  # fmt: skip
        bias, offsets = self._bias, self._offsets
        retract(correction, estimate.orientation, estimate.vectors, self._turn, self._spare)
        estimate.gyro_bias += correction[bias : bias + 3]
        estimate.accelerometer_bias += correction[bias + 3 : offsets]
        estimate.encoder_offset += correction[offsets:]
        to_matrix(estimate.orientation, self._rotation)

    def _publish(self) -> None:
        estimate, base, health = self.estimate, self.base, self.health
        np.subtract(self._gyro, estimate.gyro_bias, out=estimate.angular_velocity)
        base.position[...] = estimate.vectors[1]
        base.orientation[...] = estimate.orientation
        base.linear_velocity[...] = estimate.vectors[0]
        base.angular_velocity[...] = estimate.angular_velocity
        covariance, vectors = estimate.covariance, estimate.vectors
        health.velocity_std[()] = vector_deviation(covariance, 3, vectors[0])
        health.position_std[()] = vector_deviation(covariance, 6, vectors[1])
        tilt = float(covariance[0, 0]) + float(covariance[1, 1])
        health.tilt_std[()] = math.sqrt(max(tilt, 0.0))
        health.yaw_std[()] = math.sqrt(max(float(covariance[2, 2]), 0.0))
