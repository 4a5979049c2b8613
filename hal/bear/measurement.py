"""Measurements of the drives and the sensor board, and the checks of whether the robot may go on driving."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import ContactSwitches, ImuReading, JointState
from ...blocks.signals.robot import describe_conditions, is_critical
from ...robots.robot_description import RobotDescription
from ...robots.transmission import TransmissionMap
from ...runtime.language.signals import Signal
from .bulk import BulkExchange
from .configuration import Hardware
from .sense_board import SenseBoard

READ = (
    "present_position", "present_velocity", "present_iq", "input_voltage", "winding_temperature",
)  # fmt: skip
"""The registers that every exchange reads, in this order."""


PLAUSIBLE = ((-60.0, 60.0), (-200.0, 200.0), (-150.0, 150.0), (0.0, 80.0), (-40.0, 200.0))
"""Possible measurements of a drive [rad, rad/s, A, V, deg C]; anything else is damage."""
LARGEST_STEP, FASTEST = 0.2, 100.0
"""Largest step of a position [rad], beside what this speed [rad/s] gives in a period; only positions cannot jump."""


class Measurement:
    """The newest measurements; a drive that does not answer keeps its last ones.

    The measured angle of a motor is ``sign * present_position - offset``, and its torque is
    ``sign * torque_constant * present_iq``. Readings of the IMU are turned to the base's axes.

    Attributes:
        position, velocity, current: of every motor [rad, rad/s, A], (n_joints,).
        voltage, temperature: of every drive [V, deg C], (n_joints,).
        joint_position, joint_velocity: of every joint [rad, rad/s], (n_joints,).
        joint_torque: of every joint [N m], (n_joints,): the mean over the exchanges since
            ``next_tick``, as a simulator gives the mean over a tick. From the newest alone the
            delay of the commands would seem up to half a tick too short.
        specific_force: the mean over the packets since ``next_tick`` [m/s^2], (3,).
        angular_velocity: of the newest packet [rad/s], (3,).
        samples: of every mounted sensor in a packet, by name; means where the sensor is averaged.
        closed: the switches in the order of the robot's contact points, (n_contacts,).
    """

    def __init__(self, robot: RobotDescription, hardware: Hardware) -> None:
        n = len(robot.joints)
        motors = [hardware.motors[name] for name in robot.transmission.motors]
        self.sign = np.array([float(motor.sign) for motor in motors])
        self.offset = np.array([motor.zero for motor in motors])
        self._drives = hardware.drives
        self.torque_constant = hardware.torque_constants(robot)
        self._to_base = hardware.board.imu_to_base
        self._turned = any(hardware.board.imu_rotation)
        self._rate, self._force = np.zeros(3), np.zeros(3)
        self.position, self.velocity, self.current = (np.zeros(n) for _ in range(3))
        self.voltage, self.temperature, self._torque = (np.zeros(n) for _ in range(3))
        self.joint_position, self.joint_velocity = np.zeros(n), np.zeros(n)
        self.joint_torque = np.zeros(n)
        self.specific_force, self.angular_velocity = np.zeros(3), np.zeros(3)
        self.closed = np.zeros(len(robot.contacts), dtype=np.bool_)
        self._transmission = TransmissionMap(robot)
        self.sum, self.count = np.zeros(3), 0
        self.current_sum, self.exchanges = np.zeros(n), 0
        self._scratch = np.zeros(n)
        points = [contact.name for contact in robot.contacts]
        self._switches = [points.index(name) for name in hardware.board.switches]
        self._opens = [name in hardware.board.normally_closed for name in hardware.board.switches]
        self._mounted = hardware.board.mounted(robot)
        self.samples = {sensor.name: sensor.signal.allocate() for sensor in self._mounted}
        self._totals = {sensor.name: sensor.signal.allocate() for sensor in self._mounted}

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
        """Write the newest values in the units and directions of the description."""
        values = bulk.values
        np.multiply(values[:, 0], self.sign, out=self.position)
        np.subtract(self.position, self.offset, out=self.position)
        np.multiply(values[:, 1], self.sign, out=self.velocity)
        np.multiply(values[:, 2], self.sign, out=self.current)
        self.voltage[:] = values[:, 3]
        self.temperature[:] = values[:, 4]
        self._transmission.joint_motion(self.position, self.joint_position)
        self._transmission.joint_motion(self.velocity, self.joint_velocity)

    def sag(self) -> float:
        """Return the drop [V] of the pack's voltage below that without load, from the work of the motors and the heat
        of their windings."""
        drives, current = self._drives, self.current
        np.multiply(self.torque_constant, current, out=self._scratch)
        work = float(np.dot(self._scratch, self.velocity))
        power = work + drives.winding_resistance * float(np.dot(current, current))
        voltage = float(self.voltage.mean())
        if power <= 0.0 or voltage <= 0.0:
            return 0.0
        return drives.pack_resistance * power / voltage

    def _mean_torque(self) -> None:
        np.divide(self.torque_constant, self.exchanges, out=self._torque)
        np.multiply(self._torque, self.current_sum, out=self._torque)
        self._transmission.joint_torque(self._torque, self.joint_torque)

    def take_board(self, board: SenseBoard) -> None:
        """Take over the newest packet of the sensor board."""
        rate, force = board.angular_velocity, board.specific_force
        if self._turned:
            np.dot(self._to_base, rate, out=self._rate)
            np.dot(self._to_base, force, out=self._force)
            rate, force = self._rate, self._force
        self.angular_velocity[:] = rate
        if self.count == 0:
            self.sum.fill(0.0)
        np.add(self.sum, force, out=self.sum)
        self._take_mounted(board)
        self.count += 1
        np.divide(self.sum, self.count, out=self.specific_force)
        for bit, point in enumerate(self._switches):
            self.closed[point] = board.closed[bit] != self._opens[bit]

    def _take_mounted(self, board: SenseBoard) -> None:
        """Take over the mounted sensors: the newest values, or their means since ``next_tick``."""
        for sensor in self._mounted:
            newest, sample = board.samples[sensor.name], self.samples[sensor.name]
            total = self._totals[sensor.name]
            for name, values in newest:
                out, added = getattr(sample, name), getattr(total, name)
                if name not in sensor.averaged:
                    out[...] = values
                    continue
                if self.count == 0:
                    added.fill(0.0)
                np.add(added, values, out=added)
                np.divide(added, self.count + 1, out=out)

    def publish_mounted(self, outputs: Mapping[str, Signal]) -> None:
        """Write the mounted sensors to a robot's ports, which have their names."""
        for name, sample in self.samples.items():
            for field, values in sample:
                getattr(outputs[name], field)[...] = values

    def parts(self) -> list[tuple[object, tuple[str, ...]]]:
        """Return the objects that change in a run, and the names of their attributes."""
        names = (
            "sum",
            "count",
            "current_sum",
            "exchanges",
            "specific_force",
            "angular_velocity",
            "closed",
        )
        signals = [*self.samples.values(), *self._totals.values()]
        return [(self, names), *((signal, tuple(signal.views())) for signal in signals)]

    def next_tick(self) -> None:
        """Begin the means of specific force and torques anew with what comes next."""
        self.count = 0
        self.forget_torques()

    def forget_torques(self) -> None:
        """Begin the mean of the torques anew with the next exchange."""
        self.exchanges = 0

    def publish(self, imu: ImuReading, joints: JointState, contacts: ContactSwitches) -> None:
        """Write the measurements to a robot's ports."""
        imu.angular_velocity[:] = self.angular_velocity
        imu.specific_force[:] = self.specific_force
        joints.position[:] = self.joint_position
        joints.velocity[:] = self.joint_velocity
        joints.torque[:] = self.joint_torque
        contacts.closed[:] = self.closed


