"""Two guards of a robot that is switched on: a watchdog process, which damps the drives when the graph
hangs or dies, and the dead man's switch, a gamepad's button or a key that somebody must hold."""

from __future__ import annotations

import mmap
import os
import socket
import struct
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from ...processes.child_process import ChildError, ChildProcess
from .bus import BusError
from .configuration import DeadMan
from .protocol import BROADCAST, STATUS, Instruction, Torque, frame_bytes
from .watchdog_process import ASKED, CLOSING, SIZE, TRIPPED, UNTIL

_STARTING = 10.0
"""Longest time for the process to start [s]."""
_ANSWERING = 0.5
"""Longest time for a run to answer that it has stopped [s]."""
_ENDING = 5.0
"""Longest time for the process to end, once it is asked to [s]."""


def damping_frame(devices: list[int]) -> bytes:
    """Return the instruction that puts all these drives into damping; nobody answers it."""
    register = STATUS["torque_enable"]
    goals = b"".join(bytes((device,)) + register.pack(Torque.DAMPING) for device in devices)
    head = bytes((len(devices), 0x01, register.address))
    return frame_bytes(BROADCAST, Instruction.BULK, head + goals)


class DriveWatchdog:
    """A process that commands damping when ``beat`` was not called for ``limit`` seconds, when
    links have brought no commands for ``silence`` seconds, when this process has died, or when somebody
    calls ``ask_to_stop`` for the same port. It shares the open port, so no opening can fail then.

    It begins to count at the first beat. Its process looks every millisecond whether its parent is
    still the one that started it: a pipe's end would come late where a copy of the graph's process
    still holds the other end.

    Args:
        port_fd: the file descriptor of the drives' port.
        devices: the drives' addresses.
        limit: the time without a beat [s].
        silence: the time without commands from other machines [s].
        port: the name of the drives' port; without one nobody can ask it to stop.

    Raises:
        BusError: the process does not start.
    """

    def __init__(
        self, port_fd: int, devices: list[int], limit: float, silence: float = 0.0, port: str = ""
    ) -> None:
        stops = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        if port:
            stops.bind(_stop_address(port))
        memory_fd = os.memfd_create("aloft-watchdog")
        os.truncate(memory_fd, SIZE)
        self._memory = mmap.mmap(memory_fd, SIZE)
        self._limit, self._silence = int(limit * 1e9), int(silence * 1e9)
        program = Path(__file__).with_name("watchdog_process.py")
        frame = damping_frame(devices).hex()
        try:
            self._process = ChildProcess(
                "the watchdog's process", program,
                [str(port_fd), str(memory_fd), str(stops.fileno()), frame],
                descriptors=(port_fd, memory_fd, stops.fileno()),
            )  # fmt: skip
        finally:
            os.close(memory_fd)
            stops.close()
        try:
            self._process.wait_until_ready(_STARTING)
        except ChildError as error:
            self.close()
            raise BusError(f"{error}: nothing was enabled") from error

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def beat(self, last_command: int = 0) -> None:
        """Note that the graph is alive.

        ``last_command`` says when commands last came from another machine, by the monotonic clock [ns];
        zero where they are made here. So the process notices silent links although this one hangs.
        """
        until = time.monotonic_ns() + self._limit
        if last_command:
            until = min(until, last_command + self._silence)
        struct.pack_into("Q", self._memory, UNTIL, until)

    @property
    def tripped(self) -> bool:
        """True if it has taken over and damps."""
        return bool(self._read(TRIPPED))

    @property
    def asked(self) -> bool:
        """True if somebody has asked it to stop, and it has damped the drives once."""
        return bool(self._read(ASKED))

    def close(self) -> None:
        """End the process: the drives are in damping already, or were never on."""
        with suppress(ValueError):
            struct.pack_into("Q", self._memory, CLOSING, 1)
        self._process.stop(asked=_ENDING)

    def _read(self, place: int) -> int:
        return int(struct.unpack_from("Q", self._memory, place)[0])


