"""BRUCE's sensor board: accelerometer, gyroscope and four foot switches, a packet a millisecond.

The board sends ``FF | 1B | acceleration 3 f32 m/s^2 | angular velocity 3 f32 rad/s | switches |
checksum | FE``, 29 bytes, and takes ``FF | 03 | cooling << 2 | mode | checksum | FE``. A board with
further sensors sends their numbers behind the switches, and its packets and their length are longer.
The checksum is 255 less the sum of the bytes from the length to the last before it, modulo 256.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from ..sensors.sensor import MountedSensor
from .bus import BusError, SerialPort
from .protocol import checksum

START, END = 0xFF, 0xFE
LENGTH = 0x1B
PACKET = 29
"""Bytes of a packet without mounted sensors."""
LONGEST = 250
"""The largest value of a packet's length: 0xFE and 0xFF end and begin packets."""
_SENSORS = 27
"""Offset of the numbers of mounted sensors in a packet."""
CALIBRATION = 0xFF
"""The switches' byte of a packet that tells of a calibration."""
SWITCHES = ("right_toe", "right_heel", "left_toe", "left_heel")
"""The contact point of each of the lowest bits of the switches' byte."""
MAX_COOLING = 10


class BoardMode(IntEnum):
    """Instructions to the sensor board."""

    IDLE = 0
    NOMINAL = 1
    """Stream packets."""
    RESET_IMU = 2
    CALIBRATE = 3
    """Average the IMU's bias over 10,000 samples; said twice, within 15 s."""


def command_bytes(mode: BoardMode, cooling: int = 0) -> bytes:
    """Return the command for the board: its mode, and the cooling pump's and fan's strength, 0 to 10.

    Raises:
        ValueError: there is no such strength.
    """
    if not 0 <= cooling <= MAX_COOLING:
        raise ValueError(f"the cooling's strength is 0 to {MAX_COOLING}, and {cooling} is not")
    body = bytes((0x03, cooling << 2 | mode))
    return bytes((START, *body, checksum(body), END))


class SenseBoard:
    """The stream of the sensor board's packets, read without waiting.

    Bytes that belong to no packet are skipped one by one until the next good packet.

    Args:
        port: where the board is.
        sensors: the mounted sensors in a packet, in their order.

    Attributes:
        samples: the newest sample of each mounted sensor, by its name.
        specific_force: of the newest packet [m/s^2], (3,), in the board's frame.
        angular_velocity: of the newest packet [rad/s], (3,).
        closed: which switches are closed in the newest packet, (4,), as in ``SWITCHES``.
        packets: how many good packets came.
        calibrations: how many of them told of a calibration; those change no measurement.
        skipped: how many bytes belonged to no packet.
        damaged: how many packets had a wrong checksum.
    """

    def __init__(self, port: SerialPort, sensors: Sequence[MountedSensor] = ()) -> None:
        self.port = port
        self._sensors = tuple(sensors)
        self.samples = {sensor.name: sensor.signal.allocate() for sensor in sensors}
        further = sum(sensor.packet_size() for sensor in sensors)
        if LENGTH + further > LONGEST:
            raise BusError(f"a packet with {further} bytes of mounted sensors is too long")
        self._length, self._size = LENGTH + further, PACKET + further
        self.specific_force = np.zeros(3)
        self.angular_velocity = np.zeros(3)
        self.closed = np.zeros(4, dtype=bool)
        self.packets = self.calibrations = self.skipped = self.damaged = 0
        self._pending = bytearray()
        self._packet = bytearray(self._size)
        self._numbers = np.frombuffer(self._packet, "<f4", 6, 2)
        port.timeout = 0.0

    def send(self, mode: BoardMode, cooling: int = 0) -> None:
        """Set the mode; while it streams the board looks for commands once a second."""
        self.port.write(command_bytes(mode, cooling))

    def poll(self) -> int:
        """Take over what has come since; gives the number of new measurements, 0 for none."""
        received = self.port.read(64 * self._size)
        return self.feed(received) if received else 0

    def feed(self, received: bytes) -> int:
        """Take over bytes; gives the number of new measurements among them."""
        pending = self._pending
        pending += received
        start = new = 0
        while len(pending) - start >= self._size:
            if pending[start] != START or pending[start + 1] != self._length:
                start += 1
                self.skipped += 1
                continue
            end = start + self._size
            packet = memoryview(pending)[start:end]
            good = packet[-1] == END and checksum(packet[1:-2]) == packet[-2]
            if good:
                self._packet[:] = packet
            packet.release()
            if not good:
                start += 1
                self.skipped += 1
                self.damaged += 1
                continue
            start = end
            new += self._take()
        del pending[:start]
        return new

    def _take(self) -> int:
        self.packets += 1
        switches = self._packet[26]
        if switches == CALIBRATION:
            self.calibrations += 1
            return 0
        self.specific_force[:] = self._numbers[:3]
        self.angular_velocity[:] = self._numbers[3:]
        for bit in range(4):
            self.closed[bit] = bool(switches & 1 << bit)
        start = _SENSORS
        for sensor in self._sensors:
            end = start + sensor.packet_size()
            sensor.from_packet(self._packet[start:end], self.samples[sensor.name])
            start = end
        return 1

    def require(self, port_name: str, packets: int = 1) -> None:
        """See to it that the board streams.

        Raises:
            BusError: fewer packets came than that.
        """
        if self.packets < packets:
            raise BusError(
                f"the sensor board at {port_name} sent {self.packets} packets instead of {packets} "
                f"({self.skipped} bytes belonged to none); check that it is powered and that no "
                "other program reads from it"
            )
