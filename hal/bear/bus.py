"""The bus of BEAR actuators: one master, and actuators that only answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ...blocks.signals.robot import HEALTHY, describe_conditions, is_critical
from ...runtime.language.errors import AloftError
from .protocol import (
    BROADCAST,
    CONFIG,
    STATUS,
    BusFrame,
    FrameReader,
    Instruction,
    Register,
    frame_bytes,
)

BAUDRATE = 8_000_000
"""The rate of a new actuator [bit/s]."""
REPLY_TIME = 3e-3
"""Seconds that an actuator has for its reply: transfer, the adapter's delay of 1 ms, a reserve."""
TRIES = 3
"""Number of questions before an actuator counts as silent."""


class BusError(AloftError):
    """The bus or an actuator on it does not do what it should; the message names which."""


class NoReplyError(BusError):
    """An actuator stays silent."""


class SerialPort(Protocol):
    """The methods of a serial port that the bus needs; ``serial.Serial`` has them."""

    timeout: float | None

    @property
    def in_waiting(self) -> int:
        """The number of bytes received and not read."""

    def write(self, data: bytes | bytearray, /) -> int | None:
        """Send all bytes."""

    def read(self, size: int = 1, /) -> bytes:
        """Up to ``size`` bytes, and what has come when ``timeout`` seconds are over."""

    def reset_input_buffer(self) -> None:
        """Discard what was received and not read."""

    def close(self) -> None:
        """Give the port back."""


@dataclass(frozen=True)
class Reply:
    """Answer of an actuator: its error byte and its data."""

    device: int
    error_byte: int
    data: bytes

    @property
    def problem(self) -> str:
        """The faults that the error byte reports, in words."""
        return describe_conditions(self.error_byte)

    @property
    def failed(self) -> bool:
        """True if the actuator has switched its torque off."""
        return is_critical(self.error_byte)


@dataclass
class BusCounts:
    """Counts of errors on the bus since it was opened."""

    silent: int = 0
    """Questions without an answer in time."""
    damaged: int = 0
    """Frames with a wrong checksum."""
    stray: int = 0
    """Frames of somebody else, or with the wrong number of bytes."""
    foreign: int = 0
    """Instructions that another program or adapter sent to the actuators."""


def open_port(path: str, baudrate: int = BAUDRATE) -> SerialPort:
    """Return the serial port at ``path``, for this process alone.

    Raises:
        BusError: there is no such port, or another process has it.
    """
    import serial

    try:
        port: SerialPort = serial.Serial(path, baudrate, timeout=REPLY_TIME, exclusive=True)
    except (serial.SerialException, OSError, ValueError) as error:
        raise BusError(
            f"the serial port {path} cannot be opened: {error}; look for its name with "
            "`ls /dev/serial/by-id`, and for another program that uses it"
        ) from error
    return port


