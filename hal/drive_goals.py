"""What each drive is told to do, from the command of the joints and the newest measurement.

A drive in direct-force mode closes a loop with fixed gains on its own motor::

    current = goal_iq + P (goal_position - position) + D (goal_velocity - velocity)

The gains are registers that can be written only while the torque is off, but the command's gains
differ from tick to tick: zero where a leg stands, large where it swings. So the goals are chosen
such that, at the instant of the measurement, the joints get exactly the torque that the command
asks for, and the drive's own loop acts on as much of the error as the command's gains allow::

    phi_goal  = phi + phi' T + s (phi_d - phi)     s: share of the drive's stiffness, 0 to 1
    phi_goal' = phi' + d (phi_d' - phi')           d: share of its damping
    kappa     = A^-T (tau + Kp (q_d - q) + Kd (q_d' - q')) - s P (phi_d - phi) - d D (phi_d' - phi')

With the gains that the drives were given, ``s`` and ``d`` are 1 and ``kappa`` is the feedforward
alone: the whole feedback runs in the drives. With zero gains both are 0: the goals then are the
measured motion, carried on by the time ``T`` that passes until they arrive, and the drive adds no
torque of its own. What the drives cannot give, such as different gains on coupled joints, is left
in ``kappa`` and runs at the rate of the bus instead.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..robots.robot_description import RobotDescription
from ..robots.transmission import Transmission

Array = NDArray[np.float64]


class JointTargets(Protocol):
    """What a command says of the joints: ``JointCommand`` without its mode, each (n_joints,)."""

    @property
    def torque(self) -> Array: ...
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def stiffness(self) -> Array: ...
    @property
    def damping(self) -> Array: ...


class DriveGoals:
    """The goals of all drives for one command.

    Args:
        robot: the description.
        stiffness, damping: the joints' gains that the drives were set for [N m/rad, N m s/rad].
        motor_stiffness, motor_damping: the drives' own gains, at the motors' outputs.
        lead: the time from a measurement to when the goals made from it act [s].

    Attributes:
        torque, position, velocity: the goals of every motor [N m, rad, rad/s], (n_joints,).
    """

    def __init__(
        self, robot: RobotDescription, stiffness: Array, damping: Array, motor_stiffness: Array,
        motor_damping: Array, lead: float,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self._transmission = Transmission(robot)
        self._gears = [np.flatnonzero(row).tolist() for row in robot.joint_to_motor]
        self._stiffness, self._damping = stiffness.tolist(), damping.tolist()
        self._motor_stiffness, self._motor_damping = motor_stiffness, motor_damping
        self._lead = lead
        self.torque, self.position, self.velocity = (np.zeros(n) for _ in range(3))
        self._joint, self._rate, self._wanted = (np.zeros(n) for _ in range(3))
        self._share, self._own = np.zeros(n), np.zeros(n)

    def follow(
        self, command: JointTargets, position: Array, velocity: Array, joint_position: Array,
        joint_velocity: Array,
    ) -> None:  # fmt: skip
        """Set the goals for an active command and the measured motion of motors and joints."""
        np.subtract(command.position, joint_position, out=self._joint)
        np.subtract(command.velocity, joint_velocity, out=self._rate)
        np.multiply(self._joint, command.stiffness, out=self._wanted)
        np.add(self._wanted, command.torque, out=self._wanted)
        np.multiply(self._rate, command.damping, out=self._own)
        np.add(self._wanted, self._own, out=self._wanted)
        self._transmission.motor_torque(self._wanted, self.torque)

        self._transmission.motor_motion(self._joint, self.position)
        self._set_shares(command.stiffness.tolist(), self._stiffness)
        np.multiply(self.position, self._share, out=self.position)
        np.multiply(self.position, self._motor_stiffness, out=self._own)
        np.subtract(self.torque, self._own, out=self.torque)
        np.add(self.position, position, out=self.position)

        self._transmission.motor_motion(self._rate, self.velocity)
        # Where the drive follows the target by itself, its goal needs no lead.
        np.subtract(1.0, self._share, out=self._share)
        np.multiply(self._share, velocity, out=self._own)
        np.multiply(self._own, self._lead, out=self._own)
        np.add(self.position, self._own, out=self.position)
        self._set_shares(command.damping.tolist(), self._damping)
        np.multiply(self.velocity, self._share, out=self.velocity)
        np.multiply(self.velocity, self._motor_damping, out=self._own)
        np.subtract(self.torque, self._own, out=self.torque)
        np.add(self.velocity, velocity, out=self.velocity)

    def hold(self, position: Array) -> None:
        """Set the goals to motor angles [rad] at rest, without any torque of their own."""
        self.torque.fill(0.0)
        self.position[:] = position
        self.velocity.fill(0.0)

    def _set_shares(self, commanded: list[float], drives: list[float]) -> None:
        """Of each motor, the least share of the drives' gains among the joints it moves."""
        for motor, joints in enumerate(self._gears):
            share = 1.0
            for joint in joints:
                own = drives[joint]
                if own > 0.0:
                    share = min(share, commanded[joint] / own)
            self._share[motor] = share
