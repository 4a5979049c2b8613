"""The paper's estimator of the base's pose and velocity: a complementary filter."""

from __future__ import annotations

from ...mathematics.inertial_filter import right_up
from .inertial_estimator import InertialEstimator


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

    def correct_orientation(self, fastest: float) -> None:
        if fastest < self.params.still_rate:
            self.learning.filling_sum += self._gyro
            self.learn_bias(self.estimate.gyro_bias, 10.0)
        else:
            self.forget_samples()
        if self.is_unaccelerated() and self.contacts.active.any():
            right_up(self.estimate.orientation, self._force, self.params.tilt_gain, self._spare)

    def trust_points(self) -> tuple[float, float]:
        self._weights[...] = self.contacts.active
        return 1.0, 1.0
