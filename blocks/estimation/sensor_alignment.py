"""Brings the readings of sensors to one time and one place, by what is known of the sensors."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array1D, Array2D
from ...mathematics.compiling.expressions import cross
from ...mathematics.elementary import expm1, tanh
from ...mathematics.kernel import kernel
from ...mathematics.rotations import exponential, rotate
from ...robots.transmission import PLAY_TIME, PLAY_TORQUE
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, ThreeNumbers, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import ImuReading, JointState

SAMPLES = 16
"""The number of samples that are remembered."""


class SensorAlignmentParameters(Parameters):
    """The parameters of ``SensorAlignment``: the age of each reading at the tick, the place of the IMU, and the play of
    the gears."""

    rate: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of the gyroscope's readings")
    force: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of the accelerometer's")
    position: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of joint angles")
    velocity: float = parameter(0.0, unit="s", ge=0.0, le=0.02, text="age of joint velocities")
    imu_position: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="m", text="place of the IMU, from the base's origin, base frame"
    )
    imu_rotation: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="rad", text="rotation vector from the base's axes to the IMU's"
    )
    play: PerJoint = parameter(
        PerJoint(0.0), unit="rad", ge=0.0, text="width of the gear's play before each encoder"
    )


class AlignmentMemory(Signal):
    """The last samples, each at its tick's place in a ring."""

    rate = Field((SAMPLES, 3), unit="rad/s", text="of the gyroscope")
    force = Field((SAMPLES, 3), unit="m/s^2", text="of the accelerometer")
    position = Field((SAMPLES, "n_joints"), unit="rad", text="joint angles")
    velocity = Field((SAMPLES, "n_joints"), unit="rad/s", text="joint velocities")
    count = Field(dtype="int64", text="number of samples")
    turning = Field(3, unit="rad/s", frame="body", text="angular velocity in the tick before")
    play = Field("n_joints", unit="rad", text="place of each rotor in its play")


class AlignmentConstants(Signal):
    """Constants derived from the parameters."""

    to_base = Field(4, text="quaternion from the IMU's axes to the base's")
    place = Field(3, unit="m", frame="body", text="place of the IMU")
    moved = Field(dtype="bool", text="the IMU is not at the base's origin with its axes")
    play = Field("n_joints", unit="rad", text="half the width of each play")
    has_play = Field(dtype="bool", text="there is any play")


class AlignmentScratch(Signal):
    """Scratch memory of one step of ``SensorAlignment``."""

    rate = Field(3, unit="rad/s", frame="body", text="an angular velocity")
    force = Field(3, unit="m/s^2", frame="body", text="a specific force")
    swing = Field(3, unit="rad/s^2", frame="body", text="angular acceleration")
    inwards = Field(3, unit="m/s", frame="body", text="velocity of the IMU's place by the rotation")
    position = Field("n_joints", unit="rad", text="joint angles without the play")


