"""Brings the readings of sensors of different delays to one time, that of the latest one."""

from __future__ import annotations

from ...mathematics.arrays import Array1D, Array2D
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ImuReading, JointState

SAMPLES = 16
"""The number of samples that are remembered."""


class SensorAlignmentParameters(Parameters):
    """The parameters of ``SensorAlignment``: by how much each reading is older than the tick."""

    rate: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of the gyroscope's readings")
    force: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of the accelerometer's")
    position: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of joint angles")
    velocity: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of joint velocities")


class AlignmentMemory(Signal):
    """The last samples, each at its tick's place in a ring."""

    rate = Field((SAMPLES, 3), unit="rad/s", text="of the gyroscope")
    force = Field((SAMPLES, 3), unit="m/s^2", text="of the accelerometer")
    position = Field((SAMPLES, "n_joints"), unit="rad", text="joint angles")
    velocity = Field((SAMPLES, "n_joints"), unit="rad/s", text="joint velocities")
    count = Field(dtype="int64", text="how many samples there were")


class SensorAlignment(Block):
    """The readings of the IMU and the joints as they were at one time, so that the estimator may use
    them together.

    Sensors measure, filter and send, each at its own pace: a reading that comes in tick t is of the time
    ``t - age``. All readings are brought to the time of the oldest, by linear interpolation between the
    samples before and after it, and ``StatePredictor`` predicts from there to the present: it must be told a
    delay that is longer by the oldest age, by ``delay.told`` with ``delay.follow: told``. A filter counts with its
    delay of slow signals: its time constant, or d / (pi f) for one of second order with cutoff f and damping d.

    With equal ages the outputs are the inputs. An age beyond 15 ticks of the oldest is taken for 15.
    """

    Params = SensorAlignmentParameters

    measured_imu = Input(ImuReading, text="readings of the IMU")
    measured_joints = Input(JointState, text="readings of the joints")
    imu = Output(ImuReading, text="at the common time")
    joints = Output(JointState, text="at the common time; torques as measured")
    memory = State(AlignmentMemory, text="the last samples")

    @kernel
    @staticmethod
    def step(
        measured_imu: ImuReading,
        measured_joints: JointState,
        imu: ImuReading,
        joints: JointState,
        memory: AlignmentMemory,
        params: SensorAlignmentParameters,
        period: float,
    ) -> None:
        oldest = max(max(params.rate, params.force), max(params.position, params.velocity))
        count = memory.count
        keep(measured_imu.angular_velocity, memory.rate, count)
        keep(measured_imu.specific_force, memory.force, count)
        keep(measured_joints.position, memory.position, count)
        keep(measured_joints.velocity, memory.velocity, count)
        interpolate(memory.rate, count, (oldest - params.rate) / period, imu.angular_velocity)
        interpolate(memory.force, count, (oldest - params.force) / period, imu.specific_force)
        interpolate(memory.position, count, (oldest - params.position) / period, joints.position)
        interpolate(memory.velocity, count, (oldest - params.velocity) / period, joints.velocity)
        joints.torque[:] = measured_joints.torque
        memory.count = count + 1


@kernel
def keep(sample: Array1D, ring: Array2D, count: int) -> None:
    """Put a sample into a ring; the first one everywhere."""
    if count == 0:
        for slot in range(ring.shape[0]):
            ring[slot, :] = sample
    ring[count % ring.shape[0], :] = sample


@kernel
def interpolate(ring: Array2D, count: int, late: float, out: Array1D) -> None:
    """The value ``late`` ticks before the newest sample, between the two samples beside it."""
    slots = ring.shape[0]
    late = min(late, slots - 1.0)
    whole = int(late)
    share = late - whole
    newer = ring[(count - whole + slots) % slots]
    older = ring[(count - whole - 1 + 2 * slots) % slots]
    for k in range(out.shape[0]):
        out[k] = newer[k] + share * (older[k] - newer[k]) if share > 0.0 else newer[k]
