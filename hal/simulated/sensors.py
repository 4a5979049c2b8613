"""The sensors of a simulated robot, with noise, bias, offset, rounding, saturation and bounce."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import ContactSwitches, ImuReading, JointState
from ...robots.description import RobotDescription
from .parameters import SimulatorParameters
from .random_streams import Purpose, RandomStreams, stream
from .state import TickRecord

Array = NDArray[np.float64]


class Sensors:
    """Makes readings of true quantities. Biases, offsets and switch thresholds are drawn once from
    the seed; noise and bounce come from the running ``streams``."""

    def __init__(
        self, robot: RobotDescription, params: SimulatorParameters, streams: RandomStreams
    ) -> None:
        n, n_contacts = len(robot.joints), len(robot.contacts)
        self._params = params
        self._has_imu, self._has_switches = robot.sensors.imu, robot.sensors.switches
        self._gyro = streams[Purpose.GYRO]
        self._accelerometer = streams[Purpose.ACCELEROMETER]
        self._velocity = streams[Purpose.JOINT_VELOCITY]
        self._bounce = streams[Purpose.BOUNCE]
        self._bounce_steps = math.ceil(params.switch_bounce / params.timestep - 1e-9)
        self._noise, self._joint_noise = np.zeros(3), np.zeros(n)

        def spread(purpose: Purpose, half_width: float, size: int) -> Array:
            return stream(params.seed, purpose).uniform(-1.0, 1.0, size) * half_width

        self.gyro_bias = spread(Purpose.GYRO_BIAS, params.gyro_bias, 3)
        """The gyroscope's bias [rad/s]."""
        self.accelerometer_bias = spread(Purpose.ACCELEROMETER_BIAS, params.accelerometer_bias, 3)
        """The accelerometer's bias [m/s^2]."""
        self.encoder_offset = spread(Purpose.ENCODER_OFFSET, params.encoder_offset, n)
        """The offset of every joint encoder: its reading minus the true angle [rad]."""
        low, high = params.switch_threshold
        draws = stream(params.seed, Purpose.SWITCH_THRESHOLD).random(n_contacts)
        self.switch_threshold = low + (high - low) * draws
        """The force that closes every switch [N]."""
        self._ground_force = -self.switch_threshold
        self._closed = np.zeros(n_contacts, dtype=np.bool_)
        self._changed = np.zeros(n_contacts, dtype=np.bool_)

    def read_imu(self, angular_velocity: Array, specific_force: Array, out: ImuReading) -> None:
        """Write a sample of the IMU from the true values [rad/s, m/s^2, body]; zero without IMU."""
        params = self._params
        if not self._has_imu:
            out.angular_velocity.fill(0.0)
            out.specific_force.fill(0.0)
            return
        for true, bias, noise, limit, generator, reading in (
            (angular_velocity, self.gyro_bias, params.gyro_noise, params.gyro_range,
             self._gyro, out.angular_velocity),
            (specific_force, self.accelerometer_bias, params.accelerometer_noise,
             params.accelerometer_range, self._accelerometer, out.specific_force),
        ):  # fmt: skip
            np.add(true, bias, out=reading)
            if noise:
                generator.standard_normal(out=self._noise)
                np.multiply(self._noise, noise, out=self._noise)
                np.add(reading, self._noise, out=reading)
            if limit is not None:
                np.minimum(reading, limit, out=reading)
                np.maximum(reading, -limit, out=reading)

    def read_joints(self, position: Array, velocity: Array, torque: Array, out: JointState) -> None:
        """Write a sample of encoders and currents from the joints' true motion and torques."""
        params = self._params
        np.add(position, self.encoder_offset, out=out.position)
        if params.encoder_resolution:
            np.divide(out.position, params.encoder_resolution, out=out.position)
            np.rint(out.position, out=out.position)
            np.multiply(out.position, params.encoder_resolution, out=out.position)
        out.velocity[:] = velocity
        if params.joint_velocity_noise:
            self._velocity.standard_normal(out=self._joint_noise)
            np.multiply(self._joint_noise, params.joint_velocity_noise, out=self._joint_noise)
            np.add(out.velocity, self._joint_noise, out=out.velocity)
        out.torque[:] = torque

    def watch_switches(self, step: int, ground_force: Array, record: TickRecord) -> None:
        """Update the switches in one physics step.

        ``ground_force`` is the vertical force of every contact point on the ground [N], which is
        negative where the robot presses.
        """
        np.less_equal(ground_force, self._ground_force, out=self._closed)
        if self._bounce_steps:
            np.not_equal(self._closed, record.closed, out=self._changed)
            np.copyto(record.bounce_end, step + 1 + self._bounce_steps, where=self._changed)
        record.closed[:] = self._closed

    def read_switches(self, step: int, record: TickRecord, out: ContactSwitches) -> None:
        """Write a sample of the switches; a switch that has just changed reads either way at
        random. Without switches none is closed."""
        self.read_closed(step, record, out.closed)

    def read_closed(self, step: int, record: TickRecord, closed: NDArray[np.bool_]) -> None:
        """The same as an array, (n_contacts,)."""
        if not self._has_switches:
            closed.fill(False)
            return
        closed[:] = record.closed
        if self._bounce_steps:
            for k, end in enumerate(record.bounce_end.tolist()):
                if step < end:
                    closed[k] = self._bounce.random() < 0.5
