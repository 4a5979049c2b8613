"""Where the base is and how it moves, from IMU, joint encoders and contacts."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..runtime.block import Block, Input, Output, State
from ..runtime.errors import BlockError
from ..runtime.parameters import Parameters, parameter
from ..runtime.signals import Field, Signal
from .inertial_filter import (
    GRAVITY,
    misalignment,
    propagate,
    right_up,
    stand_on,
    turn,
    upright,
    weigh,
)
from .pinocchio_model import build_pinocchio_model
from .rotations import cross, rotate, rotate_back
from .signals import BaseState, ContactState, ImuReading, JointState

Array = NDArray[np.float64]

_DOWN = np.array([0.0, 0.0, -1.0])
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
    flown = Field(dtype="bool", text="whether all points have lost contact since")


class BiasSamples(Signal):
    """Means in the making: the block of samples being filled and the one before it."""

    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")
    samples = Field(dtype="int64", text="samples the means are made of")
    filled = Field(dtype="int64", text="samples in the block being filled")
    held = Field(dtype="int64", text="samples in the block before, none or a full block")
    filling_sum = Field((2, 3), text="of angular velocity [rad/s] and excess force [m/s^2], body")
    held_sum = Field((2, 3), text="of the block before")


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
    * Until it first leaves the ground the robot stands on level ground with its feet along x. While
      all points are in contact and nothing is fast, the heights of the points and the headings of
      the feet give the orientation to the encoder offsets (about 3 mrad; a biased accelerometer
      knows it to 10 mrad), and its drift the gyroscope's bias, both as a least squares line over
      up to 250 ticks; and when it is still, what the accelerometer reads beyond gravity is its
      bias, which would be the drift in flight. Afterwards the orientation is the gyroscope's; when
      still, the accelerometer less its bias rights it.

    Otherwise the gyroscope's bias is its mean while the robot stands still, with a prior of zero.

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
        velocity_gain: float = parameter(0.04, gt=0.0, le=1.0, text="per tick, of the legs")
        position_gain: float = parameter(0.05, gt=0.0, le=1.0, text="per tick, of the legs")
        tilt_gain: float = parameter(0.002, ge=0.0, le=1.0, text="per tick, of the accelerometer")
        gate: float = parameter(
            0.08, unit="m/s", gt=0.0, text="speed at which a point is trusted by a quarter"
        )
        gate_growth: float = parameter(
            2.0, unit="m/s^2", ge=0.0, text="how fast it opens while all points are rejected"
        )
        support: float = parameter(
            4.0, unit="m/s^2", gt=0.0, text="upward specific force at which contacts count in full"
        )
        still_rate: float = parameter(
            0.08, unit="rad/s", gt=0.0, text="rate of base and joints below which it stands still"
        )
        slow_rate: float = parameter(
            1.5, unit="rad/s", gt=0.0, text="rate below which its feet are surely flat"
        )

    params: Params

    imu = Input(ImuReading, text="gyroscope, and accelerometer as the mean over the tick")
    joints = Input(JointState, text="joint angles and velocities")
    contacts = Input(ContactState, text="which points carry load; a short hold serves best")
    base = Output(BaseState, text="pose and velocity of the base")
    estimate = State(BaseEstimate, text="the filter")
    learning = State(BiasSamples, text="what the biases are learnt from")

    def setup(self) -> None:
        import pinocchio

        robot = self.context.robot
        if robot is None:
            raise BlockError("StateEstimator needs a robot: name one in the graph")
        built = build_pinocchio_model(robot)
        data: Any = built.model.createData()
        self._momentum: Any = pinocchio.computeCentroidalMomentum
        self._model: Any = built.model
        self._data: Any = data
        self._position = np.array(pinocchio.neutral(built.model))
        self._velocity = np.zeros(built.model.nv)
        carriers = [built.model.frames[frame].parentJoint for frame in built.contact_frames]
        # Views of Pinocchio's own memory: the base is its world here.
        self._turns = [data.oMi[joint].rotation for joint in carriers]
        self._places = [data.oMi[joint].translation for joint in carriers]
        self._linear = [data.v[joint].linear for joint in carriers]
        self._angular = [data.v[joint].angular for joint in carriers]
        self._linear_momentum = data.hg.linear
        self._mass = robot.total_mass
        self._radii = [contact.radius for contact in robot.contacts]
        self._centres = [
            np.array([x, y, z + contact.radius])
            for contact in robot.contacts
            for x, y, z in [contact.position]
        ]
        soles = [built.model.frames[frame].parentJoint for frame in built.sole_frames]
        self._sole_turns = [data.oMi[joint].rotation for joint in soles]
        self._sole_places = [data.oMi[joint].translation for joint in soles]
        self._sole_offsets = [np.array(foot.sole) for foot in robot.feet]
        n = len(robot.contacts)
        self._points, self._rates = np.zeros((n, 3)), np.zeros((n, 3))
        self._world_points, self._world_rates = np.zeros((n, 3)), np.zeros((n, 3))
        self._weights = np.zeros(n)
        self._error = np.zeros(3)
        self._gyro, self._force = np.zeros(3), np.zeros(3)
        self._last_rate, self._forward = np.zeros(3), np.zeros(3)
        self._spare, self._middle = np.zeros(3), np.zeros(4)
        self._down, self._arm = np.zeros(3), np.zeros(3)
        self._acceleration = np.zeros(3)
        self._watch_share = min(self.period / 0.02, 1.0)
        self._block = max(round(0.03 / self.period), 1)

    def step(self) -> None:
        estimate, base = self.estimate, self.base
        np.clip(self.imu.angular_velocity, -_FASTEST_TURN, _FASTEST_TURN, out=self._gyro)
        np.clip(self.imu.specific_force, -_STRONGEST_FORCE, _STRONGEST_FORCE, out=self._force)
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
        for point, rate, world_point, world_rate in zip(
            self._points, self._rates, self._world_points, self._world_rates, strict=True
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
        for i in range(self.joints.velocity.shape[0]):
            mean = float(estimate.mean_joint_rate[i])
            rate = min(max(float(self.joints.velocity[i]), -_FASTEST_JOINT), _FASTEST_JOINT)
            estimate.mean_joint_rate[i] = mean = mean + share * (rate - mean)
            fastest = max(fastest, abs(mean))
        standing = 0
        for point in range(self._weights.shape[0]):
            standing += bool(self.contacts.active[point])
        if standing == 0 and self.learning.aligned[()]:
            estimate.flown[()] = True
        if standing < self._weights.shape[0]:
            fastest = math.inf
        return fastest

    def _see_points(self) -> None:
        """Contact points and their rates from the base, by the joints and the base's turning."""
        q, v = self._position, self._velocity
        q[7:] = self.joints.position
        np.clip(self.joints.velocity, -_FASTEST_JOINT, _FASTEST_JOINT, out=v[6:])
        v[3:6] = self.estimate.angular_velocity
        self._momentum(self._model, self._data, q, v)
        rotate_back(self.estimate.orientation, _DOWN, self._down)
        for i, centre in enumerate(self._centres):
            point, rate, foot, arm = self._points[i], self._rates[i], self._turns[i], self._arm
            # The rubber is round: what touches the ground is its lowest point, however the foot
            # is turned, and that part of the foot is what stands still while the foot rolls.
            np.dot(self._down, foot, arm)
            arm *= self._radii[i]
            arm += centre
            cross(self._angular[i], arm, self._spare)
            self._spare += self._linear[i]
            np.dot(foot, self._spare, rate)
            np.dot(foot, arm, point)
            point += self._places[i]
        forward = self._forward
        forward.fill(0.0)
        for sole_turn in self._sole_turns:
            forward += sole_turn[:, 0]

    def _start(self) -> None:
        """Standing on level ground around the origin, the feet pointing along x."""
        estimate = self.estimate
        upright(self._force, estimate.orientation)
        self._see_points()
        for _ in range(20):
            misalignment(
                estimate.orientation, self._points, self._forward, self._error, self._spare
            )
            if self.params.law == "complementary":
                self._error[:2] = 0.0
            turn(estimate.orientation, *self._error.tolist())
        n_feet, n_points = len(self._sole_offsets), len(self._centres)
        for sole_turn, place, offset in zip(
            self._sole_turns, self._sole_places, self._sole_offsets, strict=True
        ):
            np.dot(sole_turn, offset, self._acceleration)
            self._acceleration += place
            rotate(estimate.orientation, self._acceleration, self._spare)
            estimate.position[0] -= float(self._spare[0]) / n_feet
            estimate.position[1] -= float(self._spare[1]) / n_feet
        for point in self._points:
            rotate(estimate.orientation, point, self._spare)
            estimate.position[2] -= float(self._spare[2]) / n_points
        estimate.gate[()] = self.params.gate
        estimate.mean_joint_rate.fill(1.0)  # moving, until it is seen not to
        estimate.started[()] = True

    def _right(self, still: bool, slow: bool) -> None:
        """Correct the orientation and learn the biases."""
        estimate, weighted = self.estimate, self.params.law == "weighted"
        level_ground = weighted and not bool(estimate.flown[()])
        self._learn(still, level_ground)
        x, y, z = (float(self._force[i]) for i in range(3))
        if abs(math.sqrt(x * x + y * y + z * z) - GRAVITY) > 0.1 * GRAVITY:
            return
        if level_ground and slow:
            # Least squares over all ticks so far, then over the last 250: angle and its drift.
            self.learning.aligned[()] = ticks = min(int(self.learning.aligned[()]) + 1, 250)
            n = max(ticks, 30)
            angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
            misalignment(
                estimate.orientation, self._points, self._forward, self._error, self._spare
            )
            rotate_back(estimate.orientation, self._error, self._spare)
            self._spare *= drift_gain / self.period
            estimate.gyro_bias -= self._spare
            self._error *= angle_gain
            turn(estimate.orientation, *self._error.tolist())
        elif still if weighted else bool(self.contacts.active.any()):
            right_up(estimate.orientation, self._force, self.params.tilt_gain, self._spare)

    def _learn(self, still: bool, level_ground: bool) -> None:
        """The mean of what the accelerometer reads beyond gravity, or else of the gyroscope.

        A full block of samples counts only once the block after it is full too, so the beginning
        of a motion, before it is noticed, does not get in. Each mean starts from a prior of zero
        with as many samples as the usual ratio of noise to bias is worth.
        """
        estimate, learning = self.estimate, self.learning
        if not still:
            learning.filled[()] = learning.held[()] = 0
            learning.filling_sum.fill(0.0)
            return
        learning.filling_sum[0] += self._gyro
        gravity = self._spare
        rotate_back(estimate.orientation, _GRAVITY_UP, gravity)
        learning.filling_sum[1] += self._force
        learning.filling_sum[1] += estimate.accelerometer_bias
        learning.filling_sum[1] -= gravity
        learning.filled[()] = filled = int(learning.filled[()]) + 1
        if filled < self._block:
            return
        if learning.held[()]:
            samples = min(int(learning.samples[()]) + filled, 1000)
            learning.samples[()] = samples
            row, prior = (1, 3.0) if level_ground else (0, 10.0)
            biases = estimate.accelerometer_bias if level_ground else estimate.gyro_bias
            for i in range(3):
                bias = float(biases[i])
                excess = float(learning.held_sum[row, i]) - filled * bias
                biases[i] = bias + excess / (samples + prior)
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
        rotate(estimate.orientation, self._linear_momentum, self._spare)
        self._spare /= self._mass
        fallen = -GRAVITY * self.period * ticks
        self._spare += estimate.velocity
        self._spare[2] -= fallen
        np.subtract(self._spare, estimate.ballistic_velocity, out=self._acceleration)
        if ticks <= average:
            self._acceleration /= ticks
            estimate.ballistic_velocity += self._acceleration
        elif np.abs(self._acceleration, out=self._arm).max() < _IMPACT:
            estimate.velocity -= self._acceleration
        else:
            estimate.flight_ticks[()] = 0  # the ground: what the IMU has felt stands