class BearBus:
    """Questions to single actuators and their answers, in order, one at a time.

    A question that only reads is asked again where the answer is missing or damaged; a write has
    no answer and is sent once. Values that an actuator would ignore because they are out of its
    range are refused here.

    Args:
        port: the serial port.
        reply_time: seconds that an actuator has for its reply.
    """

    def __init__(self, port: SerialPort, *, reply_time: float = REPLY_TIME) -> None:
        self.port = port
        self.reply_time = reply_time
        self.counts = BusCounts()
        self.now: Callable[[], float] = getattr(port, "now", time.monotonic)
        """The time [s] by which answers are awaited; a port in virtual time has its own."""
        self._reader = FrameReader()

    def close(self) -> None:
        """Give the port back."""
        self.port.close()

    def overhear(self, received: bytes | bytearray | memoryview) -> None:
        """Count the instructions among bytes that are no answers to a question of ours."""
        reader = FrameReader()
        for frame in (*reader.feed(received), *reader.finish()):
            if _is_instruction(frame):
                self.counts.foreign += 1

    def listen(self, seconds: float) -> int:
        """Stay silent and count the instructions that somebody else sends meanwhile."""
        before, end = self.counts.foreign, self.now() + seconds
        received = bytearray()
        while (left := end - self.now()) > 0.0:
            self.port.timeout = left
            received += self.port.read(256)
        self.overhear(received)
        return self.counts.foreign - before

    def ping(self, device: int) -> Reply:
        """Ask whether an actuator is there; its reply holds 4 bytes of versions.

        Raises:
            NoReplyError: it is not.
        """
        return self._ask(device, Instruction.PING, b"", 4)

    def scan(self, devices: Sequence[int]) -> dict[int, Reply]:
        """Ask the actuators of those addresses once each, and return those that answer."""
        found = {}
        for device in devices:
            reply = self._try(frame_bytes(device, Instruction.PING), device, 4)
            if reply is not None:
                found[device] = reply
        return found

    def read(self, device: int, *names: str) -> dict[str, float]:
        """Return the values of status or configuration registers, by name.

        Raises:
            BusError: there is no such register.
            NoReplyError: the actuator does not answer.
        """
        registers = [register_of(name) for name in names]
        values: dict[str, float] = {}
        for area, code in (
            ("status", Instruction.READ_STATUS),
            ("config", Instruction.READ_CONFIG),
        ):
            wanted = [register for register in registers if register.area == area]
            if not wanted:
                continue
            addresses = bytes(register.address for register in wanted)
            data = self._ask(device, code, addresses, 4 * len(wanted)).data
            for k, register in enumerate(wanted):
                values[register.name] = register.unpack(data[4 * k : 4 * k + 4])
        return {register.name: values[register.name] for register in registers}

    def write(self, device: int, values: Mapping[str, float]) -> None:
        """Set registers, by name. The actuator sends no answer; ``verify`` reads them back.

        Raises:
            BusError: there is no such register, it cannot be written, or the value is out of its
                range: nothing is sent then.
        """
        parts: dict[str, bytes] = {}
        for name, value in values.items():
            register = register_of(name)
            _check_value(register, value)
            part = bytes((register.address,)) + register.pack(value)
            parts[register.area] = parts.get(register.area, b"") + part
        for area, code in (
            ("status", Instruction.WRITE_STATUS),
            ("config", Instruction.WRITE_CONFIG),
        ):
            if area in parts:
                self.port.write(frame_bytes(device, code, parts[area]))

    def verify(self, device: int, values: Mapping[str, float]) -> None:
        """Set registers and read them back.

        Raises:
            BusError: a register has another value afterwards; or as ``write`` and ``read``.
        """
        self.write(device, values)
        found = self.read(device, *values)
        for name, value in values.items():
            register = register_of(name)
            if found[name] != register.unpack(register.pack(value)):
                raise BusError(
                    f"actuator {device}: {name} was set to {value:g} {register.unit} and is "
                    f"{found[name]:g}; configuration can only be set while the torque is off"
                )

    def save(self, device: int) -> None:
        """Keep the configuration in flash memory, which bears some 10,000 writes."""
        self.port.write(frame_bytes(device, Instruction.SAVE_CONFIG))

    def _ask(self, device: int, code: Instruction, data: bytes, length: int) -> Reply:
        """Ask up to ``tries`` times, and return the answer."""
        question = frame_bytes(device, code, data)
        for _ in range(TRIES):
            reply = self._try(question, device, length)
            if reply is not None:
                return reply
        raise NoReplyError(
            f"actuator {device} does not answer {code.name} after {TRIES} tries of "
            f"{1e3 * self.reply_time:g} ms; check its power, its address and the cable"
        )

    def _try(self, question: bytes, device: int, length: int) -> Reply | None:
        """Return the answer with ``length`` bytes of data, or none in time.

        Raises:
            BusError: the question itself comes back.
        """
        self.port.reset_input_buffer()
        self._reader.clear()
        self.port.write(question)
        end = self.now() + self.reply_time
        missing = length + 6
        while True:
            left = end - self.now()
            if left <= 0.0:
                self.counts.silent += 1
                return None
            self.port.timeout = left
            for frame in self._read_frames(missing):
                if _is_instruction(frame):
                    if frame_bytes(frame.device, frame.code, frame.data) == question:
                        raise BusError(
                            f"what is sent to actuator {device} comes back: switch off the echo of "
                            "the adapter, or stop the other program that sends the same"
                        )
                    self.counts.foreign += 1
                elif is_answer(frame.code) and (frame.device, len(frame.data)) == (device, length):
                    return Reply(device, frame.code, frame.data)
                else:
                    self.counts.stray += 1

    def _read_frames(self, size: int) -> list[BusFrame]:
        before = self._reader.damaged
        frames = self._reader.feed(self.port.read(size))
        self.counts.damaged += self._reader.damaged - before
        return frames


def is_answer(code: int) -> bool:
    """Check whether the fifth byte of a frame is the error byte of an answer and no instruction: the highest bit of an
    error byte is always set, that of an instruction never."""
    return bool(code & HEALTHY)


def _is_instruction(frame: BusFrame) -> bool:
    """Check whether a frame is an instruction, and a sensible one: pieces of damaged answers may have a right checksum
    by chance."""
    size = len(frame.data)
    match frame.code:
        case Instruction.PING | Instruction.SAVE_CONFIG:
            return size == 0
        case Instruction.READ_STATUS | Instruction.READ_CONFIG:
            return 0 < size <= len(CONFIG) and frame.device != BROADCAST
        case Instruction.WRITE_STATUS | Instruction.WRITE_CONFIG:
            return size > 0 and size % 5 == 0
        case Instruction.BULK:
            return frame.device == BROADCAST and size > 2
    return False


def register_of(name: str) -> Register:
    """Return the register called ``name``.

    Raises:
        BusError: there is none; the message names the nearest.
    """
    register = STATUS.get(name) or CONFIG.get(name)
    if register is None:
        from difflib import get_close_matches

        near = get_close_matches(name, [*STATUS, *CONFIG], 3)
        hint = f"; the nearest are {', '.join(near)}" if near else ""
        raise BusError(f"BEAR actuators have no register {name!r}{hint}")
    return register


def _check_value(register: Register, value: float) -> None:
    if not register.writable:
        raise BusError(f"{register.name} can only be read")
    if not register.least <= value <= register.most:  # also refuses what is not a number
        raise BusError(
            f"{register.name} takes {register.least:g} to {register.most:g} {register.unit}, and "
            f"{value:g} would be ignored by the actuator"
        )
