"""Where the base is and how it moves, by the paper's complementary filter."""

from __future__ import annotations

from ...mathematics.inertial_filter import right_up
from .inertial_estimator import InertialEstimator


class ComplementaryFilter(InertialEstimator):
    """The paper's complementary filter for the floating base (II-B), ballistic in flight if asked.

    The IMU is integrated::

        R' = R [w]x,   v' = R f + g,   p' = v

    and contact points that stand at a_i, seen from the base at r_i(q), correct the velocity by
    v = -R (J_i q' + w x r_i) and the position by p = a_i - R r_i, with ``velocity_gain`` and
    ``position_gain`` a tick. Every point in contact counts the same. In contact the accelerometer
    rights the orientation by ``tilt_gain`` whenever it reads about 1 g. The gyroscope's bias is its mean
    while the robot stands still; the accelerometer's is not known. What flight does, and where the
    world's origin is: see ``flight`` and ``StateEstimator``.

    ``StateEstimator`` has the same ports and adds what decides a jump. Yaw and horizontal position drift.
    Never waits, never raises in a run.
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