_MOVING = 1.0
"""A motor that is faster moves [rad/s]."""


FOREIGN = 3
"""Number of somebody else's instructions that mean a second writer: one may be damage that looks so."""


class Supervision:
    """Judges every exchange. The first fault is what counts; its text names the drive or board.

    Faults, with how long they may last, in exchanges (``Hardware`` sets the numbers):

    * a drive does not answer: ``bus.lost_cycles``; it reports an error: none;
    * its voltage or winding temperature is out of range: ``drives.bad_cycles``;
    * its encoder is stuck: ``drives.stuck_cycles`` equal positions in a row, each under a current
      of ``stuck_current``, while another motor moved at 1 rad/s or faster;
    * the board sends nothing: ``board.lost_cycles``; the IMU repeats itself:
      ``board.frozen_packets``; its gyroscope is at its range: ``board.saturated_packets``;
    * another program or adapter sends instructions on the bus: ``FOREIGN`` of them.

    Args:
        hardware: the drives and limits.
        names: the motors, in the order of the exchange.

    Attributes:
        imu_silent: exchanges since the last packet of the board.
        low, hot, still, last, moved, numbers, frozen, saturated: counts and last readings.
        imu_valid: the board streams, and the IMU is neither frozen nor saturated.
    """

    def __init__(self, hardware: Hardware, names: tuple[str, ...]) -> None:
        n = len(names)
        self._hardware = hardware
        self._who = [f"drive {name} (address {hardware.motors[name].id})" for name in names]
        self.low, self.hot = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self.still = np.zeros(n, dtype=np.int64)
        self.last = np.full(n, np.nan)
        self.moved = 0
        self.numbers = np.full(6, np.nan)
        self.frozen = self.saturated = 0
        self.imu_silent = 0
        self.imu_valid = False

    def check_drives(self, measured: Measurement, bulk: BulkExchange, driving: bool) -> str:
        """Return the first fault of the drives after an exchange; empty where there is none.

        ``driving`` is true if the drives are on: errors, voltages and stuck encoders of drives
        that are off hurt nobody.
        """
        settings, ages = self._hardware.drives, bulk.ages.tolist()
        for k, age in enumerate(ages):
            if age >= self._hardware.bus.lost_cycles:
                return f"{self._who[k]} has not answered for {age} exchanges"
        if bulk.bus.counts.foreign >= FOREIGN:
            return (
                "another program or adapter sends instructions on the bus of the drives: stop it, "
                "and start again"
            )
        if not driving:
            return ""
        for k, condition in enumerate(bulk.error_bytes.tolist()):
            if is_critical(condition):
                return f"{self._who[k]}: {describe_conditions(condition)}"
        sag = measured.sag()
        lowest = max(settings.lowest_voltage - sag, settings.brown_out_voltage)
        low = _first_lasting(measured.voltage, lowest, self.low, settings.bad_cycles, -1.0)
        if low >= 0:
            voltage = measured.voltage.item(low)
            load = f", also without its sag of {sag:.1f} V" if sag >= 0.05 else ""
            limit = f"the lowest voltage of {settings.lowest_voltage:g} V{load}"
            if voltage < settings.brown_out_voltage:
                limit = f"the {settings.brown_out_voltage:g} V of a brown-out"
            return f"{self._who[low]}: {voltage:.1f} V is below {limit}"
        hot = _first_lasting(
            measured.temperature, settings.highest_temperature, self.hot, settings.bad_cycles, 1.0
        )
        if hot >= 0:
            return (
                f"{self._who[hot]}: its winding has {measured.temperature.item(hot):.0f} deg C, "
                f"and {settings.highest_temperature:g} are allowed"
            )
        return self._judge_encoders(measured, ages)

    def _judge_encoders(self, measured: Measurement, ages: list[int]) -> str:
        settings, still = self._hardware.drives, self.still
        moving = [abs(speed) > _MOVING for speed in measured.velocity.tolist()]
        self.moved = 0 if any(moving) else self.moved + 1
        for k, position in enumerate(measured.position.tolist()):
            equal = position == self.last.item(k) and ages[k] == 0
            pushed = abs(measured.current.item(k)) > settings.stuck_current
            still[k] = int(still[k]) + 1 if equal and pushed else 0
            if ages[k] == 0:
                self.last[k] = position
            if still[k] >= settings.stuck_cycles and self.moved < settings.stuck_cycles:
                return (
                    f"{self._who[k]}: its encoder has not changed in {still[k]} exchanges, under "
                    f"{measured.current.item(k):.1f} A and while others moved: it is stuck"
                )
        return ""

    def check_board(self, board: SenseBoard, fresh: int) -> str:
        """Return the first fault of the board, of which ``fresh`` packets came with this exchange."""
        settings = self._hardware.board
        self.imu_silent = 0 if fresh else self.imu_silent + 1
        if fresh:
            equal = bool((self.numbers[:3] == board.specific_force).all())
            equal = equal and bool((self.numbers[3:] == board.angular_velocity).all())
            self.frozen = self.frozen + fresh if equal else 0
            self.numbers[:3] = board.specific_force
            self.numbers[3:] = board.angular_velocity
            fastest = max(abs(rate) for rate in board.angular_velocity.tolist())
            at_range = fastest >= 0.995 * settings.gyro_range
            self.saturated = self.saturated + fresh if at_range else 0
        self.imu_valid = not (self.imu_silent or self.frozen or self.saturated)
        if self.imu_silent >= settings.lost_cycles:
            return f"the sensor board has sent nothing for {self.imu_silent} exchanges"
        if self.frozen >= settings.frozen_packets:
            return (
                f"the IMU has sent the same numbers {self.frozen + 1} times in a row: it is frozen"
            )
        if self.saturated >= settings.saturated_packets:
            return (
                f"the gyroscope has been at its range of {settings.gyro_range:g} rad/s for "
                f"{self.saturated} packets"
            )
        return ""


def _first_lasting(
    values: NDArray[np.float64], limit: float, counts: NDArray[np.int64], most: int, sign: float
) -> int:
    """Return the first value that has been beyond the limit (above for sign 1, below for -1) so many times in a row; -1
    where there is none."""
    found = -1
    for k, value in enumerate(values.tolist()):
        counts[k] = count = int(counts[k]) + 1 if sign * value > sign * limit else 0
        if count >= most and found < 0:
            found = k
    return found
