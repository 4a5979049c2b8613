"""The protocol of BEAR actuators: the frames on their bus, and the registers of an actuator.

An instruction is ``FF FF | device | length | instruction | parameters | checksum`` and a reply is
``FF FF | device | length | error byte | data | checksum``. The length counts everything behind it,
the checksum included. All numbers are little-endian, and every register is 4 bytes.

Status registers change all the time and are what a bulk exchange reads and writes. Configuration
registers are kept in memory until they are saved to flash.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import pi
from typing import Literal

HEADER = b"\xff\xff"
BROADCAST = 0xFE
"""The address that every actuator listens to."""
LAST_DEVICE = 0xFC
"""The highest address of one actuator."""
LONGEST = 255
"""The largest value that the length byte can have."""


class Instruction(IntEnum):
    """Instructions to an actuator."""

    PING = 0x01
    READ_STATUS = 0x02
    WRITE_STATUS = 0x03
    READ_CONFIG = 0x04
    WRITE_CONFIG = 0x05
    SAVE_CONFIG = 0x06
    SET_POSITION = 0x08
    BULK = 0x12


@dataclass(frozen=True)
class BusFrame:
    """One whole frame. ``code`` is the instruction, or the error byte of a reply."""

    device: int
    code: int
    data: bytes = b""


def checksum(body: bytes | bytearray | memoryview) -> int:
    """Return the checksum of the bytes from the device's address to the last parameter."""
    return 255 - sum(body) % 256


def frame_bytes(device: int, code: int, data: bytes = b"") -> bytes:
    """Return the bytes of a frame.

    Raises:
        ValueError: no actuator can have that address, or the frame would be too long.
    """
    if not (0 <= device <= LAST_DEVICE or device == BROADCAST):
        raise ValueError(
            f"{device} is no address on the bus: those are 0 to {LAST_DEVICE}, and {BROADCAST} for all"
        )
    length = len(data) + 2
    if length > LONGEST:
        raise ValueError(
            f"a frame holds at most {LONGEST - 2} bytes of data, and these are {len(data)}; "
            "send several frames"
        )
    body = bytes((device, length, code)) + data
    return HEADER + body + bytes((checksum(body),))


class FrameReader:
    """Finds whole frames in a stream of bytes, whatever else is in it.

    Bytes that belong to no frame are skipped one by one, so the first good frame behind any amount
    of garbage is found. At most one frame's bytes are kept between two calls; behind a damaged
    length these may be other frames, which ``finish`` finds.

    Attributes:
        skipped: how many bytes belonged to no frame.
        damaged: how many frames had a wrong checksum.
    """

    def __init__(self) -> None:
        self._pending = bytearray()
        self.skipped = 0
        self.damaged = 0

    def clear(self) -> None:
        """Forget what was received of a frame that never came to its end."""
        self.skipped += len(self._pending)
        self._pending.clear()

    def feed(self, received: bytes | bytearray | memoryview) -> list[BusFrame]:
        """Return the frames that are whole with these bytes, in the order of their arrival."""
        pending = self._pending
        pending += received
        frames = []
        start = 0
        while len(pending) - start >= 4:
            device, length = pending[start + 2], pending[start + 3]
            possible = device <= LAST_DEVICE or device == BROADCAST
            if pending[start : start + 2] != HEADER or not possible or length < 2:
                start += 1
                self.skipped += 1
                continue
            end = start + 4 + length
            if len(pending) < end:
                break
            if checksum(memoryview(pending)[start + 2 : end - 1]) != pending[end - 1]:
                start += 1
                self.skipped += 1
                self.damaged += 1
                continue
            frames.append(BusFrame(device, pending[start + 4], bytes(pending[start + 5 : end - 1])))
            start = end
        del pending[:start]
        return frames

    def finish(self) -> list[BusFrame]:
        """Return the whole frames inside one that has begun and that no more bytes will complete."""
        frames = []
        while self._pending:
            del self._pending[0]
            self.skipped += 1
            frames += self.feed(b"")
        return frames


class Mode(IntEnum):
    """The quantity that an actuator controls."""

    TORQUE = 0
    VELOCITY = 1
    POSITION = 2
    DIRECT_FORCE = 3


class Torque(IntEnum):
    """The values of ``torque_enable``."""

    OFF = 0
    ON = 1
    ERROR = 2
    """Off because of a critical error; can only be read."""
    DAMPING = 3
    """The windings are shorted, which brakes: the software emergency stop."""


