"""The drives of a simulated robot: delayed commands, joint feedback and motor limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import CommandMode, JointCommand
from ...robots.description import RobotDescription
from .actuator import clip_joint_torque, joint_feedback_torque, motor_torque_limits
from .motor_feedback import MotorFeedback
from .state import DriveState, TickRecord

Array = NDArray[np.float64]


class MotorLimits:
    """Limits joint torques to what the motors can do at their speed, and records how near they
    come to it."""

    def __init__(self, robot: RobotDescription, record: TickRecord) -> None:
        self._record = record
        self._joint_to_motor = np.ascontiguousarray(robot.joint_to_motor)
        self._motor_to_torque = np.ascontiguousarray(robot.joint_to_motor.T)
        self._torque_to_motor = robot.torque_to_motor
        motors = robot.motors
        self._peak, self._no_load = motors.peak_torque, motors.no_load_speed
        self._slope = motors.peak_torque / (motors.no_load_speed - motors.corner_speed)
        n = len(robot.joints)
        self._speed, self._wanted = np.zeros(n), np.zeros(n)
        self.motor_torque = np.zeros(n)
        """The motors' torques of the last call [N m], (n_joints,)."""
        self._lower, self._upper, self._excess = (np.zeros(n) for _ in range(3))
        self._clipped, self._one = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.int64)

    def apply(self, velocity: Array, torque: Array) -> None:
        """Limit the joint ``torque`` [N m] at the joint ``velocity`` [rad/s] in place."""
        record = self._record
        np.dot(self._joint_to_motor, velocity, out=self._speed)
        motor_torque_limits(
            self._speed, self._peak, self._slope, self._no_load, self._lower, self._upper
        )  # fmt: skip
        clip_joint_torque(
            torque, self._torque_to_motor, self._motor_to_torque, self._lower, self._upper,
            self._wanted, self.motor_torque,
        )  # fmt: skip
        np.not_equal(self._wanted, self.motor_torque, out=self._clipped)
        np.add(record.saturated, self._one, out=record.saturated, where=self._clipped)
        np.maximum(record.torque_high, self.motor_torque, out=record.torque_high)
        np.minimum(record.torque_low, self.motor_torque, out=record.torque_low)
        np.maximum(record.speed_high, self._speed, out=record.speed_high)
        np.minimum(record.speed_low, self._speed, out=record.speed_low)
        np.subtract(self.motor_torque, self._upper, out=self._excess)
        np.maximum(record.overload, self._excess, out=record.overload)
        np.subtract(self._lower, self.motor_torque, out=self._excess)
        np.maximum(record.overload, self._excess, out=record.overload)
        np.add(record.joint_torque, torque, out=record.joint_torque)


class Row(NamedTuple):
    """One command of the ring, each field (n_joints,)."""

    torque: Array
    stiffness: Array
    damping: Array
    position: Array
    velocity: Array


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
        self._negative_damping = -damping
        self._state = state
        self._limits = MotorLimits(robot, record)
        self._scratch = np.zeros(len(robot.joints))
        self._slots = len(state.due)
        self._rows = [
            Row(state.torque[k], state.stiffness[k], state.damping[k], state.position[k],
                state.velocity[k])
            for k in range(self._slots)
        ]  # fmt: skip

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

    def send(self, command: JointCommand, due: int) -> None:
        """Send a command. It arrives at physics step ``due``, but not before earlier commands."""
        state = self._state
        due = max(due, int(state.last_due))
        pending = int(state.pending)
        slot = (int(state.active) + 1 + pending) % self._slots
        torque, stiffness, damping, position, velocity = self._rows[slot]
        state.mode[slot] = command.mode
        torque[:] = command.torque
        position[:] = command.position
        velocity[:] = command.velocity
        stiffness[:] = command.stiffness
        damping[:] = command.damping
        state.due[slot] = due
        state.last_due[()] = due
        state.pending[()] = pending + 1

    def joint_torque(self, step: int, position: Array, velocity: Array, out: Array) -> None:
        """Write the joint torques [N m] during physics step ``step`` to ``out``.

        ``position`` is the reading of the drives' own encoders [rad], ``velocity`` the joint
        velocity [rad/s].
        """
        state = self._state
        pending = int(state.pending)
        active = int(state.active)
        arrived = False
        while pending:
            following = (active + 1) % self._slots
            if state.due[following] > step:
                break
            active, pending, arrived = following, pending - 1, True
            state.active[()] = active
            state.pending[()] = pending
        mode = int(state.mode[active])
        if mode == CommandMode.ACTIVE:
            command, feedback = self._rows[active], self._feedback
            if feedback is None or not feedback.write(command, arrived, position, velocity, out):
                joint_feedback_torque(
                    command.torque, command.stiffness, command.damping, command.position,
                    command.velocity, position, velocity, out, self._scratch,
                )  # fmt: skip
        elif mode == CommandMode.DAMPING:
            np.multiply(velocity, self._negative_damping, out=out)
        else:
            out.fill(0.0)
        self._limits.apply(velocity, out)
