"""Estimates the base's pose and velocity from the IMU, the joint encoders and the contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array0D, Array1D, Flags0D, Indices0D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.inertial_filter import correct_tilt_from_gravity, misalignment, turn, weigh
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, rotate_back, wrap
from ...runtime.language.block import State
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from .base_filter import (
    Estimator,
    count_standing,
    forget_samples,
    is_unaccelerated,
    learn_bias,
    limit,
    place_points,
    predict,
    use_contacts,
)
from .inertial_estimator import InertialEstimator, InertialParameters


class GroundTrust(Signal):
    """How far points and ground are trusted."""

    gate = Field(unit="m/s", text="how fast a standing point may seem to move")
    flown = Field(dtype="bool", text="whether all points have lost contact since the start")
    facing = Field(dtype="bool", text="whether the feet's heading has been noted")
    heading = Field(unit="rad", frame="world", text="where the feet point while they stand")
    aligned = Field(dtype="int64", text="ticks of alignment with the level ground")


class Trust(NamedTuple):
    """The fields of ``GroundTrust``."""

    gate: Array0D
    flown: Flags0D
    facing: Flags0D
    heading: Array0D
    aligned: Indices0D


class GroundSettings(NamedTuple):
    """Parameters that may change during a run, each (1,)."""

    gate: Array1D
    gate_growth: Array1D
    support: Array1D
    slow_rate: Array1D


@kernel
def align_with_ground(estimator: Estimator, trust: Trust) -> None:
    """Correct tilt and heading by the points, and the gyroscope's bias by the drift of both."""
    estimate, seen, scratch = estimator.filter, estimator.legs.seen, estimator.scratch
    error, spare = scratch.error, scratch.spare
    # Least squares over all ticks so far, then over the last 250: angle and its drift.
    ticks = min(trust.aligned[()] + 1, 250)
    trust.aligned[()] = ticks
    n = max(ticks, 30)
    angle_gain, drift_gain = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
    misalignment(estimate.orientation, seen.points, seen.forward, error, spare)
    if not trust.facing[()]:
        trust.heading[()] = -error[2]
        trust.facing[()] = True
    error[2] = wrap(error[2] + trust.heading[()])
    limit(error, 0.05, error)
    rotate_back(estimate.orientation, error, spare)
    estimate.gyro_bias[:] -= spare * (drift_gain / estimator.fixed.period)
    error[:] *= angle_gain
    turn(estimate.orientation, error[0], error[1], error[2])


@kernel
def learn_accelerometer_bias(estimator: Estimator, still: bool) -> None:
    """While the robot stands still, learn the mean of the accelerometer minus gravity."""
    estimate, learning, scratch = estimator.filter, estimator.learning, estimator.scratch
    if not still:
        forget_samples(learning)
        return
    bias, up, weight = estimate.accelerometer_bias, scratch.error, scratch.spare
    up[0] = up[1] = 0.0
    up[2] = GRAVITY
    rotate_back(estimate.orientation, up, weight)
    learning.filling_sum[:] = learning.filling_sum + estimator.sample.force + bias - weight
    learn_bias(learning, estimator.fixed.block, bias, 3.0)


@kernel
def correct_orientation(
    estimator: Estimator, trust: Trust, settings: GroundSettings, level_ground: bool, fastest: float
) -> None:
    """Correct the orientation and learn biases.

    Args:
        fastest: the largest low-passed rate of base and joints [rad/s]; infinite unless all
            points stand.
    """
    if trust.gate[()] == 0.0:  # the first tick: the feet point along x
        trust.gate[()] = settings.gate[0]
        trust.facing[()] = True
    flown, still = bool(trust.flown[()]), fastest < estimator.settings.still_rate[0]
    if not flown:
        learn_accelerometer_bias(estimator, still)
    if not is_unaccelerated(estimator.sample.force):
        return
    if fastest < settings.slow_rate[0] and (level_ground or not flown):
        align_with_ground(estimator, trust)
    elif still:
        correct_tilt_from_gravity(
            estimator.filter.orientation, estimator.sample.force,
            estimator.settings.tilt_gain[0], estimator.scratch.spare,
        )  # fmt: skip


@kernel
def trust_points(
    estimator: Estimator, trust: Trust, settings: GroundSettings
) -> tuple[float, float]:
    """Write the weight of every point.

    Returns the largest weight, and a factor from 0 to 1 on all corrections by contacts.
    """
    estimate, points, up = estimator.filter, estimator.legs.points, estimator.scratch.spare
    gate, growth = trust.gate[()], settings.gate_growth[0]
    trusted = weigh(points.rates, points.active, estimate.velocity, gate, points.weights)
    rotate(estimate.orientation, estimator.sample.force, up)
    support = min(max(up[2] / settings.support[0], 0.0), 1.0)
    if count_standing(points.active) == 0:
        gate += 0.05 * growth * estimator.fixed.period
    elif trusted < 0.25:
        gate += growth * estimator.fixed.period
    else:
        gate += 0.1 * (settings.gate[0] - gate)
    trust.gate[()] = min(gate, 10.0)
    return trusted, support


@kernel
def estimate_tick(
    estimator: Estimator, trust: Trust, settings: GroundSettings, level_ground: bool
) -> None:
    """A tick of the filter: predict, correct the orientation, weigh the points, use them."""
    watching = bool(estimator.filter.started[()])
    fastest = predict(estimator)
    if watching and count_standing(estimator.legs.points.active) == 0 and trust.aligned[()] > 0:
        trust.flown[()] = True
        trust.facing[()] = False
    correct_orientation(estimator, trust, settings, level_ground, fastest)
    place_points(estimator)
    trusted, support = trust_points(estimator, trust, settings)
    use_contacts(estimator, trusted, support)


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

    def setup(self) -> None:
        self.ground_settings = GroundSettings(*(np.zeros(1) for _ in GroundSettings._fields))
        super().setup()

    def on_parameters(self) -> None:
        super().on_parameters()
        for name, value in zip(GroundSettings._fields, self.ground_settings, strict=True):
            value[0] = getattr(self.params, name)

    def make_call(self, estimator: Estimator) -> KernelCall:
        trust = Trust(*(getattr(self.trust, name) for name in Trust._fields))
        return KernelCall(
            estimate_tick, estimator, trust, self.ground_settings, self.params.level_ground
        )
