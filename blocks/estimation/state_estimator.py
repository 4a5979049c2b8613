"""Estimates the base's pose and velocity from the IMU, the joint encoders and the contacts."""

from __future__ import annotations

import numpy as np

from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import misalignment, right_up, turn, weigh
from ...mathematics.rotations import rotate, rotate_back, wrap
from ...runtime.language.block import State
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from .inertial_estimator import InertialEstimator, InertialParameters

_GRAVITY_UP = np.array([0.0, 0.0, GRAVITY])


class GroundTrust(Signal):
    """How far points and ground are trusted."""

    gate = Field(unit="m/s", text="how fast a standing point may seem to move")
    flown = Field(dtype="bool", text="whether all points have lost contact since the start")
    facing = Field(dtype="bool", text="whether the feet's heading has been noted")
    heading = Field(unit="rad", frame="world", text="where the feet point while they stand")
    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")


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
    * While all points are in contact and the robot moves slowly, the feet are flat on level ground.
      Then the heights of the points give the tilt, as exactly as the encoder offsets allow (about
      3 mrad, where a biased accelerometer has 10 mrad), and the feet give the heading while they
      stand. The drift of both, by a least-squares line over up to 250 ticks, gives the gyroscope's
      bias. While the robot stands still before the first flight, the accelerometer's reading minus
      gravity gives its bias, which would cause a drift in flight. If the feet may come to stand at
      different heights set ``level_ground`` to false: then after a flight only the accelerometer
      corrects the tilt.

    **Flight.** While no point is trusted there is only the prediction. ``flight: imu`` integrates
    the IMU. ``flight: ballistic`` averages the CoM's velocity by the IMU over the first 20 ms; from
    then on the CoM falls freely, and the base follows from the joints. That does not drift, but it
    also does not notice a push.

    It starts at the first sample, with the robot standing on level ground: the world's origin is
    midway between the soles, and x is the heading of the feet; for feet of one contact point it is
    the heading of the pattern in which they stand. Yaw and horizontal position drift. After a jump
    the height of the ground is known only through the anchors. The block never waits and raises no
    errors in a run.
    """

    class Params(InertialParameters):
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
            True, text="all points are at one height whenever all are in contact"
        )
        slow_rate: float = live_parameter(
            1.5, unit="rad/s", gt=0.0, text="rate of base and joints below which feet are flat"
        )

    starts_level = True
    params: Params
    trust = State(GroundTrust, text="how far points and ground are trusted")

    def watch_motion(self) -> float:
        fastest = super().watch_motion()
        if self._standing == 0 and self.trust.aligned[()]:
            self.trust.flown[()] = True
            self.trust.facing[()] = False
        return fastest

    def correct_orientation(self, fastest: float) -> None:
        estimate, trust, params = self.estimate, self.trust, self.params
        if not trust.gate[()]:  # the first tick: the feet point along x
            trust.gate[()], trust.facing[()] = params.gate, True
        flown, still = bool(trust.flown[()]), fastest < params.still_rate
        if not flown:
            self._learn_accelerometer_bias(still)
        if not self.is_unaccelerated():
            return
        if fastest < params.slow_rate and (params.level_ground or not flown):
            self._align_with_ground()
        elif still:
            right_up(estimate.orientation, self._force, params.tilt_gain, self._spare)

    def _align_with_ground(self) -> None:
        """Correct tilt and heading by the points, and the gyroscope's bias by the drift of both."""
        estimate, trust, seen = self.estimate, self.trust, self._kinematics
        # Least squares over all ticks so far, then over the last 250: angle and its drift.
        trust.aligned[()] = ticks = min(int(trust.aligned[()]) + 1, 250)
        n = max(ticks, 30)
        angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
        misalignment(estimate.orientation, seen.points, seen.forward, self._error, self._spare)
        if not trust.facing[()]:
            trust.heading[()] = -float(self._error[2])
            trust.facing[()] = True
        self._error[2] = wrap(float(self._error[2]) + float(trust.heading))
        np.clip(self._error, -0.05, 0.05, out=self._error)
        rotate_back(estimate.orientation, self._error, self._spare)
        self._spare *= drift_gain / self.period
        estimate.gyro_bias -= self._spare
        self._error *= angle_gain
        turn(estimate.orientation, *self._error.tolist())

    def _learn_accelerometer_bias(self, still: bool) -> None:
        """While the robot stands still, learn the mean of the accelerometer minus gravity."""
        if not still:
            self.forget_samples()
            return
        bias = self.estimate.accelerometer_bias
        rotate_back(self.estimate.orientation, _GRAVITY_UP, self._spare)
        self.learning.filling_sum += self._force
        self.learning.filling_sum += bias
        self.learning.filling_sum -= self._spare
        self.learn_bias(bias, 3.0)

    def trust_points(self) -> tuple[float, float]:
        estimate, params, active = self.estimate, self.params, self.contacts.active
        gate = float(self.trust.gate[()])
        trusted = weigh(self._world_rates, active, estimate.velocity, gate, self._weights)
        rotate(estimate.orientation, self._force, self._spare)
        support = min(max(float(self._spare[2]) / params.support, 0.0), 1.0)
        if not active.any():
            gate += 0.05 * params.gate_growth * self.period
        elif trusted < 0.25:
            gate += params.gate_growth * self.period
        else:
            gate += 0.1 * (params.gate - gate)
        self.trust.gate[()] = min(gate, 10.0)
        return trusted, support
