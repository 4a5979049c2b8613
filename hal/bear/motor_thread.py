"""The motor loop in a thread of its own, at the rate of the bus, beside the graph."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable

from ...blocks.signals import DrivePhase, JointCommand
from .motor_loop import MotorLoop

_SWITCHING = 2e-4
"""How soon Python lets another thread run [s]; its default is five periods of the bus."""


class MotorThread:
    """Makes a cycle every period, whatever the graph does.

    While the drives are on it damps them when the last command is older than ``command_age``, or
    when ``objection`` gives a reason.

    Args:
        loop: the motor loop.
        command_age: how old a command may be [s].
        objection: called before every cycle; a text that is not empty ends the driving.
    """

    def __init__(self, loop: MotorLoop, command_age: float, objection: Callable[[], str]) -> None:
        self._loop, self._command_age, self._objection = loop, command_age, objection
        self._stop = threading.Event()
        self._cycle = threading.Condition()
        self._done = 0
        self._commanded = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="aloft motors", daemon=True)
        self._switching = sys.getswitchinterval()

    @property
    def done(self) -> int:
        """The cycles so far."""
        return self._done

    def start(self) -> None:
        """Begin."""
        sys.setswitchinterval(_SWITCHING)
        self._commanded = time.monotonic()
        self._thread.start()

    def follow(self, command: JointCommand, heard: int = 0) -> None:
        """Follow this command from the next cycle on.

        ``heard`` says when what it was made from last came from another machine, by the monotonic
        clock [ns]; zero where it was made here.
        """
        self._commanded = heard * 1e-9 if heard else time.monotonic()
        self._loop.follow(command)

    def wait_for(self, cycle: int, seconds: float) -> bool:
        """Wait until so many cycles are done; says whether they are."""
        with self._cycle:
            return self._cycle.wait_for(lambda: self._done >= cycle, seconds)

    def stop(self) -> None:
        """End after the present cycle."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
        sys.setswitchinterval(self._switching)

    def _run(self) -> None:
        loop, period = self._loop, self._loop.hardware.bus.period
        following = time.monotonic()
        while not self._stop.is_set():
            if loop.phase in (DrivePhase.HOLDING, DrivePhase.DRIVING):
                self._look()
            loop.cycle()
            with self._cycle:
                self._done += 1
                self._cycle.notify_all()
            following += period
            rest = following - time.monotonic()
            if rest > 0.0:
                time.sleep(rest)
            else:
                loop.late_cycles += 1
                following -= rest

    def _look(self) -> None:
        age = time.monotonic() - self._commanded
        reason = self._objection()
        if reason:
            self._loop.fail(reason)
        elif age > self._command_age and self._loop.phase is DrivePhase.DRIVING:
            self._loop.fail(f"no new command has come for {1e3 * age:.0f} ms")
