"""The sensors of a simulated robot, with noise, bias, offset, rounding, saturation and bounce."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...blocks.signals import ImuReading, JointState
from ...mathematics.arrays import (
    Array,
    Array1D,
    Counts,
    Flags,
    Flags1D,
    Indices0D,
    Indices1D,
    Vector3,
)
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from .random_streams import Purpose, RandomStreams, normal_call, stream, uniform_call
from .simulated_robot import SimulatorParameters
from .state import TickRecord


class ImuErrors(NamedTuple):
    """The errors of an IMU, which the robot may not have (``present``).

    ``gyro_bias`` [rad/s] and ``accelerometer_bias`` [m/s^2], (3,); ``gyro_noise`` and
    ``accelerometer_noise`` (3,), drawn for this sample, of variance one; ``scale`` (2,) of both noises;
    ``limit`` (2,), the ranges of gyroscope and accelerometer.
    """

    present: bool
    gyro_bias: Vector3
    accelerometer_bias: Vector3
    gyro_noise: Vector3
    accelerometer_noise: Vector3
    scale: Array1D
    limit: Array1D


class JointErrors(NamedTuple):
    """The errors of the joints' sensors: ``offset`` (n_joints,) [rad] of the encoders; ``size`` (2,), the
    encoders' resolution [rad] and the scale of the velocities' noise [rad/s]; ``noise`` (n_joints,),
    drawn for this sample, of variance one."""

    offset: Array1D
    size: Array1D
    noise: Array1D


@kernel
def sample(
    true: Vector3, bias: Vector3, noise: Vector3, scale: float, limit: float, out: Vector3
) -> None:
    """A reading (3,) with bias, noise and saturation; what is not a number stays so."""
    for axis in range(3):
        reading = true[axis] + bias[axis]
        if scale != 0.0:
            reading += noise[axis] * scale
        reading = min(reading, limit)
        reading = max(reading, -limit)
        out[axis] = reading


@kernel
def sample_imu(
    rate: Vector3, force: Vector3, errors: ImuErrors, read_rate: Vector3, read_force: Vector3
) -> None:
    """A sample of the IMU from the true values [rad/s, m/s^2, body]; zero where there is none."""
    if not errors.present:
        for axis in range(3):
            read_rate[axis] = read_force[axis] = 0.0
        return
    scale, limit = errors.scale, errors.limit
    sample(rate, errors.gyro_bias, errors.gyro_noise, float(scale[0]), float(limit[0]), read_rate)
    sample(
        force, errors.accelerometer_bias, errors.accelerometer_noise, float(scale[1]),
        float(limit[1]), read_force,
    )  # fmt: skip


@kernel
def sample_joints(
    position: Array1D,
    velocity: Array1D,
    torque: Array1D,
    errors: JointErrors,
    read_position: Array1D,
    read_velocity: Array1D,
    read_torque: Array1D,
) -> None:
    """A sample of encoders and currents from the joints' true motion and torques."""
    resolution, scale = float(errors.size[0]), float(errors.size[1])
    np.add(position, errors.offset, read_position)
    if resolution != 0.0:
        np.divide(read_position, resolution, read_position)
        np.rint(read_position, read_position)
        np.multiply(read_position, resolution, read_position)
    for joint in range(velocity.shape[0]):
        read_velocity[joint] = velocity[joint]
        if scale != 0.0:
            read_velocity[joint] += float(errors.noise[joint]) * scale
        read_torque[joint] = torque[joint]


@kernel
def count_bouncing(step: Indices0D, bounce_end: Indices1D, count: Indices1D) -> None:
    """How many switches chatter in a physics step: ``step`` without a dimension, ``count`` (1,)."""
    count[0] = 0
    for point in range(bounce_end.shape[0]):
        if step[()] < bounce_end[point]:
            count[0] += 1


@kernel
def sample_switches(
    present: bool,
    step: Indices0D,
    pressed: Flags1D,
    bounce_end: Indices1D,
    draws: Array1D,
    closed: Flags1D,
) -> None:
    """A sample of the switches that the robot may have (``present``).

    Args:
        step, bounce_end: as for ``count_bouncing``.
        pressed: the switches before bounce, (n_contacts,).
        draws: a random number between zero and one for each switch that chatters, in their order.
        closed: what the switches read, (n_contacts,).
    """
    drawn = 0
    for point in range(closed.shape[0]):
        closed[point] = present and bool(pressed[point])
        if present and step[()] < bounce_end[point]:
            closed[point] = draws[drawn] < 0.5
            drawn += 1


