"""SIGINT and SIGTERM end a run cleanly: after the present tick, with the stop cycles."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

from .block import Clock
from .life_cycle import LifeCycle, LifeState


class Interrupts:
    """Handles the two signals within a ``with``; elsewhere than in the main thread does nothing.

    The first signal asks for the run to end after the tick. A second one raises
    ``KeyboardInterrupt``, for a block that hangs; while stopping only inside a guarded call.
    """

    def __init__(self, clock: Clock, life: LifeCycle) -> None:
        self.received: signal.Signals | None = None
        self._clock = clock
        self._life = life
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        stopping = self._life.state in (LifeState.STOPPING, LifeState.STOPPED)
        if self.received is None:
            self.received = signal.Signals(number)
            if self._clock.stop_reason is None:
                self._clock.stop_reason = f"stopped by {self.received.name}"
        elif not stopping or self._life.guarding:
            raise KeyboardInterrupt
