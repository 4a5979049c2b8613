"""The drives of a simulated robot: delayed commands, joint feedback, motor torque limits by speed.

Motors are not joints. With ``A`` the transmission's ``joint_to_motor``, motor speed is ``A qd``,
motor torque is ``kappa = A^-T tau`` and joint torque is ``tau = A^T kappa``. A motor limit is
therefore a box in motor space and a rotated box in joint space. Where every motor is geared 1:1 to
at most two joints, as in BRUCE, these products round the same on every CPU.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...blocks.signals import CommandMode, JointCommand
from ...mathematics.arrays import (
    Array,
    Array1D,
    Array2D,
    Counts,
    Flags1D,
    Indices0D,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.signals import Field, Signal
from ...runtime.language.steps import signal_call
from .motor_feedback import MotorFeedback, MotorLoops, close_loops
from .state import DriveState, TickRecord, update_maximum, update_minimum


class DriveTrain(NamedTuple):
    """Limits of a robot's motors, and their transmission to the joints.

    ``joint_to_motor``, ``torque_to_motor`` and ``motor_to_torque``, each (n, n), map joint
    velocities to motor speeds, joint torques to motor torques, and motor torques to joint torques.
    ``peak`` [N m], ``slope`` [N m s/rad] and ``no_load`` [rad/s], each (n,), are the curves of
    ``motor_torque_limits``.
    """

    joint_to_motor: Array2D
    torque_to_motor: Array2D
    motor_to_torque: Array2D
    peak: Array1D
    slope: Array1D
    no_load: Array1D


class MotorScratch(Signal):
    """Torques and speeds of the motors in the present physics step."""

    speed = Field("n_joints", unit="rad/s", text="their speeds")
    lower = Field("n_joints", unit="N m", text="their lower torque limits")
    upper = Field("n_joints", unit="N m", text="their upper torque limits")
    requested = Field("n_joints", unit="N m", text="commanded torques of the joints")
    torque = Field("n_joints", unit="N m", text="torques that they produce")


@kernel
def motor_torque_limits(
    speed: Array1D, peak: Array1D, slope: Array1D, no_load: Array1D, lower: Array1D, upper: Array1D
) -> None:
    """Write the torque limits [N m] of motors at ``speed`` [rad/s] to ``lower`` and ``upper``.

    ``peak`` is available up to the corner speed and falls linearly, by ``slope`` [N m s/rad],
    to zero at ``no_load``; above that the motor cannot drive at all. Against the
    motion (braking) ``peak`` is available at any speed. A motor with a peak of zero does nothing.
    All arguments have one element a motor.
    """
    for k in range(speed.shape[0]):
        turning, most = speed[k], peak[k]
        idle, fall = no_load[k], slope[k]
        upper[k] = max(min(most, (idle - turning) * fall), 0.0)
        lower[k] = min(-min(most, (idle + turning) * fall), 0.0)


@kernel
def joint_feedback_torque(
    feedforward: Array1D,
    stiffness: Array1D,
    damping: Array1D,
    position_target: Array1D,
    velocity_target: Array1D,
    position: Array1D,
    velocity: Array1D,
    out: Array1D,
) -> None:
    """Write feedforward plus joint feedback [N m] to ``out`` (paper, V, first equation):
    ``tau_ff + Kp (q_d - q) + Kd (qd_d - qd)``."""
    out[:] = (
        (position_target - position) * stiffness
        + feedforward
        + (velocity_target - velocity) * damping
    )


@kernel
def clip_joint_torque(
    torque: Array1D,
    torque_to_motor: Array2D,
    motor_to_torque: Array2D,
    lower: Array1D,
    upper: Array1D,
    motor_requested: Array1D,
    motor_torque: Array1D,
) -> None:
    """Limit the joint ``torque`` [N m] to what the motors can produce.

    ``motor_requested`` receives the commanded motor torques, and ``motor_torque`` those that
    are produced, within ``lower`` and ``upper``. ``torque_to_motor`` is the inverse of
    ``motor_to_torque``, which is the transpose of ``joint_to_motor``. What is not a number stays so.
    """
    multiply_vector(torque_to_motor, torque, motor_requested)
    for k in range(motor_torque.shape[0]):
        produced = motor_requested[k]
        produced = max(produced, lower[k])
        produced = min(produced, upper[k])
        motor_torque[k] = produced
    multiply_vector(motor_to_torque, motor_torque, torque)


@kernel
def drive_motors(
    velocity: Array1D,
    torque: Array1D,
    motors: DriveTrain,
    scratch: MotorScratch,
    record: TickRecord,
) -> None:
    """Limit the joint ``torque`` [N m] at the joint ``velocity`` [rad/s] in place, and record how near the motors come
    to their limits, and torques that are not a number."""
    multiply_vector(motors.joint_to_motor, velocity, scratch.speed)
    motor_torque_limits(
        scratch.speed, motors.peak, motors.slope, motors.no_load, scratch.lower, scratch.upper
    )
    clip_joint_torque(
        torque, motors.torque_to_motor, motors.motor_to_torque, scratch.lower, scratch.upper,
        scratch.requested, scratch.torque,
    )  # fmt: skip
    for k in range(torque.shape[0]):
        produced, speed = scratch.torque[k], scratch.speed[k]
        if produced != scratch.requested[k]:
            record.saturated[k] += 1
        update_maximum(record.torque_high, k, produced)
        update_minimum(record.torque_low, k, produced)
        update_maximum(record.speed_high, k, speed)
        update_minimum(record.speed_low, k, speed)
        update_maximum(record.overload, k, produced - scratch.upper[k])
        update_maximum(record.overload, k, scratch.lower[k] - produced)
        record.joint_torque[k] += torque[k]


class Joints(NamedTuple):
    """Readings and torques of all joints' drives in a physics step: the count of the step, without a dimension, whether
    a command has ``arrived`` in it, (1,), the ``position`` that their encoders read [rad], the ``velocity`` [rad/s] and
    the ``torque`` [N m], each (n_joints,)."""

    step: Indices0D
    arrived: Flags1D
    position: Array1D
    velocity: Array1D
    speed: Array1D
    torque: Array1D


@kernel
def follow_commands(commands: DriveState, released: Array1D, joints: Joints) -> None:
    """Let the commands act that are due, and write the joint torques that the active one asks for.

    Args:
        released: the damping in the damping mode [N m s/rad], (n_joints,).
    """
    active, pending = commands.active, commands.pending
    joints.arrived[0] = False
    while pending > 0:
        following = (active + 1) % commands.due.shape[0]
        if commands.due[following] > joints.step[()]:
            break
        active, pending = following, pending - 1
        joints.arrived[0] = True
    commands.active = active
    commands.pending = pending
    mode = commands.mode[active]
    if mode == CommandMode.ACTIVE:
        joint_feedback_torque(
            commands.torque[active], commands.stiffness[active], commands.damping[active],
            commands.position[active], commands.velocity[active], joints.position,
            joints.velocity, joints.torque,
        )  # fmt: skip
    elif mode == CommandMode.DAMPING:
        joints.torque[:] = joints.velocity * -released
    else:
        joints.torque[:] = 0.0


@kernel
def drive_joints(
    commands: DriveState,
    released: Array1D,
    joints: Joints,
    motors: DriveTrain,
    scratch: MotorScratch,
    record: TickRecord,
) -> None:
    """Compute the joint torques of a physics step: those of the commands, as far as the motors can give them."""
    follow_commands(commands, released, joints)
    drive_motors(joints.speed, joints.torque, motors, scratch, record)


@kernel
def drive_loops(
    commands: DriveState,
    released: Array1D,
    loops: MotorLoops,
    joints: Joints,
    motors: DriveTrain,
    scratch: MotorScratch,
    record: TickRecord,
) -> None:
    """Compute the joint torques as ``drive_joints``, but once a command has arrived each drive closes the loop of its
    motor."""
    follow_commands(commands, released, joints)
    active = commands.active
    if commands.mode[active] == CommandMode.ACTIVE:
        close_loops(
            loops, commands, active, joints.arrived[0], joints.position, joints.velocity,
            joints.torque,
        )  # fmt: skip
    drive_motors(joints.speed, joints.torque, motors, scratch, record)


class CommandLatency(NamedTuple):
    """The latency of a command: ``minimum + draw * jitter`` [s], rounded up to physics steps of
    ``timestep`` [s]. ``minimum`` and ``draw``, a random number from zero to one, are (1,)."""

    minimum: Array1D
    jitter: float
    draw: Array1D
    timestep: float


@kernel
def send_command(
    command: JointCommand, step: Indices0D, latency: CommandLatency, commands: DriveState
) -> None:
    """Put a command into the ring in the physics step ``step``, a count without a dimension. It arrives
    as late as its ``latency`` is long, but not before earlier commands."""
    delay = latency.minimum[0]
    if latency.jitter != 0.0:
        delay += latency.jitter * latency.draw[0]
    due = step[()] + math.ceil(delay / latency.timestep - 1e-9)
    due = max(due, commands.last_due)
    slot = (commands.active + 1 + commands.pending) % commands.due.shape[0]
    commands.mode[slot] = command.mode
    commands.torque[slot, :] = command.torque
    commands.position[slot, :] = command.position
    commands.velocity[slot, :] = command.velocity
    commands.stiffness[slot, :] = command.stiffness
    commands.damping[slot, :] = command.damping
    commands.due[slot] = due
    commands.last_due = due
    commands.pending += 1


class MotorLimits:
    """Memory of ``drive_motors`` to limit joint torques to those that the motors can give at their speed, and to record
    how near they come to it."""

    def __init__(self, robot: RobotDescription, record: TickRecord) -> None:
        motors = robot.motors
        self.motors = DriveTrain(
            np.ascontiguousarray(robot.joint_to_motor),
            np.ascontiguousarray(robot.torque_to_motor),
            np.ascontiguousarray(robot.joint_to_motor.T),
            motors.peak_torque,
            motors.peak_torque / (motors.no_load_speed - motors.corner_speed),
            np.array(motors.no_load_speed),
        )
        self.scratch = MotorScratch.allocate(robot.dimensions)
        self.record = record
        self.motor_torque = self.scratch.torque
        """The motors' torques of the last step [N m], (n_joints,)."""


