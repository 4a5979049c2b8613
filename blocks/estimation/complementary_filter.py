"""The paper's estimator of the base's pose and velocity: a complementary filter."""

from __future__ import annotations

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.inertial_filter import correct_tilt_from_gravity
from ...mathematics.kernel import kernel
from .base_filter import (
    Estimator,
    count_standing,
    forget_samples,
    is_unaccelerated,
    learn_bias,
    place_points,
    predict,
    use_contacts,
)
from .inertial_estimator import InertialEstimator


@kernel
def filter_tick(estimator: Estimator) -> None:
    """A tick of the paper's filter; every point in contact has the weight one."""
    estimate, sample, learning = estimator.filter, estimator.sample, estimator.learning
    points = estimator.legs.points
    fastest = predict(estimator)
    if fastest < estimator.settings.still_rate[0]:
        learning.filling_sum[:] += sample.gyro
        learn_bias(learning, estimator.fixed.block, estimate.gyro_bias, 10.0)
    else:
        forget_samples(learning)
    if is_unaccelerated(sample.force) and count_standing(points.active) > 0:
        correct_tilt_from_gravity(
            estimate.orientation, sample.force, estimator.settings.tilt_gain[0],
            estimator.scratch.spare,
        )  # fmt: skip
    place_points(estimator)
    points.weights[:] = 1.0 if points.active else 0.0
    use_contacts(estimator, 1.0, 1.0)


class ComplementaryFilter(InertialEstimator):
    """The paper's complementary filter for the floating base (II-B).

    The IMU is integrated::

        R' = R [w]x,   v' = R f + g,   p' = v

    and contact points that stand at a_i in the world, and at r_i(q) relative to the base, correct
    the velocity towards v = -R (J_i q' + w x r_i) and the position towards p = a_i - R r_i, with
    the gains ``velocity_gain`` and ``position_gain`` per tick. All points in contact have equal
    weight. In contact the accelerometer corrects the tilt with ``tilt_gain`` whenever it reads
    about 1 g. The estimate of the gyroscope's bias is its mean while the robot stands still; the
    accelerometer's bias is not estimated. For flight and the world's origin see ``StateEstimator``.

    ``StateEstimator`` has the same ports and estimates the state at lift-off much better. Yaw and
    horizontal position drift. The block never waits and raises no errors in a run.
    """

    starts_level = False

    def make_call(self, estimator: Estimator) -> KernelCall:
        return KernelCall(filter_tick, estimator)
