"""A second writer of ROS 2's messages in CDR (OMG's Common Data Representation), to compare with.

Little endian, version 1 of the standard (``PLAIN_CDR``): four bytes that say so, then the values one
after another, each at a multiple of its own size counted from after these four bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

HEADER = b"\x00\x01\x00\x00"


class CdrWriter:
    """One message that is being written; the methods can be chained."""

    def __init__(self) -> None:
        self._body = bytearray()

    def _align(self, size: int) -> None:
        self._body.extend(bytes(-len(self._body) % size))

    def int32(self, value: int) -> CdrWriter:
        """Add a signed integer of four bytes."""
        self._align(4)
        self._body += struct.pack("<i", value)
        return self

    def uint32(self, value: int) -> CdrWriter:
        """Add an unsigned integer of four bytes."""
        self._align(4)
        self._body += struct.pack("<I", value)
        return self

    def float64s(self, values: Sequence[float]) -> CdrWriter:
        """Add float64 values of which the message's type knows the number."""
        if len(values):
            self._align(8)
            self._body += struct.pack(f"<{len(values)}d", *values)
        return self

    def float64_list(self, values: Sequence[float]) -> CdrWriter:
        """Add their number and the values."""
        return self.uint32(len(values)).float64s(values)

    def text(self, value: str) -> CdrWriter:
        """Add a text, with its length and the zero byte at its end."""
        data = value.encode() + b"\0"
        self.uint32(len(data))
        self._body += data
        return self

    def text_list(self, values: Sequence[str]) -> CdrWriter:
        """Add their number and the texts."""
        self.uint32(len(values))
        for value in values:
            self.text(value)
        return self

    def stamp(self, nanoseconds: int) -> CdrWriter:
        """Add a ``builtin_interfaces/Time``."""
        seconds, rest = divmod(nanoseconds, 1_000_000_000)
        return self.int32(seconds).uint32(rest)

    def header(self, nanoseconds: int, frame: str) -> CdrWriter:
        """Add a ``std_msgs/Header``."""
        return self.stamp(nanoseconds).text(frame)

    def bytes(self) -> bytes:
        """The whole message."""
        return HEADER + bytes(self._body)


def joint_state(
    instant: int,
    names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float],
    effort: Sequence[float],
) -> bytes:
    """A ``sensor_msgs/JointState`` [rad, rad/s, N m] at an instant [ns]."""
    message = CdrWriter().header(instant, "").text_list(names)
    return message.float64_list(position).float64_list(velocity).float64_list(effort).bytes()


def imu(
    instant: int, frame: str, angular_velocity: Sequence[float], acceleration: Sequence[float]
) -> bytes:
    """A ``sensor_msgs/Imu`` [rad/s, m/s^2] without an orientation, which its covariance says."""
    unknown = [0.0] * 9
    message = CdrWriter().header(instant, frame).float64s([0.0, 0.0, 0.0, 1.0])
    message.float64s([-1.0, *unknown[1:]]).float64s(angular_velocity).float64s(unknown)
    return message.float64s(acceleration).float64s(unknown).bytes()


def transforms(
    instant: int, parent: str, poses: Iterable[tuple[str, Sequence[float], Sequence[float]]]
) -> bytes:
    """A ``tf2_msgs/TFMessage``: child frame, translation [m] and quaternion x, y, z, w of each."""
    listed = list(poses)
    message = CdrWriter().uint32(len(listed))
    for child, translation, quaternion in listed:
        message.header(instant, parent).text(child).float64s(translation).float64s(quaternion)
    return message.bytes()