class Sensors:
    """Makes readings of true quantities. Biases, offsets and switch thresholds are drawn once from
    the seed; noise and bounce come from the running ``streams``."""

    def __init__(
        self, robot: RobotDescription, params: SimulatorParameters, streams: RandomStreams
    ) -> None:
        n, n_contacts = len(robot.joints), len(robot.contacts)
        self._params = params
        self._has_switches = robot.sensors.switches
        self._gyro = streams[Purpose.GYRO]
        self._accelerometer = streams[Purpose.ACCELEROMETER]
        self._velocity = streams[Purpose.JOINT_VELOCITY]
        self._bounce = streams[Purpose.BOUNCE]
        self.bounce_steps = math.ceil(params.switch_bounce / params.timestep - 1e-9)

        def spread(purpose: Purpose, half_width: float, size: int) -> Array:
            return stream(params.seed, purpose).uniform(-1.0, 1.0, size) * half_width

        self.gyro_bias = spread(Purpose.GYRO_BIAS, params.gyro_bias, 3)
        """The gyroscope's bias [rad/s]."""
        self.accelerometer_bias = spread(Purpose.ACCELEROMETER_BIAS, params.accelerometer_bias, 3)
        """The accelerometer's bias [m/s^2]."""
        self.encoder_offset = spread(Purpose.ENCODER_OFFSET, params.encoder_offset, n)
        """The offset of every joint encoder: its reading minus the true angle [rad]."""
        self._imu_errors = ImuErrors(
            robot.sensors.imu, self.gyro_bias, self.accelerometer_bias, np.zeros(3), np.zeros(3),
            np.array([params.gyro_noise, params.accelerometer_noise]),
            np.array([_limit(params.gyro_range), _limit(params.accelerometer_range)]),
        )  # fmt: skip
        self._joint_errors = JointErrors(
            self.encoder_offset, np.array([params.encoder_resolution, params.joint_velocity_noise]),
            np.zeros(n),
        )  # fmt: skip
        low, high = params.switch_threshold
        draws = stream(params.seed, Purpose.SWITCH_THRESHOLD).random(n_contacts)
        self.switch_threshold = low + (high - low) * draws
        """The force that closes every switch [N]."""
        self.ground_force = -self.switch_threshold
        """The vertical force on the ground up to which every switch is closed [N]."""

    def reading_imu(self, rate: Array, force: Array, out: ImuReading) -> list[Call]:
        """Write a sample of the IMU from the true values [rad/s, m/s^2, body]; zero without IMU."""
        errors, params = self._imu_errors, self._params
        calls: list[Call] = []
        if params.gyro_noise:
            calls.append(normal_call(self._gyro, errors.gyro_noise))
        if params.accelerometer_noise:
            calls.append(normal_call(self._accelerometer, errors.accelerometer_noise))
        return [
            *calls,
            KernelCall(sample_imu, rate, force, errors, out.angular_velocity, out.specific_force),
        ]

    def reading_joints(
        self, position: Array, velocity: Array, torque: Array, out: JointState
    ) -> list[Call]:
        """Write a sample of encoders and currents from the joints' true motion and torques."""
        errors = self._joint_errors
        calls: list[Call] = []
        if self._params.joint_velocity_noise:
            calls.append(normal_call(self._velocity, errors.noise))
        sampling = KernelCall(
            sample_joints,
            position,
            velocity,
            torque,
            errors,
            out.position,
            out.velocity,
            out.torque,
        )
        return [*calls, sampling]

    def reading_switches(self, step: Counts, record: TickRecord, closed: Flags) -> list[Call]:
        """Write a sample of the switches, (n_contacts,); a switch that has just changed reads either
        way at random. Without switches none is closed. ``step`` is a count without a dimension."""
        draws = np.zeros(len(closed))
        drawing, count = uniform_call(self._bounce, draws)
        return [
            KernelCall(count_bouncing, step, record.bounce_end, count),
            *([drawing] if self.bounce_steps else []),
            KernelCall(
                sample_switches, self._has_switches, step, record.closed, record.bounce_end,
                draws, closed,
            ),
        ]  # fmt: skip


def _limit(limit: float | None) -> float:
    """The range of a sensor, infinite where it has none."""
    return math.inf if limit is None else limit
