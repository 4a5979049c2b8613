"""What somebody must hold while the drives are on: a gamepad's button or a key."""

from __future__ import annotations

import os
import struct
import sys
import time
from contextlib import suppress
from typing import Protocol

from .bus import BusError
from .configuration import DeadMan

_EVENT = struct.Struct("<IhBB")
"""Linux's joystick event: time, value, type, number."""
_BUTTON, _INITIAL = 0x01, 0x80
_KEY_TIME = 0.7
"""A held key repeats; without a repetition for so long it counts as let go [s]."""


class DeadMansSwitch(Protocol):
    """Something that is held or let go."""

    def held(self) -> bool:
        """Whether it is held now; it waits for nothing."""

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
        """Whether the button is down."""
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
    """The space bar of the terminal, as long as it repeats.

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

    def held(self) -> bool:
        """Whether it was pressed, or repeated itself, a moment ago."""
        with suppress(BlockingIOError):
            if b" " in os.read(self._file, 256):
                self._last = time.monotonic()
        return time.monotonic() - self._last < _KEY_TIME

    def close(self) -> None:
        """Give the terminal back as it was."""
        import termios

        os.set_blocking(self._file, True)
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)


def open_switch(settings: DeadMan) -> DeadMansSwitch:
    """The switch of a hardware's file. Raises ``BusError``."""
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
