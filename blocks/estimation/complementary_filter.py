"""The paper's estimator of the base's pose and velocity: a complementary filter."""

from __future__ import annotations

import numpy as np

from ...mathematics.inertial_filter import correct_tilt_from_gravity
from ...mathematics.kernel import kernel
from ..signals import BaseState, ImuReading, JointState
from .inertial_estimator import (
    BaseEstimate,
    BiasSamples,
    InertialConstants,
    InertialEstimator,
    InertialParameters,
    InertialScratch,
    LegKinematics,
    correct_motion,
    count_standing,
    forget_samples,
    is_unaccelerated,
    learn_bias,
    predict,
    publish,
    set_point_positions,
)


class ComplementaryFilter(InertialEstimator):
    """The paper's complementary filter for the floating base (II-B).

    The IMU is integrated::

        R' = R [w]x,   v' = R f + g,   p' = v

    and contact points that stand at a_i in the world, and at r_i(q) relative to the base, correct
    the velocity towards v = -R (J_i q' + w x r_i) and the position towards p = a_i - R r_i, with
    the gains ``velocity_gain`` and ``position_gain`` per second. All points in contact have equal
    weight. In contact the accelerometer corrects the tilt with ``tilt_gain`` whenever it reads
    about 1 g. The estimate of the gyroscope's bias is its mean while the robot stands still; the
    accelerometer's bias is not estimated. For flight and the world's origin see ``StateEstimator``.

    ``StateEstimator`` has the same ports and estimates the state at lift-off much better. Yaw and
    horizontal position drift. The block never waits and raises no errors in a run.
    """

    starts_level = False

    @kernel
    @staticmethod
    def step(
        imu: ImuReading,
        joints: JointState,
        base: BaseState,
        estimate: BaseEstimate,
        learning: BiasSamples,
        legs: LegKinematics,
        params: InertialParameters,
        constants: InertialConstants,
        scratch: InertialScratch,
    ) -> None:
        points = legs.points
        fastest = predict(imu, joints, estimate, legs, constants, scratch)
        if fastest < params.still_rate:
            learning.filling_sum[:] += scratch.gyro
            learn_bias(learning, constants, estimate.gyro_bias, 0.02)
        else:
            forget_samples(learning)
        if is_unaccelerated(scratch.force) and count_standing(points.active) > 0:
            correct_tilt_from_gravity(
                estimate.orientation, scratch.force, constants.tilt_gain, scratch.vector
            )
        set_point_positions(estimate, legs)
        points.weights[:] = np.where(points.active, 1.0, 0.0)
        correct_motion(estimate, legs, params, constants, scratch, 1.0, 1.0)
        publish(estimate, base)
