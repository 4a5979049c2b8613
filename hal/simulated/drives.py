"""The drives of a simulated robot: delayed commands, joint feedback and motor limits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...blocks.signals import CommandMode, JointCommand
from ...mathematics.arrays import Array, Counts, Flags
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ..drive_goals import Targets
from .actuator import (
    MotorRecord,
    Motors,
    MotorScratch,
    drive_motors,
    joint_feedback_torque,
)
from .motor_feedback import Loops, MotorFeedback, close_loops
from .state import DriveState, TickRecord

_ACTIVE, _DAMPING = int(CommandMode.ACTIVE), int(CommandMode.DAMPING)


class Commands(NamedTuple):
    """A ring of commands, of which one is active and some are on their way: see ``DriveState``."""

    active: Counts
    pending: Counts
    due: Counts
    mode: Counts
    targets: Targets


class Joints(NamedTuple):
    """What the drives of all joints read and give in a physics step: the count of the step, without a
    dimension, whether a command has ``arrived`` in it, (1,), the ``position`` that their encoders read [rad], the ``velocity`` [rad/s] and the ``torque`` [N m],
    each (n_joints,)."""

    step: Counts
    arrived: Flags
    position: Array
    velocity: Array
    torque: Array


@kernel
def follow_commands(commands: Commands, released: Array, joints: Joints) -> None:
    """Let the commands act that are due, and write the joint torques that the active one asks for.

    Args:
        released: the damping in the damping mode [N m s/rad], (n_joints,).
    """
    active, pending = int(commands.active[()]), int(commands.pending[()])
    joints.arrived[0] = False
    while pending > 0:
        following = (active + 1) % commands.due.shape[0]
        if commands.due[following] > joints.step[()]:
            break
        active, pending = following, pending - 1
        joints.arrived[0] = True
    commands.active[()] = active
    commands.pending[()] = pending
    mode = int(commands.mode[active])
    if mode == _ACTIVE:
        joint_feedback_torque(
            commands.targets.torque[active], commands.targets.stiffness[active],
            commands.targets.damping[active], commands.targets.position[active],
            commands.targets.velocity[active], joints.position, joints.velocity, joints.torque,
        )  # fmt: skip
        return
    for k in range(joints.torque.shape[0]):
        joints.torque[k] = float(joints.velocity[k]) * -float(released[k])
        if mode != _DAMPING:
            joints.torque[k] = 0.0


@kernel
def drive_joints(
    commands: Commands,
    released: Array,
    joints: Joints,
    motors: Motors,
    scratch: MotorScratch,
    record: MotorRecord,
) -> None:
    """The joint torques of a physics step: what the commands ask for, as far as the motors can."""
    follow_commands(commands, released, joints)
    drive_motors(joints.velocity, joints.torque, motors, scratch, record)


@kernel
def drive_loops(
    commands: Commands,
    released: Array,
    loops: Loops,
    joints: Joints,
    motors: Motors,
    scratch: MotorScratch,
    record: MotorRecord,
) -> None:
    """The same where the drives close the loops per motor, once a command has arrived."""
    follow_commands(commands, released, joints)
    active = int(commands.active[()])
    if int(commands.mode[active]) == _ACTIVE:
        close_loops(
            loops, commands.targets, active, bool(joints.arrived[0]), joints.position,
            joints.velocity, joints.torque,
        )  # fmt: skip
    drive_motors(joints.velocity, joints.torque, motors, scratch, record)


class Given(NamedTuple):
    """The fields of ``JointCommand``."""

    mode: Counts
    torque: Array
    position: Array
    velocity: Array
    stiffness: Array
    damping: Array


class Way(NamedTuple):
    """How long a command is on its way: ``shortest`` (1,) [s], and up to ``jitter`` [s] longer, as a
    number ``drawn`` (1,) between zero and one says, in physics steps of ``timestep`` [s]."""

    shortest: Array
    jitter: float
    drawn: Array
    timestep: float


@kernel
def send_command(
    given: Given, step: Counts, way: Way, commands: Commands, last_due: Counts
) -> None:
    """Put a command into the ring, behind those that are on their way.

    ``step`` and ``last_due``, the arrival of the command sent last, have no dimension.
    """
    delay = float(way.shortest[0])
    if way.jitter != 0.0:
        delay += way.jitter * float(way.drawn[0])
    due = int(step[()]) + math.ceil(delay / way.timestep - 1e-9)
    due = max(due, int(last_due[()]))
    pending = int(commands.pending[()])
    slot = (int(commands.active[()]) + 1 + pending) % commands.due.shape[0]
    targets = commands.targets
    commands.mode[slot] = int(given.mode[()])
    for k in range(given.torque.shape[0]):
        targets.torque[slot, k] = given.torque[k]
        targets.position[slot, k] = given.position[k]
        targets.velocity[slot, k] = given.velocity[k]
        targets.stiffness[slot, k] = given.stiffness[k]
        targets.damping[slot, k] = given.damping[k]
    commands.due[slot] = due
    last_due[()] = due
    commands.pending[()] = pending + 1


class MotorLimits:
    """What ``drive_motors`` needs to limit joint torques to what the motors can do at their speed, and
    to record how near they come to it."""

    def __init__(self, robot: RobotDescription, record: TickRecord) -> None:
        motors = robot.motors
        self.motors = Motors(
            np.ascontiguousarray(robot.joint_to_motor),
            np.ascontiguousarray(robot.torque_to_motor),
            np.ascontiguousarray(robot.joint_to_motor.T),
            motors.peak_torque,
            motors.peak_torque / (motors.no_load_speed - motors.corner_speed),
            motors.no_load_speed,
        )
        n = len(robot.joints)
        self.scratch = MotorScratch(*(np.zeros(n) for _ in MotorScratch._fields))
        self.record = MotorRecord(*(getattr(record, name) for name in MotorRecord._fields))
        self.motor_torque = self.scratch.torque
        """The motors' torques of the last step [N m], (n_joints,)."""


class Drives:
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
        self._commands = Commands(
            state.active, state.pending, state.due, state.mode,
            Targets(*(getattr(state, name) for name in Targets._fields)),
        )  # fmt: skip
        self._damping = damping
        self._motors = limits.motors, limits.scratch, limits.record

    def torque_call(self, step: Counts, position: Array, velocity: Array, out: Array) -> KernelCall:
        """Writes the joint torques [N m] during a physics step to ``out``, (n_joints,).

        Args:
            step: the count of the step, without a dimension.
            position: the reading of the drives' own encoders [rad], (n_joints,).
            velocity: the joint velocity [rad/s], (n_joints,).
        """
        joints = Joints(step, np.zeros(1, np.bool_), position, velocity, out)
        first = self._commands, self._damping
        if self._feedback is None:
            return KernelCall(drive_joints, *first, joints, *self._motors)
        return KernelCall(drive_loops, *first, self._feedback.loops, joints, *self._motors)

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

    def sending(self, command: JointCommand, step: Counts, way: Way) -> KernelCall:
        """Sends a command in the physics step ``step``, a count without a dimension. It arrives as
        late as its ``way`` is long, but not before earlier commands."""
        given = Given(*(getattr(command, name) for name in Given._fields))
        return KernelCall(send_command, given, step, way, self._commands, self._state.last_due)
