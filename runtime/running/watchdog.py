"""Ends a run from outside its ticks: where SIGINT or SIGTERM comes, and where a block hangs.

The signals end a run cleanly: the present tick is finished, then the stop cycles run. A block that
hangs is named, the run fails, and the stop cycles put the robot in damping.

The watchdog is a thread that looks at the run a few times in every limit of time. It counts its own
looks instead of reading a clock, so that a process that was suspended does not seem to hang. The
control loop does nothing for it: the call under way is read from the frame of the loop.

A block that hangs in Python, or in a call that signals interrupt, gets a ``Hang``. If that does not
help, the run is abandoned: the thread of the watchdog sends the stop cycles itself. Where compiled
code keeps the interpreter to itself, no thread can help; see ``freeze_guard``.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any, Self

from ..language.block import STOP_CYCLES, Block, Clock
from ..language.errors import RunError
from .failures import Hang, location_of_frames
from .life_cycle import LifeCycle, LifeState
from .pacing import Paced
from .sink import Sink
from .ticker import Ticker, hang_text, owner_of

_STOP_NOTICE = (
    b"\nstopping after this tick, the robot in damping; Ctrl-C again ends a block that hangs\n"
)


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

        ``again`` is true if the call has had one before, and is still under way.
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
                    os.write(2, _STOP_NOTICE)
        elif self.armed or self._life.guarding:
            self.armed = self._life.guarding = False
            raise KeyboardInterrupt


LOOKS = 8
"""Number of times that the watchdog looks at the run in every time limit."""
TRIES = 3
"""Number of interrupts of a call before the run is abandoned: a block may catch what it gets."""
_SLOW_MODULES = ("llvmlite.", "importlib.", "bdb", "pdb", "pydevd", "_pydevd_bundle")
"""Modules in which a call may stay for long: a compiler, an import, a debugger."""


class Watchdog:
    """Watches the thread that enters it, in a ``with`` statement, while a graph runs and stops.

    Args:
        ticker: what runs the ticks.
        life: the life cycle; before the state ``RUNNING`` nothing is watched.
        interrupts: what raises ``Hang`` in the main thread.
        limit: the longest time that one call of a block may take [s].
        abandon: called in the watchdog's thread with the block, the place and the stack of a call
            that cannot be interrupted.
    """

    def __init__(
        self,
        ticker: Ticker,
        life: LifeCycle,
        interrupts: Interrupts,
        limit: float,
        abandon: Callable[[str, str, str], None],
    ) -> None:
        self._ticker = ticker
        self._life = life
        self._interrupts = interrupts
        self._limit = limit
        self._abandon = abandon
        self._over = threading.Event()
        self._watched = 0
        self.hung: RunError | None = None
        """The first call that hung in a tick."""
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        self._watched = threading.get_ident()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        period = self._limit / LOOKS
        before: object = None
        looks = tries = 0
        while not self._over.wait(period):
            call = self._call()
            if call is None or call != before:
                before, looks, tries = call, 0, 0
                continue
            looks += 1
            allowed_looks = LOOKS if tries == 0 else 2
            if self._life.state is LifeState.STOPPING:
                allowed_looks = min(allowed_looks, max(2, LOOKS // STOP_CYCLES))
            if looks < allowed_looks:
                continue
            if tries == TRIES:
                self._give_up(call)
                return
            tries, looks = tries + 1, 0
            if tries == 1 and self._life.state is LifeState.RUNNING:
                self._note(call)
            self._interrupt(again=tries > 1)

    def _note(self, call: tuple[int, str]) -> None:
        """Mark the run to end, also where the call catches what interrupts it and returns."""
        clock = self._ticker.bound.clock
        who = f"block '{call[1]}'" if call[1] else "the runtime"
        text = hang_text(who, self._ticker.instant(clock.tick), self._limit)
        self.hung = RunError(text, block=call[1], tick=clock.tick)
        if clock.stop_reason is None:
            clock.stop_reason = text

    def _call(self) -> tuple[int, str] | None:
        """Return the identity of the call under way, and its block; ``None`` if there is none that
        could hang."""
        stopping = self._life.state is LifeState.STOPPING
        if not stopping and self._life.state is not LifeState.RUNNING:
            return None
        code = LifeCycle._guard.__code__ if stopping else Ticker.advance.__code__
        frame = sys._current_frames().get(self._watched)
        while frame is not None and frame.f_code is not code:
            if frame.f_trace is not None or _may_take_long(frame):
                return None
            frame = frame.f_back
        if frame is None:
            return None
        blocks = self._ticker.bound.blocks
        if stopping:
            path = str(frame.f_locals["path"])
            waits = path not in blocks or blocks[path].waits_for_others
            return None if waits else (-self._life.calls, path)
        owner = owner_of(frame.f_locals["call"])
        if isinstance(owner, Block | Sink) and owner.waits_for_others:
            return None  # it has a limit of its own
        tick = self._ticker.bound.clock.tick
        if isinstance(owner, Block):
            return tick, owner.context.path
        return None if owner is None or isinstance(owner, Paced) else (tick, "")

    def _interrupt(self, *, again: bool) -> None:
        """Raise ``Hang`` in the watched thread."""
        if self._watched == threading.main_thread().ident:
            self._interrupts.interrupt_hang(again=again)
        else:  # only Python code can be interrupted there
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(self._watched), ctypes.py_object(Hang)
            )

    def _give_up(self, call: tuple[int, str]) -> None:
        stack = traceback.extract_stack(sys._current_frames()[self._watched])
        place = location_of_frames(stack)
        self._abandon(call[1], place, "".join(traceback.format_list(stack)))


def _may_take_long(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__", "")).startswith(_SLOW_MODULES)
