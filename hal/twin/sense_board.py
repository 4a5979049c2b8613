"""The sensor board as its port sees it: packets out, commands in."""

from __future__ import annotations

import struct

import numpy as np

from ...blocks.signals import ImuReading
from ..bear.frames import checksum
from ..bear.sense_board import END, LENGTH, START, BoardMode

_COMMAND = 5


class EmulatedBoard:
    """BRUCE's sensor board: it sends a packet whenever ``packet`` is called while it streams.

    It streams from the start, as the real one does after it was told to once. A command is taken
    when its checksum is right. Calibration is acknowledged by one packet whose switches' byte is
    0xFF; the bias that the real board would store is not simulated.

    Attributes:
        mode: the mode it was told.
        cooling: the cooling's strength it was told, 0 to 10.
    """

    def __init__(self) -> None:
        self.mode = BoardMode.NOMINAL
        self.cooling = 0
        self._pending = bytearray()
        self._calibrating = False

    def receive(self, data: bytes) -> None:
        """Take bytes that the host sends."""
        pending = self._pending
        pending += data
        while len(pending) >= _COMMAND:
            command = bytes(pending[:_COMMAND])
            whole = command[0] == START and command[1] == 3 and command[4] == END
            if whole and checksum(command[1:3]) == command[3]:
                self.mode, self.cooling = BoardMode(command[2] & 3), command[2] >> 2
                self._calibrating = self.mode is BoardMode.CALIBRATE
                del pending[:_COMMAND]
            else:
                del pending[:1]

    def packet(self, imu: ImuReading, closed: np.ndarray) -> bytes:
        """The next packet; empty while the board does not stream."""
        if self._calibrating:
            self._calibrating, self.mode, contacts = False, BoardMode.NOMINAL, 0xFF
        elif self.mode is not BoardMode.NOMINAL:
            return b""
        else:
            contacts = 0x80 | sum(1 << bit for bit, each in enumerate(closed.tolist()) if each)
        numbers = struct.pack("<6f", *imu.specific_force.tolist(), *imu.angular_velocity.tolist())
        body = bytes((LENGTH,)) + numbers + bytes((contacts,))
        return bytes((START,)) + body + bytes((checksum(body), END))
