"""Where the base is and how it moves, from IMU, joint encoders and contacts."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import (
    misalignment,
    propagate,
    right_up,
    stand_on,
    turn,
    upright,
    weigh,
)
from ...mathematics.rotations import rotate, rotate_back, wrap
from ...robots.contact_kinematics import ContactKinematics
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, ContactState, ImuReading, JointState

Array = NDArray[np.float64]

_GRAVITY_UP = np.array([0.0, 0.0, GRAVITY])
_FASTEST_TURN = 100.0
_STRONGEST_FORCE = 1000.0
_FASTEST_JOINT = 1000.0
"""Sensor values are brought within these [rad/s, m/s^2, rad/s], so that nothing can overflow."""
_IMPACT = 0.05
"""A change of the CoM's velocity in one tick [m/s] that ends a free fall."""


class BaseEstimate(Signal):
    """What the state estimator remembers."""

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
    gate = Field(unit="m/s", text="how fast a standing point may seem to move")
    ballistic_velocity = Field(3, unit="m/s", frame="world", text="of the CoM, less gravity's part")
    flight_ticks = Field(dtype="int64", text="ticks since the last trusted contact")
    started = Field(dtype="bool", text="whether the first sample has been seen")
    heading = Field(unit="rad", frame="world", text="where the feet point while they stand")
    flown = Field(dtype="bool", text="whether all points have lost contact since")


class BiasSamples(Signal):
    """Means in the making: the block of samples being filled and the one before it."""

    facing = Field(dtype="bool", text="whether the feet's heading has been noted")
    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")
    samples = Field(dtype="int64", text="samples the mean is made of")
    filled = Field(dtype="int64", text="samples in the block being filled")
    held = Field(dtype="int64", text="samples in the block before, none or a full block")
    filling_sum = Field(3, frame="body", text="of what the learnt bias is the mean of")
    held_sum = Field(3, frame="body", text="of the block before")


