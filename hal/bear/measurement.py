"""What the drives and the sensor board measure, in the units and directions of the description."""

from __future__ import annotations

import numpy as np

from ...blocks.signals import ContactSwitches, ImuReading, JointState
from ...robots.robot_description import RobotDescription
from ...robots.transmission import Transmission
from .bulk import BulkExchange
from .configuration import Hardware
from .sense_board import SenseBoard

READ = (
    "present_position", "present_velocity", "present_iq", "input_voltage", "winding_temperature",
)  # fmt: skip
"""The registers that every exchange reads, in this order."""


PLAUSIBLE = ((-60.0, 60.0), (-200.0, 200.0), (-150.0, 150.0), (0.0, 80.0), (-40.0, 200.0))
"""What a drive can measure [rad, rad/s, A, V, deg C]; anything else is damage."""
LARGEST_STEP, FASTEST = 0.2, 100.0
"""How far [rad] a position may be from the last one, beside what this speed [rad/s] gives in a
period; only positions cannot jump."""


class Measurement:
    """The newest measurements; a drive that does not answer keeps its last ones.

    The measured angle of a motor is ``sign * present_position - offset``, and its torque is
    ``sign * torque_constant * present_iq``.

    Attributes:
        position, velocity, current: of every motor [rad, rad/s, A], (n_joints,).
        voltage, temperature: of every drive [V, deg C], (n_joints,).
        joint_position, joint_velocity: of every joint [rad, rad/s], (n_joints,).
        joint_torque: of every joint [N m], (n_joints,): the mean over the exchanges since
            ``next_tick``, as a simulator gives the mean over a tick. From the newest alone the
            delay of the commands would seem up to half a tick too short.
        specific_force: the mean over the packets since ``next_tick`` [m/s^2], (3,).
        angular_velocity: of the newest packet [rad/s], (3,).
        closed: the switches in the order of the robot's contact points, (n_contacts,).
    """

    def __init__(self, robot: RobotDescription, hardware: Hardware) -> None:
        n = len(robot.joints)
        motors = [hardware.motors[name] for name in robot.transmission.motors]
        self.sign = np.array([float(motor.sign) for motor in motors])
        self.offset = np.array([motor.offset for motor in motors])
        self.torque_constant = hardware.drives.torque_constant
        self.position, self.velocity, self.current = (np.zeros(n) for _ in range(3))
        self.voltage, self.temperature, self._torque = (np.zeros(n) for _ in range(3))
        self.joint_position, self.joint_velocity = np.zeros(n), np.zeros(n)
        self.joint_torque = np.zeros(n)
        self.specific_force, self.angular_velocity = np.zeros(3), np.zeros(3)
        self.closed = np.zeros(len(robot.contacts), dtype=np.bool_)
        self._transmission = Transmission(robot)
        self.sum, self.count = np.zeros(3), 0
        self.current_sum, self.exchanges = np.zeros(n), 0
        points = [contact.name for contact in robot.contacts]
        self._switches = [points.index(name) for name in hardware.board.switches]

    def take_drives(self, bulk: BulkExchange) -> None:
        """Take over the values of an exchange that reads ``READ``."""
        self.show(bulk)
        if self.exchanges == 0:
            self.current_sum.fill(0.0)
        np.add(self.current_sum, self.current, out=self.current_sum)
        self.exchanges += 1
        self._mean_torque()

    def restored(self, bulk: BulkExchange) -> None:
        """Show what was measured before the driver's memory was restored."""
        self.show(bulk)
        if self.exchanges:
            self._mean_torque()

    def show(self, bulk: BulkExchange) -> None:
        """The newest values in the units and directions of the description."""
        values = bulk.values
        np.multiply(values[:, 0], self.sign, out=self.position)
        np.subtract(self.position, self.offset, out=self.position)
        np.multiply(values[:, 1], self.sign, out=self.velocity)
        np.multiply(values[:, 2], self.sign, out=self.current)
        self.voltage[:] = values[:, 3]
        self.temperature[:] = values[:, 4]
        self._transmission.joint_motion(self.position, self.joint_position)
        self._transmission.joint_motion(self.velocity, self.joint_velocity)

    def _mean_torque(self) -> None:
        np.multiply(self.current_sum, self.torque_constant / self.exchanges, out=self._torque)
        self._transmission.joint_torque(self._torque, self.joint_torque)

    def take_board(self, board: SenseBoard) -> None:
        """Take over the newest packet of the sensor board."""
        self.angular_velocity[:] = board.angular_velocity
        if self.count == 0:
            self.sum.fill(0.0)
        np.add(self.sum, board.specific_force, out=self.sum)
        self.count += 1
        np.divide(self.sum, self.count, out=self.specific_force)
        for bit, point in enumerate(self._switches):
            self.closed[point] = board.closed[bit]

    def next_tick(self) -> None:
        """The means of specific force and torques begin anew with what comes next."""
        self.count = 0
        self.forget_torques()

    def forget_torques(self) -> None:
        """The mean of the torques begins anew with the next exchange."""
        self.exchanges = 0

    def publish(self, imu: ImuReading, joints: JointState, contacts: ContactSwitches) -> None:
        """Write the measurements to a robot's ports."""
        imu.angular_velocity[:] = self.angular_velocity
        imu.specific_force[:] = self.specific_force
        joints.position[:] = self.joint_position
        joints.velocity[:] = self.joint_velocity
        joints.torque[:] = self.joint_torque
        contacts.closed[:] = self.closed
