"""Predicts the state over the delay, so that the controller works where its command takes effect."""

from __future__ import annotations

from ...mathematics.compiling.expressions import cross
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import exponential, multiply, rotate, rotate_back
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, DelayEstimate, JointState, Phase, PhaseState, WholeBodyCommand

COMMANDS = 24
"""The number of commands that are remembered."""


class CommandMemory(Signal):
    """The state of ``StatePredictor``."""

    acceleration = Field((COMMANDS, "n_velocities"), text="of the last commands, newest first")
    loaded = Field(COMMANDS, dtype="bool", text="a point was in stance in these ticks")


class StatePredictorScratch(Signal):
    """Intermediate values of a tick of ``StatePredictor``."""

    fall = Field(3, unit="m/s^2", frame="body", text="acceleration of the base in free fall")
    velocity_change = Field("n_velocities", text="change of the velocity within ``ahead``")
    position_change = Field("n_velocities", text="change of the position, in axes of the base")
    vector = Field(3, text="a vector")
    turn = Field(4, text="quaternion of the base's rotation within ``ahead``")


class StatePredictor(Block):
    """The state when the command of this tick takes effect, by the commands that are on their way.

    The commands that are computed from t - d on act at t and later, d being the delay from sensing
    to torque. Each is the whole-body controller's and has its accelerations v', which are known. So
    the state at t + a, with a = ``delay.ahead`` <= d, follows from the measured one (the finite
    spectrum of Manitius and Olbrot 1979, a Smith predictor for the whole state)::

        v(t + a) = v(t) + sum_i w_i v'_i,    w_i the time within [t, t + a] in which command i acts
        q(t + a) = q(t) + a v(t) + sum_i w_i (a - m_i) v'_i,    m_i the middle of that time

    With an exact model the feedback loop then has the phase lag of the rest of the delay, d - a,
    alone, whatever d is.

    While no point was in stance the base falls freely, and joints, which their drives control
    without this delay, and the base keep their angular velocity. After touchdown nothing is assumed
    about the commands that were still made for flight: the impact is not known. Measurement noise
    of a velocity adds a times itself to a position. With ``ahead`` 0 the output is the input.
    """

    Scratch = StatePredictorScratch
    needs = ("floating base",)

    measured_base = Input(BaseState, text="pose and velocity of the base")
    measured_joints = Input(JointState, text="joint angles and velocities")
    command = Input(WholeBodyCommand, text="the last whole-body command")
    phase = Input(PhaseState, text="the phase and the points in stance of that command")
    delay = Input(DelayEstimate, text="the delay, and the time to predict ahead")
    base = Output(BaseState, text="the base when the command takes effect")
    joints = Output(JointState, text="the joints then; torques as measured")
    memory = State(CommandMemory, text="the commands on their way")

    @kernel
    @staticmethod
    def step(
        measured_base: BaseState,
        measured_joints: JointState,
        command: WholeBodyCommand,
        phase: PhaseState,
        delay: DelayEstimate,
        base: BaseState,
        joints: JointState,
        memory: CommandMemory,
        scratch: StatePredictorScratch,
        period: float,
    ) -> None:
        remember_command(command, phase, memory)
        fall_freely(measured_base, scratch)
        add_commands(phase, delay, period, memory, scratch)
        predict_base(measured_base, delay.ahead, base, scratch)
        predict_joints(measured_joints, delay.ahead, joints, scratch)


@kernel
def remember_command(command: WholeBodyCommand, phase: PhaseState, memory: CommandMemory) -> None:
    """Put the last command before the others."""
    for i in range(COMMANDS - 1, 0, -1):
        memory.loaded[i] = memory.loaded[i - 1]
        memory.acceleration[i, :] = memory.acceleration[i - 1]
    memory.acceleration[0, :] = command.acceleration
    memory.loaded[0] = False
    for point in range(phase.stance.shape[0]):
        memory.loaded[0] = memory.loaded[0] or phase.stance[point]


@kernel
def fall_freely(base: BaseState, scratch: StatePredictorScratch) -> None:
    """Compute the rate of the base's velocity in its own axes in free fall: R' g - w x (R' v)."""
    fall, velocity = scratch.fall, scratch.vector
    fall[0], fall[1], fall[2] = 0.0, 0.0, -GRAVITY
    rotate_back(base.orientation, fall, fall)
    rotate_back(base.orientation, base.linear_velocity, velocity)
    fall[:] = fall - cross(base.angular_velocity, velocity)


@kernel
def add_commands(
    phase: PhaseState,
    delay: DelayEstimate,
    period: float,
    memory: CommandMemory,
    scratch: StatePredictorScratch,
) -> None:
    """Compute the changes of velocity and position within ``ahead`` by the commands that act then.

    The command that is i + 1 ticks old acts from delay - (i + 1) period on, for a period.
    """
    velocity, position, ahead = scratch.velocity_change, scratch.position_change, delay.ahead
    velocity[:] = 0.0
    position[:] = 0.0
    for i in range(COMMANDS):
        begin = max(delay.delay - (i + 1) * period, 0.0)
        end = ahead if i == 0 else min(delay.delay - i * period, ahead)
        duration = end - begin
        if duration <= 0.0:
            continue
        weight = duration * (ahead - 0.5 * (begin + end))
        if memory.loaded[i]:
            velocity[:] += duration * memory.acceleration[i]
            position[:] += weight * memory.acceleration[i]
        elif phase.phase == Phase.FLIGHT:
            velocity[:3] += duration * scratch.fall
            position[:3] += weight * scratch.fall


@kernel
def predict_base(
    measured: BaseState, ahead: float, base: BaseState, scratch: StatePredictorScratch
) -> None:
    """Move the base on by its velocity and by what the commands change."""
    velocity, position, vector = scratch.velocity_change, scratch.position_change, scratch.vector
    rotate_back(measured.orientation, measured.linear_velocity, vector)
    velocity[:3] += vector
    position[:3] += ahead * vector
    position[3:6] += ahead * measured.angular_velocity
    rotate(measured.orientation, position[0:3], vector)
    base.position[:] = measured.position + vector
    exponential(position[3:6], scratch.turn)
    multiply(measured.orientation, scratch.turn, base.orientation)
    rotate(base.orientation, velocity[0:3], base.linear_velocity)
    base.angular_velocity[:] = measured.angular_velocity + velocity[3:6]


@kernel
def predict_joints(
    measured: JointState, ahead: float, joints: JointState, scratch: StatePredictorScratch
) -> None:
    """Move the joints on likewise; their torques are as measured."""
    joints.velocity[:] = measured.velocity + scratch.velocity_change[6:]
    joints.position[:] = measured.position + ahead * measured.velocity + scratch.position_change[6:]
    joints.torque[:] = measured.torque
