"""The sensors of a simulated robot: samples of true values, with the errors that were drawn for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...blocks.signals import ImuReading, JointState
from ...mathematics.arrays import Array, Array1D, Counts, Flags, Flags1D, Indices1D, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.robot_description import SensorMount
from ...runtime.language.signals import Signal
from ..random_streams import Purpose, RandomStreams, sensor_stream, stream
from ..sensors.built_in import JointSensors, SwitchSensors
from ..sensors.imu import Imu
from ..sensors.noise import FieldErrors, NoiseModel, delay_sample
from ..sensors.sensor import MountedSensor, mounted_sensors
from .parameters import SimulatorParameters
from .state import SensorMemory, TickRecord

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


@kernel
def accumulate(now: Array1D, averaged: Flags1D, total: Array1D, steps: Indices1D) -> None:
    """Add the true values of a physics step where they are ``averaged``; else keep them."""
    for k in range(now.shape[0]):
        if averaged[k] and steps[0] > 0:
            total[k] += now[k]
        else:
            total[k] = now[k]
    steps[0] += 1


@kernel
def take_sample(averaged: Flags1D, total: Array1D, steps: Indices1D, true: Array1D) -> None:
    """Write the true values of a sample, and begin the next one."""
    for k in range(true.shape[0]):
        true[k] = total[k] / max(1, steps[0]) if averaged[k] else total[k]
    total[:] = true
    steps[0] = 0


@kernel
def copy_numbers(numbers: Array1D, out: Array1D) -> None:
    """Copy numbers."""
    out[:] = numbers


@kernel
def read_nothing(rate: Vector3, force: Vector3) -> None:
    """Zeros, for an IMU that the robot does not have."""
    rate[:] = 0.0
    force[:] = 0.0


class SimulatedSensor:
    """One sensor that the description mounts on a link, in a simulation.

    Args:
        sensor: the sensor.
        model, data: of the simulator.
        params: the seed and the factor on the errors.
        streams: the random streams of the run.
        period: from sample to sample [s].
        samples_per_tick: how many samples a control tick has; the noise of a field that is averaged
            is that of the mean over a tick, so that of a sample is larger.
        memory: its numbers in ``SensorMemory``: total, steps, samples, count.
    """

    def __init__(
        self, sensor: MountedSensor, model: MjModel, data: MjData, params: SimulatorParameters,
        streams: RandomStreams, period: float, samples_per_tick: float,
        memory: tuple[Array, Counts, Array, Counts],
    ) -> None:  # fmt: skip
        self.sensor = sensor
        total, steps, samples, count = memory
        size = len(total)
        self._total, self._steps = total, steps
        now, self._true, self._erred = np.zeros(size), np.zeros(size), np.zeros(size)
        self._averaged = np.zeros(size, np.bool_)
        delay = np.zeros(size, np.int64)
        self._errors: list[tuple[slice, FieldErrors]] = []
        true_values, start = {}, 0
        for k, (name, field) in enumerate(sensor.signal.fields.items()):
            part = slice(start, start + sensor.sizes[name])
            start = part.stop
            true_values[name] = now[part].reshape(field.resolve({}))
            self._averaged[part] = name in sensor.averaged
            noise = sensor.noise(name).scaled(params.sensors.sensor_errors)
            if name in sensor.averaged:
                noise = noise.model_copy(
                    update={"noise": noise.noise * math.sqrt(samples_per_tick)}
                )
            delay[part] = math.ceil(noise.delay / period - 1e-9)
            bias = sensor_stream(params.seed, sensor.name, 2 * k)
            errors = FieldErrors(noise, sensor.sizes[name], bias, streams.of_field(sensor.name, k))
            self._errors.append((part, errors))
        self._past = samples.reshape(-1, size), count, delay
        self.after_step_calls: list[Call] = [
            *sensor.from_mujoco(model, data, true_values),
            KernelCall(accumulate, now, self._averaged, total, steps),
        ]
        """The calls after every physics step."""

    def bias(self, field: str) -> Array:
        """Return the bias of a field that was drawn from the seed."""
        return self._errors[list(self.sensor.signal.fields).index(field)][1].bias

    def reset(self) -> None:
        """Begin a new sample."""
        self._steps[0] = 0

    def reading_calls(self, out: Signal) -> list[Call]:
        """Write a sample, and begin the next one."""
        calls: list[Call] = [
            KernelCall(take_sample, self._averaged, self._total, self._steps, self._true)
        ]
        for part, errors in self._errors:
            calls += errors.calls(self._true[part], self._erred[part])
        late = np.zeros(len(self._erred))
        calls.append(KernelCall(delay_sample, self._erred, *self._past, late))
        for (part, _), (_, view) in zip(self._errors, out, strict=True):
            calls.append(KernelCall(copy_numbers, late[part], view.reshape(-1)))
        return calls


class SimulatedSensors:
    """The sensors of a simulated robot: IMU, joints, switches, and what the description mounts.

    Biases, offsets and switch thresholds are drawn once from the seed; noise and bounce come from the
    running ``streams``.

    Args:
        robot: the description.
        params: the errors, and the seed.
        streams: the random streams of the run.
        memory: of the mounted sensors; by default it is allocated.
    """

    def __init__(
        self, robot: RobotDescription, params: SimulatorParameters, streams: RandomStreams,
        memory: SensorMemory | None = None,
    ) -> None:  # fmt: skip
        n, seed = len(robot.joints), params.seed
        self._robot, self._params, self._streams = robot, params, streams
        self._has_imu, self._has_switches = robot.sensors.imu, robot.sensors.switches
        self._imu = Imu("imu", SensorMount(kind="imu", link=robot.base))
        errors = params.sensors
        gyroscope = NoiseModel(
            noise=errors.gyro_noise, bias=errors.gyro_bias, range=errors.gyro_range
        )
        accelerometer = NoiseModel(
            noise=errors.accelerometer_noise, bias=errors.accelerometer_bias,
            range=errors.accelerometer_range,
        )  # fmt: skip
        self._imu_errors = {
            "angular_velocity": FieldErrors(
                gyroscope, 3, stream(seed, Purpose.GYRO_BIAS), streams[Purpose.GYRO]
            ),
            "specific_force": FieldErrors(
                accelerometer, 3, stream(seed, Purpose.ACCELEROMETER_BIAS),
                streams[Purpose.ACCELEROMETER],
            ),
        }  # fmt: skip
        self._joints = JointSensors("joints", robot.dimensions)
        encoders = NoiseModel(bias=errors.encoder_offset, resolution=errors.encoder_resolution)
        velocity = NoiseModel(noise=errors.joint_velocity_noise)
        self._joint_errors = {
            "position": FieldErrors(encoders, n, stream(seed, Purpose.ENCODER_OFFSET), None),
            "velocity": FieldErrors(
                velocity, n, None, streams[Purpose.JOINT_VELOCITY], biased=False
            ),
            "torque": FieldErrors(NoiseModel(), n, None, None, biased=False),
        }
        self.encoder_offset = self._joint_errors["position"].bias
        """The offset of every joint encoder: its reading minus the true angle [rad]."""
        limits, points = errors.switch_threshold, max(1, len(robot.contacts))
        if errors.switches.threshold is not None:
            load = robot.weight / points
            limits = [load * share for share in errors.switches.threshold]
        self.switch_threshold = SwitchSensors.draw_thresholds(
            limits, len(robot.contacts), stream(seed, Purpose.SWITCH_THRESHOLD)
        )
        """The force that closes every switch [N]."""
        self.ground_force = -self.switch_threshold
        """The vertical force on the ground up to which every switch is closed [N]."""
        self.bounce_steps = math.ceil(errors.switch_bounce / params.timestep - 1e-9)
        self._kinds = mounted_sensors(robot)
        self.memory = memory or SensorMemory.allocate(self.dimensions(params, self._kinds))
        self.mounted: tuple[SimulatedSensor, ...] = ()
        """The sensors that the description mounts, after ``attach``."""

    @staticmethod
    def dimensions(
        params: SimulatorParameters, sensors: Sequence[MountedSensor]
    ) -> Mapping[str, int]:
        """Return the sizes of ``SensorMemory``."""
        numbers = [sum(sensor.sizes.values()) for sensor in sensors]
        samples = [n * _slots(s, params) for n, s in zip(numbers, sensors, strict=True)]
        return {
            "n_sensed": sum(numbers), "n_mounted": len(numbers), "n_sensor_samples": sum(samples)
        }  # fmt: skip

    def attach(
        self, model: MjModel, data: MjData, period: float, samples_per_tick: float = 1.0
    ) -> None:
        """Make views into the simulator's memory. A sample is taken once every ``period`` [s]."""
        memory, found, start, first = self.memory, [], 0, 0
        for k, sensor in enumerate(self._kinds):
            size, slots = sum(sensor.sizes.values()), _slots(sensor, self._params)
            own = (
                memory.total[start : start + size], memory.steps[k : k + 1],
                memory.samples[first : first + slots * size], memory.count[k : k + 1],
            )  # fmt: skip
            found.append(
                SimulatedSensor(
                    sensor, model, data, self._params, self._streams, period, samples_per_tick, own
                )
            )
            start, first = start + size, first + slots * size
        self.mounted = tuple(found)

    def imu_calls(self, rate: Array, force: Array, out: ImuReading) -> list[Call]:
        """Write a sample of the IMU from the true values [rad/s, m/s^2, body]; zero without IMU."""
        if not self._has_imu:
            return [KernelCall(read_nothing, out.angular_velocity, out.specific_force)]
        true = {"angular_velocity": rate, "specific_force": force}
        return self._imu.reading_calls(true, self._imu_errors, out)

    def joint_calls(
        self, position: Array, velocity: Array, torque: Array, out: JointState
    ) -> list[Call]:
        """Write a sample of encoders and currents from the joints' true motion and torques."""
        true = {"position": position, "velocity": velocity, "torque": torque}
        return self._joints.reading_calls(true, self._joint_errors, out)

    def switch_calls(
        self, step: Counts, record: TickRecord, pressed: Flags, closed: Flags
    ) -> list[Call]:
        """Write a sample of the switches that are ``pressed``, (n_contacts,); without switches none is
        closed. ``step`` is a count without a dimension."""
        return SwitchSensors.calls(
            self._has_switches, bool(self.bounce_steps), step, pressed, record.bounce_end,
            self._streams[Purpose.BOUNCE], closed,
        )  # fmt: skip

    def mounted_calls(self, outputs: Mapping[str, Any]) -> list[Call]:
        """Write a sample of every mounted sensor to the signal that has its name."""
        return [
            call for each in self.mounted for call in each.reading_calls(outputs[each.sensor.name])
        ]

    def after_step_calls(self) -> list[Call]:
        """Return the calls of the mounted sensors after every physics step."""
        return [call for each in self.mounted for call in each.after_step_calls]


def _slots(sensor: MountedSensor, params: SimulatorParameters) -> int:
    """Return the number of samples a sensor keeps; a sample is at least a physics step."""
    late = max(sensor.noise(name).delay for name in sensor.signal.fields)
    return math.ceil(late / params.timestep - 1e-9) + 1
