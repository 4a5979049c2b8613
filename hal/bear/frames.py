"""The frames that travel on the bus of BEAR actuators, and how they are found in a stream of bytes.

An instruction is ``FF FF | device | length | instruction | parameters | checksum`` and a reply is
``FF FF | device | length | error byte | data | checksum``. The length counts everything behind it,
the checksum included. All numbers are little-endian, and every register is 4 bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

HEADER = b"\xff\xff"
BROADCAST = 0xFE
"""The address that every actuator listens to."""
LAST_DEVICE = 0xFC
"""The highest address of one actuator."""
LONGEST = 255
"""The largest value that the length byte can have."""


class Instruction(IntEnum):
    """What an actuator is told to do."""

    PING = 0x01
    READ_STATUS = 0x02
    WRITE_STATUS = 0x03
    READ_CONFIG = 0x04
    WRITE_CONFIG = 0x05
    SAVE_CONFIG = 0x06
    SET_POSITION = 0x08
    BULK = 0x12


@dataclass(frozen=True)
class Frame:
    """One whole frame. ``code`` is the instruction, or the error byte of a reply."""

    device: int
    code: int
    data: bytes = b""


def checksum(body: bytes | bytearray | memoryview) -> int:
    """The checksum of the bytes from the device's address to the last parameter."""
    return 255 - sum(body) % 256


def frame_bytes(device: int, code: int, data: bytes = b"") -> bytes:
    """The bytes of a frame.

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
    of garbage is found. At most one frame's bytes are kept between two calls.

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

    def feed(self, received: bytes | bytearray | memoryview) -> list[Frame]:
        """The frames that are whole with these bytes, in the order of their arrival."""
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
            frames.append(Frame(device, pending[start + 4], bytes(pending[start + 5 : end - 1])))
            start = end
        del pending[:start]
        return frames
