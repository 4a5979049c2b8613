"""The torques of emulated actuators: each closes its loop on its own motor, at the physics rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ...robots.transmission import TransmissionMap
from ...runtime.language.steps import signal_call
from ..bear.configuration import Hardware
from ..bear.protocol import Mode
from ..simulated.drives import MotorLimits, drive_motors
from ..simulated.motor_feedback import motor_feedback
from ..simulated.state import TickRecord
from .devices import EmulatedActuator
from .snapshot import Attributes

_SLOTS = 8
"""Largest number of sets of goals on their way."""


class EmulatedDrives:
    """The torques that all actuators of a robot give its joints.

    In the modes torque and direct force the current is ``goal_iq``, in direct force plus
    ``P (goal_position - position) + D (goal_velocity - velocity)``, within ``limit_i_max``. The
    torque at the output is ``current_sign`` times the motor's torque constant times that, within its
    torque-speed curve. An actuator in damping brakes with ``braking`` [N m s/rad], as shorted windings do; one that is
    off gives no torque.

    Goals that the bus has brought act from the physics step that ``take_goals`` is given, so that
    the time on the wire and in the actuator can be simulated.

    Args:
        robot: the description.
        hardware: directions and offsets, as the driver has them.
        actuators: in the order of the robot's motors.
        record: where torques, speeds and saturation are noted.
        braking: of every actuator in damping [N m s/rad].
    """

    def __init__(
        self, robot: RobotDescription, hardware: Hardware, actuators: Sequence[EmulatedActuator],
        record: TickRecord, braking: float,
    ) -> None:  # fmt: skip
        n = len(actuators)
        self.actuators = tuple(actuators)
        self._transmission = TransmissionMap(robot)
        limits = MotorLimits(robot, record)
        self.limits = limits
        self.motor_torque = limits.motor_torque
        self._moving_at, self._limited = np.zeros(n), np.zeros(n)
        self._limit = signal_call(
            drive_motors, self._moving_at, self._limited, limits.motors, limits.scratch,
            limits.record,
        )  # fmt: skip
        settings = [hardware.motors[name] for name in robot.transmission.motors]
        self.sign = np.array([float(motor.sign) for motor in settings])
        """1 where a drive turns as the description's motor does, -1 where it does not."""
        self._offset = np.array([motor.zero for motor in settings])
        self._constant = hardware.torque_constants(robot)
        self.current_sign = np.ones(n)
        """-1 for a drive whose current turns its motor against its encoder."""
        self.velocity_sign = np.ones(n)
        """-1 for a drive that reads its velocity with the wrong sign."""
        self._brake = braking / self._constant
        self.current = np.zeros(n)
        """The torque current of every actuator [A]."""
        self.position = np.zeros(n)
        """Angle that every actuator's encoder reads [rad]; a stuck one stays."""
        self.velocity = np.zeros(n)
        """The velocity that every encoder reads [rad/s]."""
        self.stuck = np.zeros(n, dtype=np.bool_)
        """True for encoders that are stuck."""
        self.goals = np.zeros((n, 6))
        """Goals in force: current, position, velocity, P, D, and the current's limit."""
        self.queue = np.zeros((_SLOTS, n, 6))
        self.dues = np.zeros(_SLOTS, dtype=np.int64)
        self.first = self.waiting = 0
        self.last_due = -(1 << 50)
        self.torque_sum, self.torque_steps = np.zeros(n), 0
        self.enabled, self.damped = np.zeros(n), np.zeros(n)
        self._requested, self._torque = np.zeros(n), np.zeros(n)
        self._fresh_position, self._fresh_velocity = np.zeros(n), np.zeros(n)
        self._not_stuck = np.zeros(n, dtype=np.bool_)

    def parts(self) -> list[Attributes]:
        """Return the attributes that change in a run."""
        names = (
            "current", "position", "velocity", "stuck", "goals", "enabled", "damped", "queue", "dues", "first",
            "waiting", "last_due", "torque_sum", "torque_steps",
        )  # fmt: skip
        return [(self, names)]

    def take_goals(self, due: int) -> None:
        """Queue the goals in the actuators' registers for physics step ``due``, but not before those queued earlier."""
        due = max(due, self.last_due)
        slot = (self.first + self.waiting) % _SLOTS
        if self.waiting < _SLOTS:
            self.waiting += 1
        else:
            slot = (slot - 1) % _SLOTS
        self.dues[slot] = self.last_due = due
        for k, actuator in enumerate(self.actuators):
            status, config = actuator.status, actuator.config
            row = self.queue[slot, k]
            row[0] = status["goal_iq"]
            direct = config["mode"] == Mode.DIRECT_FORCE
            row[1], row[2] = status["goal_position"], status["goal_velocity"]
            row[3] = config["p_gain_direct_force"] if direct else 0.0
            row[4] = config["d_gain_direct_force"] if direct else 0.0
            row[5] = config["limit_i_max"]

    def _arrive(self, step: int) -> None:
        """Let the goals act that are due."""
        while self.waiting and self.dues[self.first] <= step:
            self.goals[:] = self.queue[self.first]
            self.first = (self.first + 1) % _SLOTS
            self.waiting -= 1

    def take_states(self) -> None:
        """Follow from now on which actuators are on, damping or off."""
        for k, actuator in enumerate(self.actuators):
            follows = actuator.config["mode"] in (Mode.TORQUE, Mode.DIRECT_FORCE)
            self.enabled[k] = float(actuator.driving and follows)
            self.damped[k] = float(actuator.damping)

    def sense(self, position: Array, velocity: Array) -> None:
        """Read the encoders, from the joints' motion [rad, rad/s]."""
        self._transmission.motor_motion(position, self._fresh_position)
        np.add(self._fresh_position, self._offset, out=self._fresh_position)
        np.multiply(self._fresh_position, self.sign, out=self._fresh_position)
        self._transmission.motor_motion(velocity, self._fresh_velocity)
        np.multiply(self._fresh_velocity, self.sign, out=self._fresh_velocity)
        moving = self._moving()
        np.copyto(self.position, self._fresh_position, where=moving)
        np.copyto(self.velocity, self._fresh_velocity, where=moving)
        np.multiply(self.velocity, self.velocity_sign, out=self.velocity, where=moving)

    def _moving(self) -> NDArray[np.bool_]:
        np.logical_not(self.stuck, out=self._not_stuck)
        return self._not_stuck

    def joint_torque(
        self, step: int, position: Array, velocity: Array, speed: Array, out: Array
    ) -> None:
        """Write the joint torques [N m] of a physics step, from the joints' motion as the encoders read
        it, and their true velocities ``speed`` [rad/s]."""
        self.sense(position, velocity)
        self._arrive(step)
        goals, current, requested = self.goals, self.current, self._requested
        motor_feedback(
            goals[:, 0], goals[:, 1], goals[:, 2], goals[:, 3], goals[:, 4],
            self.position, self.velocity, current,
        )  # fmt: skip
        np.minimum(current, goals[:, 5], out=current)
        np.negative(goals[:, 5], out=requested)
        np.maximum(current, requested, out=current)
        np.multiply(current, self.enabled, out=current)
        np.multiply(self._fresh_velocity, self.damped, out=requested)
        np.multiply(requested, self._brake, out=requested)
        np.multiply(current, self.current_sign, out=self._torque)
        np.subtract(current, requested, out=current)
        np.subtract(self._torque, requested, out=self._torque)
        np.multiply(self._torque, self._constant, out=self._torque)
        np.multiply(self._torque, self.sign, out=self._torque)
        self._transmission.joint_torque(self._torque, self._limited)
        self._moving_at[:] = speed
        self._limit.run()
        out[:] = self._limited
        np.add(self.torque_sum, self.motor_torque, out=self.torque_sum)
        self.torque_steps += 1

    def mean_current(self, out: Array) -> None:
        """Write the mean torque current of every actuator [A] since this was last called: with
        the sign of its own direction."""
        np.multiply(self._constant, max(1, self.torque_steps), out=out)
        np.divide(self.torque_sum, out, out=out)
        np.multiply(out, self.current_sign, out=out)
        np.multiply(out, self.sign, out=out)
        self.torque_sum.fill(0.0)
        self.torque_steps = 0