class SimulatedDrives:
    """Turns commands into joint torques at the physics rate, because drives close their own loops.

    A command takes effect at the first physics step at or after its arrival and stays in effect
    until the next one arrives. All memory of the drives is in the given ``state`` and ``record``.

    Args:
        robot: the description, with the actuator profile in use.
        damping: the damping of every joint in the damping mode [N m s/rad], (n_joints,).
        state: the active command and the commands that have not arrived yet.
        record: where saturation, peak torques and excesses over limits are noted.
        feedback: closes the loops of commands per motor; without it every joint gets its command's
            own feedback.
    """

    def __init__(
        self,
        robot: RobotDescription,
        damping: Array,
        state: DriveState,
        record: TickRecord,
        feedback: MotorFeedback | None = None,
    ) -> None:
        self._feedback = feedback
        self._state = state
        limits = MotorLimits(robot, record)
        self.limits = limits
        self._damping = damping
        self._motors = limits.motors, limits.scratch, limits.record

    def torque_call(
        self, step: Counts, position: Array, velocity: Array, speed: Array, out: Array
    ) -> KernelCall:
        """Return the call that writes the joint torques [N m] during a physics step to ``out``, (n_joints,).

        Args:
            step: the count of the step, without a dimension.
            position: the reading of the drives' own encoders [rad], (n_joints,).
            velocity: the joint velocity that they make of it [rad/s], (n_joints,).
            speed: the true joint velocity [rad/s], (n_joints,).
        """
        joints = Joints(step, np.zeros(1, np.bool_), position, velocity, speed, out)
        first = self._state, self._damping
        if self._feedback is None:
            return signal_call(drive_joints, *first, joints, *self._motors)
        return signal_call(drive_loops, *first, self._feedback.loops, joints, *self._motors)

    def hold(self, position: Array, torque: Array, stiffness: Array, damping: Array) -> None:
        """Drop all commands and from now on hold the joints at a position with these gains.

        Args:
            position: the joint angles to hold [rad], (n_joints,).
            torque: the feedforward torques [N m], (n_joints,).
            stiffness, damping: the gains [N m/rad, N m s/rad], (n_joints,).
        """
        if self._feedback is not None:
            self._feedback.reset()
        self._state.active[()] = 0
        self._state.pending[()] = 0
        self._state.last_due[()] = 0
        self._state.mode[0] = CommandMode.ACTIVE
        self._state.torque[0] = torque
        self._state.position[0] = position
        self._state.velocity[0] = 0.0
        self._state.stiffness[0] = stiffness
        self._state.damping[0] = damping

    def damp(self) -> None:
        """Drop all commands and go into damping at once."""
        self._state.pending[()] = 0
        self._state.mode[int(self._state.active)] = CommandMode.DAMPING

    def send_call(self, command: JointCommand, step: Counts, latency: CommandLatency) -> KernelCall:
        """Return the call that sends a command in the physics step ``step``, a count without a dimension."""
        return signal_call(send_command, command, step, latency, self._state)
