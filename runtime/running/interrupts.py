"""SIGINT and SIGTERM end a run cleanly: the present tick is finished, then the stop cycles run."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType
from typing import Any, Self

from ..language.block import Clock
from .failures import Hang
from .life_cycle import LifeCycle, LifeState

_SAID = b"\nstopping after this tick, the robot in damping; Ctrl-C again ends a block that hangs\n"


class Interrupts:
    """Handles the two signals in a ``with`` statement of the main thread; elsewhere does nothing.

    The first signal asks for the run to end after the present tick. A further signal raises
    ``KeyboardInterrupt``, so that a block that hangs can be interrupted, but only where that error
    is caught: while ``armed``, which the executor sets while blocks start and tick, or inside a
    guarded call while stopping. Raising resets ``armed``, so that no second error interrupts the
    code that handles the first. The watchdog raises ``Hang`` in the same way.
    """

    def __init__(self, clock: Clock, life: LifeCycle) -> None:
        self.received: signal.Signals | None = None
        self.armed = False
        self._clock = clock
        self._life = life
        self._hang = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def interrupt_hang(self, *, again: bool) -> None:
        """Raise ``Hang`` in the main thread, inside the call that is under way there.

        ``again`` says that the call has had one before, and is still under way.
        """
        if self._before:
            self._hang = True
            if again:  # the first has reset what lets an error through
                if self._life.state is LifeState.STOPPING:
                    self._life.guarding = True
                else:
                    self.armed = True
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._hang:
            self._hang = False
            if self.armed or self._life.guarding:
                self.armed = self._life.guarding = False
                raise Hang
        elif self.received is None:
            self.received = signal.Signals(number)
            if self._clock.stop_reason is None:
                self._clock.stop_reason = f"stopped by {self.received.name}"
            if self.received is signal.SIGINT:
                with suppress(OSError, ValueError):
                    os.write(2, _SAID)
        elif self.armed or self._life.guarding:
            self.armed = self._life.guarding = False
            raise KeyboardInterrupt