class StateEstimator(Block):
    """A complementary filter for the floating base (paper, II-B), ballistic in flight.

    **Prediction.** The gyroscope, less its bias, turns the orientation R; the specific force f,
    less its bias and turned to the world, is integrated to velocity and position::

        R' = R [w]x,   v' = R f + g,   p' = v

    **Correction by the legs.** With r_i(q) a contact point seen from the base, a point at rest in
    the world at a_i says v = -R (J_i q' + w x r_i) and p = a_i - R r_i. Both pull with the gains
    ``velocity_gain`` and ``position_gain`` a tick, so the legs' noise is averaged over 1/gain ticks
    without lag: the IMU carries the motion meanwhile. a_i is latched when the point touches down.

    ``law: complementary`` is the paper's: every point in contact counts the same, the
    accelerometer rights the orientation in contact whenever it reads about 1 g, biases of the
    accelerometer are unknown. ``law: weighted`` (default) adds what decides a jump:

    * A point counts with weight 1 / (1 + (e / gate)^2)^2, e being its speed by the predicted base
      velocity, and no point counts while the IMU feels no support. So slipping feet, heels that
      lift and contacts that a latch still holds after lift-off do not spoil the lift-off velocity.
      ``gate`` opens while everything is rejected and in the air, so a wrong prediction recovers.
    * While all points are in contact and nothing is fast, the feet are flat on level ground: the
      heights of the points give the tilt to the encoder offsets (about 3 mrad; a biased
      accelerometer knows it to 10 mrad), the feet the heading, as long as they stand, and the drift
      of both the gyroscope's bias: a least squares line over up to 250 ticks. Standing still
      before the first flight, what the accelerometer reads beyond gravity is its bias, which would
      be the drift in flight. Where the feet may come to stand at different heights, set
      ``level_ground`` to false: then after a flight only the accelerometer rights the tilt.

    By the paper's law the gyroscope's bias is its mean while the robot stands still.

    **Flight.** With no point trusted the prediction runs alone. ``flight: imu`` integrates the IMU.
    ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms, and from then
    on the CoM falls freely and the base follows from the joints; it does not drift, but it also
    does not feel a push.

    It starts at the first sample, standing on level ground: the world's origin is midway between
    the soles and x is where the feet point. Yaw and horizontal position drift; the ground's height
    is not known after a jump except through the anchors. Never waits, never raises in a run.
    """

    class Params(Parameters):
        law: Literal["weighted", "complementary"] = parameter("weighted", text="see above")
        flight: Literal["imu", "ballistic"] = parameter("imu", text="see above")
        velocity_gain: float = live_parameter(0.03, gt=0.0, le=1.0, text="per tick, of the legs")
        position_gain: float = live_parameter(0.05, gt=0.0, le=1.0, text="per tick, of the legs")
        tilt_gain: float = live_parameter(
            0.002, ge=0.0, le=1.0, text="per tick, of the accelerometer"
        )
        gate: float = live_parameter(
            0.08, unit="m/s", gt=0.0, text="speed at which a point is trusted by a quarter"
        )
        gate_growth: float = live_parameter(
            2.0, unit="m/s^2", ge=0.0, text="how fast it opens while all points are rejected"
        )
        support: float = live_parameter(
            4.0, unit="m/s^2", gt=0.0, text="upward specific force at which contacts count in full"
        )
        level_ground: bool = parameter(
            True, text="all points are at one height whenever all are in contact"
        )
        still_rate: float = live_parameter(
            0.08, unit="rad/s", gt=0.0, text="rate of base and joints below which it stands still"
        )
        slow_rate: float = live_parameter(
            1.5, unit="rad/s", gt=0.0, text="rate below which its feet are surely flat"
        )

    needs = ("floating base", "imu", "feet")
    params: Params

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    estimate = State(BaseEstimate, text="the filter")
    learning = State(BiasSamples, text="what the biases are learnt from")

    def setup(self) -> None:
        robot = self.robot
        self._kinematics = ContactKinematics(robot)
        n = len(robot.contacts)
        self._world_points, self._world_rates = np.zeros((n, 3)), np.zeros((n, 3))
        self._weights = np.zeros(n)
        self._gyro, self._force = np.zeros(3), np.zeros(3)
        self._joint_rates = np.zeros(len(robot.joints))
        self._last_rate, self._error = np.zeros(3), np.zeros(3)
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
        fastest = self._watch_motion() if started else 0.0
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
        self._right(fastest < self.params.still_rate, fastest < self.params.slow_rate)
        seen = self._kinematics
        for point, rate, world_point, world_rate in zip(
            seen.points, seen.rates, self._world_points, self._world_rates, strict=True
        ):
            rotate(estimate.orientation, point, world_point)
            rotate(estimate.orientation, rate, world_rate)
        self._use_contacts()
        if self.params.flight == "ballistic":
            self._fall()
        base.position[...] = estimate.position
        base.orientation[...] = estimate.orientation
        base.linear_velocity[...] = estimate.velocity
        base.angular_velocity[...] = estimate.angular_velocity

    def _watch_motion(self) -> float:
        """Low-pass all rates over 20 ms; the fastest [rad/s], infinite unless all points stand."""
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
        standing = 0
        for point in range(self._weights.shape[0]):
            standing += bool(self.contacts.active[point])
        if standing == 0 and self.learning.aligned[()]:
            estimate.flown[()] = True
            self.learning.facing[()] = False
        if standing < self._weights.shape[0]:
            fastest = math.inf
        return fastest

    def _see_points(self) -> None:
        estimate = self.estimate
        self._kinematics.evaluate(
            estimate.orientation, estimate.angular_velocity, self.joints.position, self._joint_rates
        )

    def _start(self) -> None:
        """Standing on level ground around the origin, the feet pointing along x."""
        estimate, seen = self.estimate, self._kinematics
        upright(self._force, estimate.orientation)
        self._see_points()
        for _ in range(20):
            misalignment(estimate.orientation, seen.points, seen.forward, self._error, self._spare)
            np.clip(self._error, -0.2, 0.2, out=self._error)
            if self.params.law == "complementary":
                self._error[:2] = 0.0
            turn(estimate.orientation, *self._error.tolist())
        for sole in seen.soles:
            rotate(estimate.orientation, sole, self._spare)
            for axis in range(2):
                estimate.position[axis] -= float(self._spare[axis]) / len(seen.soles)
        for point in seen.points:
            rotate(estimate.orientation, point, self._spare)
            estimate.position[2] -= float(self._spare[2]) / len(seen.points)
        estimate.gate[()] = self.params.gate
        estimate.mean_joint_rate.fill(1.0)  # moving, until it is seen not to
        estimate.started[()] = self.learning.facing[()] = True

    def _right(self, still: bool, slow: bool) -> None:
        """Correct the orientation and learn the biases."""
        estimate, weighted = self.estimate, self.params.law == "weighted"
        flown = bool(estimate.flown[()])
        if not (weighted and flown):
            self._learn(still)
        x, y, z = (float(self._force[i]) for i in range(3))
        if abs(math.sqrt(x * x + y * y + z * z) - GRAVITY) > 0.1 * GRAVITY:
            return
        if weighted and slow and (self.params.level_ground or not flown):
            # Least squares over all ticks so far, then over the last 250: angle and its drift.
            self.learning.aligned[()] = ticks = min(int(self.learning.aligned[()]) + 1, 250)
            n = max(ticks, 30)
            angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
            seen = self._kinematics
            misalignment(estimate.orientation, seen.points, seen.forward, self._error, self._spare)
            if not self.learning.facing[()]:
                estimate.heading[()] = -float(self._error[2])
                self.learning.facing[()] = True
            self._error[2] = wrap(float(self._error[2]) + float(estimate.heading))
            np.clip(self._error, -0.05, 0.05, out=self._error)
            rotate_back(estimate.orientation, self._error, self._spare)
            self._spare *= drift_gain / self.period
            estimate.gyro_bias -= self._spare
            self._error *= angle_gain
            turn(estimate.orientation, *self._error.tolist())
        elif still if weighted else bool(self.contacts.active.any()):
            right_up(estimate.orientation, self._force, self.params.tilt_gain, self._spare)

    def _learn(self, still: bool) -> None:
        """The accelerometer's mean beyond gravity; by the paper's law the gyroscope's mean.

        A full block of samples counts only once the block after it is full too, so the beginning
        of a motion, before it is noticed, does not get in. The mean starts from a prior of zero
        with as many samples as the usual ratio of noise to bias is worth.
        """
        estimate, learning = self.estimate, self.learning
        if not still:
            learning.filled[()] = learning.held[()] = 0
            learning.filling_sum.fill(0.0)
            return
        if self.params.law == "weighted":
            bias, prior = estimate.accelerometer_bias, 3.0
            rotate_back(estimate.orientation, _GRAVITY_UP, self._spare)
            learning.filling_sum += self._force
            learning.filling_sum += bias
            learning.filling_sum -= self._spare
        else:
            bias, prior = estimate.gyro_bias, 10.0
            learning.filling_sum += self._gyro
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
        trusted, support = 1.0, 1.0
        if params.law == "weighted":
            gate = float(estimate.gate[()])
            trusted = weigh(self._world_rates, active, estimate.velocity, gate, self._weights)
            rotate(estimate.orientation, self._force, self._spare)
            support = min(max(float(self._spare[2]) / params.support, 0.0), 1.0)
            if not active.any():
                gate += 0.05 * params.gate_growth * self.period
            elif trusted < 0.25:
                gate += params.gate_growth * self.period
            else:
                gate += 0.1 * (params.gate - gate)
            estimate.gate[()] = min(gate, 10.0)
        else:
            self._weights[...] = active
        airborne = trusted * support < 0.25 or not active.any()
        estimate.flight_ticks[()] = int(estimate.flight_ticks[()]) + 1 if airborne else 0
        stand_on(
            self._world_points, self._world_rates, active, self._weights, estimate.anchor,
            estimate.anchored, support * params.velocity_gain, support * params.position_gain,
            estimate.position, estimate.velocity,
        )  # fmt: skip

    def _fall(self) -> None:
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
            estimate.flight_ticks[()] = 0  # the ground: what the IMU has felt stands
