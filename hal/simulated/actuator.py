"""The actuators: motor torque limits by speed, and the torque a drive produces for a command.

Motors are not joints. With ``A`` the transmission's ``joint_to_motor``, motor speed is ``A qd``,
motor torque is ``kappa = A^-T tau`` and joint torque is ``tau = A^T kappa``. A motor limit is
therefore a box in motor space and a rotated box in joint space. Where every motor is geared 1:1 to
at most two joints, as in BRUCE, these products round the same on every CPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel

Array = NDArray[np.float64]


@kernel
def motor_torque_limits(
    speed: Array, peak: Array, slope: Array, no_load: Array, lower: Array, upper: Array
) -> None:
    """Write the torque limits [N m] of motors at ``speed`` [rad/s] to ``lower`` and ``upper``.

    ``peak`` is available up to the corner speed and falls linearly, by ``slope`` [N m s/rad],
    to zero at ``no_load``; above that the motor cannot drive at all. Against the
    motion (braking) ``peak`` is available at any speed. A motor with a peak of zero does nothing.
    All arguments have one element a motor.
    """
    # fmin and fmax, because minimum and maximum take their output only as a keyword, which kernels
    # cannot use.
    np.subtract(no_load, speed, upper)
    np.multiply(upper, slope, upper)
    np.fmin(upper, peak, upper)
    np.fmax(upper, 0.0, upper)
    np.add(no_load, speed, lower)
    np.multiply(lower, slope, lower)
    np.fmin(lower, peak, lower)
    np.negative(lower, lower)
    np.fmin(lower, 0.0, lower)


@kernel
def joint_feedback_torque(
    feedforward: Array,
    stiffness: Array,
    damping: Array,
    position_target: Array,
    velocity_target: Array,
    position: Array,
    velocity: Array,
    out: Array,
    scratch: Array,
) -> None:
    """Write feedforward plus joint feedback [N m] to ``out`` (paper, V, first equation):
    ``tau_ff + Kp (q_d - q) + Kd (qd_d - qd)``."""
    np.subtract(position_target, position, out)
    np.multiply(out, stiffness, out)
    np.add(out, feedforward, out)
    np.subtract(velocity_target, velocity, scratch)
    np.multiply(scratch, damping, scratch)
    np.add(out, scratch, out)


@kernel
def clip_joint_torque(
    torque: Array,
    torque_to_motor: Array,
    motor_to_torque: Array,
    lower: Array,
    upper: Array,
    motor_wanted: Array,
    motor_torque: Array,
) -> None:
    """Limit the joint ``torque`` [N m] to what the motors can produce.

    ``motor_wanted`` receives the motor torques that are asked for, and ``motor_torque`` those that
    are produced, within ``lower`` and ``upper``. ``torque_to_motor`` is the inverse of
    ``motor_to_torque``, which is the transpose of ``joint_to_motor``.
    """
    np.dot(torque_to_motor, torque, motor_wanted)
    np.clip(motor_wanted, lower, upper, motor_torque)  # NaN stays NaN
    np.dot(motor_to_torque, motor_torque, torque)
