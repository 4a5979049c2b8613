"""The common base of the estimators of the floating base that integrate the IMU."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import (
    StandingPoints,
    misalignment,
    propagate,
    stand_on,
    turn,
    upright,
)
from ...mathematics.rotations import rotate
from ...robots.contact_kinematics import ContactKinematics
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, ContactState, ImuReading, JointState

Array = NDArray[np.float64]

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
    anchor = Field(("n_contacts", 3), unit="m", frame="world", text="where the points stand")
    anchored = Field("n_contacts", dtype="bool", text="which points have an anchor")
    ballistic_velocity = Field(
        3, unit="m/s", frame="world", text="velocity of the CoM at the start of the free fall"
    )
    flight_ticks = Field(dtype="int64", text="ticks since the last trusted contact")
    started = Field(dtype="bool", text="whether the first sample has been seen")


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


class InertialEstimator(Block):
    """The base of estimators that integrate the IMU and are corrected by the legs (paper, II-B).

    **Prediction.** The angular velocity w, which is the gyroscope minus its bias, is integrated to
    the orientation R. The specific force f, which is the accelerometer minus its bias, is rotated
    to the world and integrated to velocity and position::

        R' = R [w]x,   v' = R f + g,   p' = v

    **Correction by the legs.** Let r_i(q) be a contact point relative to the base. If the point is
    at rest in the world at a_i, then v = -R (J_i q' + w x r_i) and p = a_i - R r_i. The estimate is
    corrected towards both with the gains ``velocity_gain`` and ``position_gain`` per tick, so the
    legs' noise is averaged over 1/gain ticks; there is no lag, because the IMU predicts the motion
    meanwhile. a_i is set when the point touches down.

    **Flight.** While no point is trusted there is only the prediction. ``flight: imu`` integrates
    the IMU. ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms; from
    then on the CoM falls freely, and the base follows from the joints. That does not drift, but it
    also does not notice a push.

    It starts at the first sample, with the robot standing on level ground: the world's origin is
    midway between the soles, and x is the heading of the feet; for feet of one contact point it is
    the heading of the pattern in which they stand.

    A derived class says how the orientation is corrected and how far each point is trusted.
    """

    Params = InertialParameters
    needs = ("floating base", "imu", "feet")
    starts_level: ClassVar[bool]
    """Whether the first tilt is taken from the contact points; otherwise from the accelerometer."""

    params: InertialParameters

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    estimate = State(BaseEstimate, text="the filter")
    learning = State(BiasSamples, text="what a bias is learnt from")

    @abstractmethod
    def correct_orientation(self, fastest: float) -> None:
        """Correct the orientation and learn biases.

        Args:
            fastest: the largest low-passed rate of base and joints [rad/s]; infinite unless all
                points stand.
        """

    @abstractmethod
    def trust_points(self) -> tuple[float, float]:
        """Write the weight of every point.

        Returns the largest weight, and a factor from 0 to 1 on all corrections by contacts.
        """

    def setup(self) -> None:
        robot = self.robot
        self._kinematics = ContactKinematics(robot)
        n = len(robot.contacts)
        self._world_points, self._world_rates = np.zeros((n, 3)), np.zeros((n, 3))
        self._weights = np.zeros(n)
        estimate = self.estimate
        self._points = StandingPoints(
            self._world_points, self._world_rates, self.contacts.active, self._weights,
            estimate.anchor, estimate.anchored,
        )  # fmt: skip
        self._gyro, self._force = np.zeros(3), np.zeros(3)
        self._joint_rates = np.zeros(len(robot.joints))
        self._last_rate, self._error = np.zeros(3), np.zeros(3)
        self._standing = 0
        self._spare, self._middle = np.zeros(3), np.zeros(4)
        self._acceleration = np.zeros(3)
        self._watch_share = min(self.period / 0.02, 1.0)
        self._block = max(round(0.03 / self.period), 1)

    def step(self) -> None:
        estimate, base = self.estimate, self.base
        np.clip(self.imu.angular_velocity, -_FASTEST_TURN, _FASTEST_TURN, out=self._gyro)
        np.clip(self.imu.specific_force, -_STRONGEST_FORCE, _STRONGEST_FORCE, out=self._force)
        np.clip(self.joints.velocity, -_FASTEST_JOINT, _FASTEST_JOINT, out=self._joint_rates)
        started = bool(estimate.started[()])
        fastest = self.watch_motion() if started else 0.0
        self._force -= estimate.accelerometer_bias
        self._last_rate[...] = estimate.angular_velocity
        np.subtract(self._gyro, estimate.gyro_bias, out=estimate.angular_velocity)
        if started:
            propagate(
                estimate.orientation, estimate.position, estimate.velocity, self._last_rate,
                estimate.angular_velocity, self._force, self.period, self._middle,
                self._acceleration,
            )  # fmt: skip
            self._see_points()
        else:
            self._start()
        self.correct_orientation(fastest)
        seen = self._kinematics
        for point, rate, world_point, world_rate in zip(
            seen.points, seen.rates, self._world_points, self._world_rates, strict=True
        ):
            rotate(estimate.orientation, point, world_point)
            rotate(estimate.orientation, rate, world_rate)
        self._use_contacts()
        if self.params.flight == "ballistic":
            self._integrate_free_fall()
        base.position[...] = estimate.position
        base.orientation[...] = estimate.orientation
        base.linear_velocity[...] = estimate.velocity
        base.angular_velocity[...] = estimate.angular_velocity

    def watch_motion(self) -> float:
        """Low-pass all rates over 20 ms.

        Returns the fastest rate of base and joints [rad/s]; infinite unless all points stand.
        """
        estimate, share, fastest = self.estimate, self._watch_share, 0.0
        for i in range(3):
            mean = float(estimate.mean_rate[i])
            estimate.mean_rate[i] = mean = mean + share * (float(self._gyro[i]) - mean)
            fastest = max(fastest, abs(mean))
        for i in range(self._joint_rates.shape[0]):
            mean = float(estimate.mean_joint_rate[i])
            mean += share * (float(self._joint_rates[i]) - mean)
            estimate.mean_joint_rate[i] = mean
            fastest = max(fastest, abs(mean))
        self._standing = 0
        for point in range(self._weights.shape[0]):
            self._standing += bool(self.contacts.active[point])
        return fastest if self._standing == self._weights.shape[0] else math.inf

    def _see_points(self) -> None:
        estimate = self.estimate
        self._kinematics.evaluate(
            estimate.orientation, estimate.angular_velocity, self.joints.position, self._joint_rates
        )

    def _start(self) -> None:
        """Start with the robot standing on level ground at the origin, its feet heading along x."""
        estimate, seen = self.estimate, self._kinematics
        upright(self._force, estimate.orientation)
        self._see_points()
        for _ in range(20):
            misalignment(estimate.orientation, seen.points, seen.forward, self._error, self._spare)
            np.clip(self._error, -0.2, 0.2, out=self._error)
            if not self.starts_level:
                self._error[:2] = 0.0
            turn(estimate.orientation, *self._error.tolist())
        for sole in seen.soles:
            rotate(estimate.orientation, sole, self._spare)
            for axis in range(2):
                estimate.position[axis] -= float(self._spare[axis]) / len(seen.soles)
        for point in seen.points:
            rotate(estimate.orientation, point, self._spare)
            estimate.position[2] -= float(self._spare[2]) / len(seen.points)
        estimate.mean_joint_rate.fill(1.0)  # the robot counts as moving until it is seen at rest
        estimate.started[()] = True

    def is_unaccelerated(self) -> bool:
        """Whether the accelerometer reads about 1 g, so that it shows the vertical."""
        x, y, z = (float(self._force[i]) for i in range(3))
        return abs(math.sqrt(x * x + y * y + z * z) - GRAVITY) <= 0.1 * GRAVITY

    def forget_samples(self) -> None:
        """Begin a new block of samples, since the robot moves."""
        self.learning.filled[()] = self.learning.held[()] = 0
        self.learning.filling_sum.fill(0.0)

    def learn_bias(self, bias: Array, prior: float) -> None:
        """Count a sample that has been added to ``filling_sum``, and update the bias (3,).

        A full block of samples counts only once the block after it is full too, so that samples
        from the beginning of a motion, which is noticed late, are left out. The mean starts from
        zero with the weight of ``prior`` samples: the usual ratio of the variances of noise and
        bias.
        """
        learning = self.learning
        learning.filled[()] = filled = int(learning.filled[()]) + 1
        if filled < self._block:
            return
        if learning.held[()]:
            learning.samples[()] = samples = min(int(learning.samples[()]) + filled, 1000)
            for i in range(3):
                excess = float(learning.held_sum[i]) - filled * float(bias[i])
                bias[i] += excess / (samples + prior)
        learning.held_sum[...] = learning.filling_sum
        learning.filling_sum.fill(0.0)
        learning.held[()], learning.filled[()] = filled, 0

    def _use_contacts(self) -> None:
        """Correct velocity and position by the points that stand."""
        estimate, params, active = self.estimate, self.params, self.contacts.active
        trusted, support = self.trust_points()
        airborne = trusted * support < 0.25 or not active.any()
        estimate.flight_ticks[()] = int(estimate.flight_ticks[()]) + 1 if airborne else 0
        stand_on(
            self._points, support * params.velocity_gain, support * params.position_gain,
            estimate.position, estimate.velocity,
        )  # fmt: skip

    def _integrate_free_fall(self) -> None:
        """In flight, let the centre of mass fall freely and the base follow from the joints."""
        estimate, ticks = self.estimate, int(self.estimate.flight_ticks[()])
        if ticks == 0:
            return
        average = max(round(0.02 / self.period), 1)
        rotate(estimate.orientation, self._kinematics.com_velocity, self._spare)
        fallen = -GRAVITY * self.period * ticks
        self._spare += estimate.velocity
        self._spare[2] -= fallen
        np.subtract(self._spare, estimate.ballistic_velocity, out=self._acceleration)
        if ticks <= average:
            self._acceleration /= ticks
            estimate.ballistic_velocity += self._acceleration
        elif np.abs(self._acceleration, out=self._error).max() < _IMPACT:
            estimate.velocity -= self._acceleration
        else:
            estimate.flight_ticks[()] = 0  # an impact: keep the velocity by the IMU