def ask_to_stop(port: str) -> bool:
    """Ask the run that holds this port to damp its drives; return whether one has."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ours:
        ours.bind("")  # an address to answer to
        ours.settimeout(_ANSWERING)
        try:
            ours.sendto(b"stop", _stop_address(port))
            return ours.recv(16) == b"damped"
        except OSError:  # nobody listens
            return False


def _stop_address(port: str) -> bytes:
    """Return the abstract socket that belongs to a port: it vanishes with the processes that have it."""
    return b"\0aloft drives " + os.path.realpath(port).encode()


_EVENT = struct.Struct("<IhBB")
"""Linux's joystick event: time, value, type, number."""
_BUTTON, _INITIAL = 0x01, 0x80
_KEY_TIME = 0.1
"""A held key repeats at least 10.9 times a second; after so long without it was let go [s]."""


class DeadMansSwitch(Protocol):
    """Something that is held or let go."""

    def held(self) -> bool:
        """Check whether it is held now, without waiting."""

    def close(self) -> None:
        """Give the device back."""


class AlwaysHeld:
    """No switch: for a twin, or a robot that cannot move."""

    def held(self) -> bool:
        """Yes."""
        return True

    def close(self) -> None:
        """Nothing to give back."""


class GamepadButton:
    """A button of a gamepad; one that is unplugged is let go.

    Raises:
        BusError: there is no such device.
    """

    def __init__(self, device: str, button: int) -> None:
        try:
            self._file = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise BusError(
                f"the dead man's switch {device} cannot be opened: {error.strerror}; plug the "
                "gamepad in, or set dead_man in the hardware's file"
            ) from error
        self._button = button
        self._held = False

    def held(self) -> bool:
        """Check whether the button is down."""
        try:
            while len(event := os.read(self._file, _EVENT.size)) == _EVENT.size:
                _, value, kind, number = _EVENT.unpack(event)
                if kind & ~_INITIAL == _BUTTON and number == self._button:
                    self._held = bool(value)
        except BlockingIOError:
            pass  # nothing new
        except OSError:
            self._held = False
        return self._held

    def close(self) -> None:
        """Give the gamepad back."""
        os.close(self._file)


class SpaceBar:
    """The space bar of the terminal, as long as it repeats: pressed once it is not held yet.

    Raises:
        BusError: standard input is no terminal.
    """

    def __init__(self) -> None:
        import termios
        import tty

        if not sys.stdin.isatty():
            raise BusError("the space bar as dead man's switch needs a terminal as standard input")
        self._file = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._file)
        tty.setcbreak(self._file)
        os.set_blocking(self._file, False)
        self._last = -1e9
        self._repeats = False

    def held(self) -> bool:
        """Check whether it has repeated itself a moment ago."""
        now = time.monotonic()
        recent = now - self._last < _KEY_TIME
        pressed = 0
        with suppress(BlockingIOError):
            pressed = os.read(self._file, 256).count(b" ")
        self._repeats = (self._repeats and recent) or pressed + recent > 1
        if pressed:
            self._last = now
        return self._repeats

    def close(self) -> None:
        """Give the terminal back as it was."""
        import termios

        os.set_blocking(self._file, True)
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)


def open_switch(settings: DeadMan) -> DeadMansSwitch:
    """Open the switch of a hardware's file. Raises ``BusError``."""
    if settings.kind == "gamepad":
        return GamepadButton(settings.device, settings.button)
    return SpaceBar() if settings.kind == "key" else AlwaysHeld()


def wait_until_held(switch: DeadMansSwitch, seconds: float) -> None:
    """Wait until the switch is held.

    Raises:
        BusError: nobody holds it in that time.
    """
    end = time.monotonic() + seconds
    while not switch.held():
        if time.monotonic() > end:
            raise BusError(
                f"nobody held the dead man's switch within {seconds:g} s: nothing was enabled"
            )
        time.sleep(0.01)