class SensorAlignment(Block):
    """The readings of the IMU and the joints as they were at one time, so that the estimator may use
    them together.

    Sensors measure, filter and send, each at its own pace: a reading that comes in tick t is of the time
    ``t - age``. All readings are brought to the time of the oldest, by linear interpolation between the
    samples before and after it, and ``StatePredictor`` predicts from there to the present: it must be told a
    delay that is longer by the oldest age, by ``delay.nominal`` with ``delay.follow: nominal``. A filter counts with its
    delay of slow signals: its time constant, or d / (pi f) for one of second order with cutoff f and damping d.

    The IMU's readings are turned to the base's axes and brought to the base's origin, from r, where it is::

        f_base = f - w' x r - w x (w x r)

    with the angular acceleration w' of the last tick. An encoder on the motor, behind a gear with play, reads
    half the play more or less, by the sign of the torque, which is measured with it; that is taken off before
    angles are brought to another time.

    With equal ages the outputs are the inputs. An age beyond 15 ticks of the oldest is taken for 15.
    """

    Params = SensorAlignmentParameters
    Constants = AlignmentConstants
    Scratch = AlignmentScratch
    needs = ("robot",)
    params: SensorAlignmentParameters
    constants: AlignmentConstants

    measured_imu = Input(ImuReading, text="readings of the IMU")
    measured_joints = Input(JointState, text="readings of the joints")
    imu = Output(ImuReading, text="at the common time")
    joints = Output(JointState, text="at the common time; torques as measured")
    memory = State(AlignmentMemory, text="the last samples")

    def setup(self) -> None:
        p, constants = self.params, self.constants
        exponential(np.array(p.imu_rotation), constants.to_base)
        constants.place[:] = p.imu_position
        constants.moved = any((*p.imu_position, *p.imu_rotation))
        constants.play[:] = 0.5 * p.play.resolve(self.robot)
        constants.has_play = bool(constants.play.any())

    @kernel
    @staticmethod
    def step(
        measured_imu: ImuReading,
        measured_joints: JointState,
        imu: ImuReading,
        joints: JointState,
        memory: AlignmentMemory,
        params: SensorAlignmentParameters,
        constants: AlignmentConstants,
        scratch: AlignmentScratch,
        period: float,
    ) -> None:
        oldest = max(max(params.rate, params.force), max(params.position, params.velocity))
        count = memory.count
        keep(measured_imu.angular_velocity, memory.rate, count)
        keep(measured_imu.specific_force, memory.force, count)
        scratch.position[:] = measured_joints.position
        if constants.has_play:
            take_off_play(
                measured_joints.torque, constants, memory, scratch.position, period
            )  # fmt: skip
        keep(scratch.position, memory.position, count)
        keep(measured_joints.velocity, memory.velocity, count)
        interpolate(memory.rate, count, (oldest - params.rate) / period, imu.angular_velocity)
        interpolate(memory.force, count, (oldest - params.force) / period, imu.specific_force)
        interpolate(memory.position, count, (oldest - params.position) / period, joints.position)
        interpolate(memory.velocity, count, (oldest - params.velocity) / period, joints.velocity)
        joints.torque[:] = measured_joints.torque
        if constants.moved:
            bring_to_base(imu, constants, scratch, memory, period)
        memory.count = count + 1


@kernel
def bring_to_base(
    imu: ImuReading,
    constants: AlignmentConstants,
    scratch: AlignmentScratch,
    memory: AlignmentMemory,
    period: float,
) -> None:
    """Change a reading of the IMU to what one at the base's origin, with its axes, reads."""
    rate, force = scratch.rate, scratch.force
    rotate(constants.to_base, imu.angular_velocity, rate)
    rotate(constants.to_base, imu.specific_force, force)
    if memory.count == 0:
        memory.turning[:] = rate
    swing, inwards, place = scratch.swing, scratch.inwards, constants.place
    swing[:] = (rate - memory.turning) / period
    inwards[:] = cross(rate, place)
    force[:] = force - cross(swing, place) - cross(rate, inwards)
    memory.turning[:] = rate
    imu.angular_velocity[:] = rate
    imu.specific_force[:] = force


@kernel
def take_off_play(
    torque: Array1D,
    constants: AlignmentConstants,
    memory: AlignmentMemory,
    position: Array1D,
    period: float,
) -> None:
    """Take off joint angles [rad] what the gears' play adds to them, by the torques that were measured with them."""
    share = -expm1(-period / PLAY_TIME)
    for k in range(position.shape[0]):
        end = constants.play[k] * tanh(torque[k] / PLAY_TORQUE)
        memory.play[k] += share * (end - memory.play[k])
        position[k] -= memory.play[k]


@kernel
def keep(sample: Array1D, ring: Array2D, count: int) -> None:
    """Put a sample into a ring; the first one everywhere."""
    if count == 0:
        for slot in range(ring.shape[0]):
            ring[slot, :] = sample
    ring[count % ring.shape[0], :] = sample


@kernel
def interpolate(ring: Array2D, count: int, late: float, out: Array1D) -> None:
    """Interpolate the value ``late`` ticks before the newest sample, between the two samples beside it."""
    slots = ring.shape[0]
    late = min(late, slots - 1.0)
    whole = int(late)
    share = late - whole
    newer = ring[(count - whole + slots) % slots]
    older = ring[(count - whole - 1 + 2 * slots) % slots]
    for k in range(out.shape[0]):
        out[k] = newer[k] + share * (older[k] - newer[k]) if share > 0.0 else newer[k]
