"""Commands of jumps from the keyboard of a terminal."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import threading
from collections.abc import Mapping
from typing import Any

from ....runtime.language.block import Block, Metric, Output
from ....runtime.language.errors import BlockError
from ....runtime.language.parameters import Parameters, parameter
from ..signals import JumpCommand

KEYS: Mapping[str, tuple[int, int, int]] = {
    "\x1b[A": (1, 0, 0), "\x1b[B": (-1, 0, 0), "\x1b[D": (0, 1, 0), "\x1b[C": (0, -1, 0),
    "\x1bOA": (1, 0, 0), "\x1bOB": (-1, 0, 0), "\x1bOD": (0, 1, 0), "\x1bOC": (0, -1, 0),
    "a": (0, 0, 1), "d": (0, 0, -1), " ": (0, 0, 0),
}  # fmt: skip
"""The steps ahead, aside and in turn that a key commands."""
QUIT = "q"
LONGEST = 3
"""Characters of the longest of them."""
LOOK = 0.05
"""Period of the reader's check that the run goes on [s]."""
HELP = "arrows: ahead, back, aside; a, d: turn; space: on the spot; q: end"


def split_keys(text: str) -> tuple[list[str], str]:
    """Split typed text into its keys and a rest, which may be the beginning of another key. What is no key is left
    out."""
    found: list[str] = []
    while text:
        for length in range(min(LONGEST, len(text)), 0, -1):
            if text[:length] in KEYS or text[:length] == QUIT:
                found.append(text[:length])
                text = text[length:]
                break
        else:
            if len(text) < LONGEST and any(key.startswith(text) for key in KEYS):
                return found, text
            text = text[1:]
    return found, ""


class Keyboard(Block):
    """The command that was typed last, for ``SteeredPlan``.

    ============  =================================
    key           jump
    ============  =================================
    up, down      ``ahead`` or back
    left, right   ``aside``
    a, d          on the spot, with a ``turn`` to the left or right
    space         on the spot
    q             ends the run
    ============  =================================

    Keys that come before the next jump is requested add up: up and a are a jump ahead with a turn.
    The ``number`` grows with each key. A thread reads the terminal, so a tick only copies numbers. The
    terminal must be one: the block raises ``BlockError`` at the start where standard input is a file or a
    pipe. When the run ends the terminal is as it was. A replay takes the commands from the recording.
    """

    class Params(Parameters):
        ahead: float = parameter(0.15, unit="m", gt=0.0, le=0.5, text="of the keys up and down")
        aside: float = parameter(0.1, unit="m", gt=0.0, le=0.5, text="of the keys left and right")
        turn: float = parameter(0.35, unit="rad", gt=0.0, le=1.6, text="of the keys a and d")
        gather_time: float = parameter(
            0.5, unit="s", ge=0.0, text="keys that follow each other within this time add up"
        )

    outside = "real"
    params: Params
    command = Output(JumpCommand, text="the last command; number zero: none yet")

    def setup(self) -> None:
        self._number = 0
        self._jump = (0.0, 0.0, 0.0)
        self._last = -1e9
        self._typed: list[str] = []
        self._rest = ""
        self._ends = threading.Event()
        self._reader: threading.Thread | None = None
        self._terminal: Any = None
        self._stream = 0

    def start(self) -> None:
        """Switch the terminal to single keys, and begin to read."""
        if not sys.stdin.isatty():
            raise BlockError(
                "standard input is no terminal, so there are no keys to read; run it in a terminal, or give "
                "the commands as a file: aloft steer --commands FILE"
            )
        import termios
        import tty

        self._stream = sys.stdin.fileno()
        self._terminal = termios.tcgetattr(self._stream)
        tty.setcbreak(self._stream)
        sys.stderr.write(HELP + "\n")
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def step(self) -> None:
        """Take what was typed since the last tick."""
        while self._typed:
            self.press(self._typed.pop(0), self.time)
        command = self.command
        command.number[()] = self._number
        command.ahead[()], command.aside[()], command.turn[()] = self._jump

    def press(self, key: str, now: float) -> None:
        """Take a key at the time ``now`` [s]."""
        if key == QUIT:
            self.request_stop("q was pressed")
            return
        ahead, aside, turn = KEYS[key]
        p, before = self.params, self._jump
        if now - self._last > p.gather_time:
            before = (0.0, 0.0, 0.0)
        self._jump = (
            before[0] + ahead * p.ahead, before[1] + aside * p.aside, before[2] + turn * p.turn,
        )  # fmt: skip
        self._last = now
        self._number += 1

    def close(self) -> None:
        """Give the terminal back."""
        self._ends.set()
        if self._reader is not None:
            self._reader.join()
            self._reader = None
        if self._terminal is not None:
            import termios

            termios.tcsetattr(self._stream, termios.TCSADRAIN, self._terminal)
            self._terminal = None

    def metrics(self) -> Mapping[str, Metric]:
        """Return the number of keys."""
        return {"keys": self._number}

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while not self._ends.is_set():
                if not select.select([self._stream], [], [], LOOK)[0]:
                    continue
                text = os.read(self._stream, 64).decode(errors="ignore")
                keys, self._rest = split_keys(self._rest + text)
                self._typed += keys
