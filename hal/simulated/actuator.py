"""The actuators: motor torque limits by speed, and the torque a drive produces for a command.

Motors are not joints. With ``A`` the transmission's ``joint_to_motor``, motor speed is ``A qd``,
motor torque is ``kappa = A^-T tau`` and joint torque is ``tau = A^T kappa``. A motor limit is
therefore a box in motor space and a rotated box in joint space. Where every motor is geared 1:1 to
at most two joints, as in BRUCE, these products round the same on every CPU.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import Array, Counts
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector


class Motors(NamedTuple):
    """What the motors of a robot can do, and how they move its joints.

    ``joint_to_motor``, ``torque_to_motor`` and ``motor_to_torque``, each (n, n), map joint
    velocities to motor speeds, joint torques to motor torques, and motor torques to joint torques.
    ``peak`` [N m], ``slope`` [N m s/rad] and ``no_load`` [rad/s], each (n,), are the curves of
    ``motor_torque_limits``.
    """

    joint_to_motor: Array
    torque_to_motor: Array
    motor_to_torque: Array
    peak: Array
    slope: Array
    no_load: Array


class MotorRecord(NamedTuple):
    """Sums and extremes of the motors over some physics steps, each (n,): see ``TickRecord``."""

    saturated: Counts
    torque_high: Array
    torque_low: Array
    speed_high: Array
    speed_low: Array
    overload: Array
    joint_torque: Array


class MotorScratch(NamedTuple):
    """What the motors do in the present physics step, each (n,): their speeds [rad/s], torque limits,
    the torques asked of them and those that they produce [N m]."""

    speed: Array
    lower: Array
    upper: Array
    wanted: Array
    torque: Array


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
    for k in range(speed.shape[0]):
        turning, most = float(speed[k]), float(peak[k])
        idle, fall = float(no_load[k]), float(slope[k])
        upper[k] = max(min(most, (idle - turning) * fall), 0.0)
        lower[k] = min(-min(most, (idle + turning) * fall), 0.0)


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
) -> None:
    """Write feedforward plus joint feedback [N m] to ``out`` (paper, V, first equation):
    ``tau_ff + Kp (q_d - q) + Kd (qd_d - qd)``."""
    for k in range(out.shape[0]):
        spring = (float(position_target[k]) - float(position[k])) * float(stiffness[k])
        damper = (float(velocity_target[k]) - float(velocity[k])) * float(damping[k])
        out[k] = (spring + float(feedforward[k])) + damper


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
    ``motor_to_torque``, which is the transpose of ``joint_to_motor``. What is not a number stays so.
    """
    multiply_vector(torque_to_motor, torque, motor_wanted)
    for k in range(motor_torque.shape[0]):
        produced = float(motor_wanted[k])
        if produced < lower[k]:
            produced = float(lower[k])
        if produced > upper[k]:
            produced = float(upper[k])
        motor_torque[k] = produced
    multiply_vector(motor_to_torque, motor_torque, torque)


@kernel
def drive_motors(
    velocity: Array, torque: Array, motors: Motors, scratch: MotorScratch, record: MotorRecord
) -> None:
    """Limit the joint ``torque`` [N m] at the joint ``velocity`` [rad/s] in place, and record how near
    the motors come to their limits. Of what is not a number the record says so too."""
    multiply_vector(motors.joint_to_motor, velocity, scratch.speed)
    motor_torque_limits(
        scratch.speed, motors.peak, motors.slope, motors.no_load, scratch.lower, scratch.upper
    )
    clip_joint_torque(
        torque, motors.torque_to_motor, motors.motor_to_torque, scratch.lower, scratch.upper,
        scratch.wanted, scratch.torque,
    )  # fmt: skip
    for k in range(torque.shape[0]):
        produced, speed = float(scratch.torque[k]), float(scratch.speed[k])
        if produced != scratch.wanted[k]:
            record.saturated[k] += 1
        raise_to(record.torque_high, k, produced)
        lower_to(record.torque_low, k, produced)
        raise_to(record.speed_high, k, speed)
        lower_to(record.speed_low, k, speed)
        raise_to(record.overload, k, produced - float(scratch.upper[k]))
        raise_to(record.overload, k, float(scratch.lower[k]) - produced)
        record.joint_torque[k] += torque[k]


@kernel
def raise_to(highest: Array, k: int, value: float) -> None:
    """Element ``k`` becomes ``value`` if that is higher, or not a number."""
    if value > highest[k] or math.isnan(value):
        highest[k] = value


@kernel
def lower_to(lowest: Array, k: int, value: float) -> None:
    """Element ``k`` becomes ``value`` if that is lower, or not a number."""
    if value < lowest[k] or math.isnan(value):
        lowest[k] = value