@dataclass(frozen=True)
class Register:
    """One register of 4 bytes.

    Attributes:
        area: whether it is a status or a configuration register.
        kind: ``f32`` or ``u32``, little-endian.
        least, most: the values that the actuator takes; it ignores others.
        default: the value of a new actuator.
    """

    name: str
    address: int
    area: Literal["status", "config"]
    kind: Literal["f32", "u32"] = "f32"
    unit: str = ""
    writable: bool = True
    default: float = 0.0
    least: float = float("-inf")
    most: float = float("inf")

    def pack(self, value: float) -> bytes:
        """Return the value's 4 bytes. Raises ``ValueError`` where it cannot be written."""
        if self.kind == "f32":
            return struct.pack("<f", value)
        if value != int(value) or not 0 <= value < 2**32:
            raise ValueError(f"{self.name} is a whole number from 0, and {value} is not")
        return struct.pack("<I", int(value))

    def unpack(self, data: bytes | memoryview) -> float | int:
        """Return the value of 4 bytes."""
        found: float | int = struct.unpack("<f" if self.kind == "f32" else "<I", data)[0]
        return found


def _gains(
    first: int, what: str, values: tuple[float, float, float], most: float
) -> list[Register]:
    return [
        Register(
            f"{letter}_gain_{what}", first + k, "config", default=values[k], least=0.0, most=most
        )
        for k, letter in enumerate("pid")
    ]


_TURN = 8 * pi
_CONFIG = [
    Register("id", 0x00, "config", "u32", default=1, least=0, most=0xFC),
    Register("mode", 0x01, "config", "u32", least=0, most=3),
    Register("baudrate", 0x02, "config", "u32", default=8_000_000),
    Register("homing_offset", 0x03, "config", unit="rad"),
    *_gains(0x04, "id", (1e-3, 1e-4, 0.0), 10.0),
    *_gains(0x07, "iq", (1e-3, 1e-4, 0.0), 10.0),
    *_gains(0x0A, "velocity", (0.2, 1e-3, 0.0), 1000.0),
    *_gains(0x0D, "position", (0.01, 2e-5, 0.0), 1000.0),
    *_gains(0x10, "direct_force", (0.0, 0.0, 0.0), 1000.0),
    Register("limit_acc_max", 0x13, "config", unit="rad/s^2", default=5.0, least=0.0, most=1e5),
    Register("limit_i_max", 0x14, "config", unit="A", default=5.0, least=0.0, most=100.0),
    Register("limit_velocity_max", 0x15, "config", unit="rad/s", default=100.0, least=0.0, most=1e4),
    Register("limit_position_min", 0x16, "config", unit="rad", default=-_TURN, least=-_TURN, most=_TURN),
    Register("limit_position_max", 0x17, "config", unit="rad", default=_TURN, least=-_TURN, most=_TURN),
    Register("min_voltage", 0x18, "config", unit="V", default=6.0, least=6.0, most=60.0),
    Register("max_voltage", 0x19, "config", unit="V", default=40.0, least=6.0, most=60.0),
    Register("watchdog_timeout", 0x1A, "config", "u32", "us", least=0.0, most=1e7),
    Register("temp_limit_low", 0x1B, "config", unit="degC", default=80.0, least=0.0, most=125.0),
    Register("temp_limit_high", 0x1C, "config", unit="degC", default=100.0, least=0.0, most=125.0),
]  # fmt: skip
_STATUS = [
    Register("torque_enable", 0x00, "status", "u32", least=0, most=3),
    Register("homing_complete", 0x01, "status", "u32", writable=False),
    Register("goal_id", 0x02, "status", unit="A"),
    Register("goal_iq", 0x03, "status", unit="A"),
    Register("goal_velocity", 0x04, "status", unit="rad/s"),
    Register("goal_position", 0x05, "status", unit="rad"),
    Register("present_id", 0x06, "status", unit="A", writable=False),
    Register("present_iq", 0x07, "status", unit="A", writable=False),
    Register("present_velocity", 0x08, "status", unit="rad/s", writable=False),
    Register("present_position", 0x09, "status", unit="rad", writable=False),
    Register("input_voltage", 0x0A, "status", unit="V", writable=False),
    Register("winding_temperature", 0x0B, "status", unit="degC", writable=False),
    Register("powerstage_temperature", 0x0C, "status", unit="degC", writable=False),
    Register("ic_temperature", 0x0D, "status", unit="degC", writable=False),
    Register("error_status", 0x0E, "status", "u32", writable=False),
    Register("warning_status", 0x0F, "status", "u32", writable=False),
]

CONFIG: Mapping[str, Register] = {register.name: register for register in _CONFIG}
"""The configuration registers by name."""
STATUS: Mapping[str, Register] = {register.name: register for register in _STATUS}
"""The status registers by name."""
