"""Requests of the control thread to the operating system: a processor, a priority, memory.

Everything is requested just before the first tick and given back after the last one, so that
threads that blocks and recorders have started before keep what they have.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from ..language.errors import AloftError

_LOCK_ALL = 3
"""``MCL_CURRENT | MCL_FUTURE``: memory that is there, and memory that is still to come."""
_ON_FAULT = 4
"""``MCL_ONFAULT``: only what is in use. Else all that the process has reserved becomes memory in use,
which libraries do by the gigabyte."""


class RealTimeError(AloftError):
    """The operating system refuses what a run asks of it."""


@dataclass(frozen=True)
class RealTimeOptions:
    """Requests of a run to the operating system.

    Attributes:
        cpu: the only processor that the control thread may use; none: any.
        priority: of the control thread in the class SCHED_FIFO, 1 to 99; none: an ordinary thread.
        lock_memory: whether no memory of the process may be moved out of the machine's.
    """

    cpu: int | None = None
    priority: int | None = None
    lock_memory: bool = False

    def check(self) -> None:
        """Request everything once and give it back, before anything moves.

        Raises:
            RealTimeError: something is refused; the text names it and the remedy.
        """
        with self._granted(_LOCK_ALL | _ON_FAULT):
            pass

    @contextmanager
    def granted(self) -> Iterator[None]:
        """Apply the options within.

        Raises:
            RealTimeError: as for ``check``.
        """
        with self._granted(_LOCK_ALL):
            yield

    @contextmanager
    def _granted(self, lock: int) -> Iterator[None]:
        with ExitStack() as after:
            if self.cpu is not None:
                allowed = os.sched_getaffinity(0)
                _pin(self.cpu)
                after.callback(os.sched_setaffinity, 0, allowed)
            if self.lock_memory:
                _lock_memory(lock)
                after.callback(_libc().munlockall)
            if self.priority is not None:
                before = os.sched_getscheduler(0), os.sched_getparam(0)
                _raise_priority(self.priority)
                after.callback(os.sched_setscheduler, 0, *before)
            yield


NO_REAL_TIME = RealTimeOptions()
"""A run that asks for nothing."""


def _pin(cpu: int) -> None:
    allowed = sorted(os.sched_getaffinity(0))
    if cpu not in allowed:
        there = ", ".join(map(str, allowed))
        raise RealTimeError(f"--cpu {cpu}: this process may use the processors {there}")
    os.sched_setaffinity(0, {cpu})


def _raise_priority(priority: int) -> None:
    lowest = os.sched_get_priority_min(os.SCHED_FIFO)
    highest = os.sched_get_priority_max(os.SCHED_FIFO)
    if not lowest <= priority <= highest:
        raise RealTimeError(f"--priority {priority}: expected {lowest} to {highest}")
    try:  # threads and processes that are started from here on stay ordinary ones
        flags = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, flags, os.sched_param(priority))
    except PermissionError as error:
        raise RealTimeError(
            f"--priority {priority}: the system does not allow it to this user; "
            "`aloft doctor` says how to change that"
        ) from error


def _lock_memory(how: int) -> None:
    if _libc().mlockall(how) != 0:
        reason = os.strerror(ctypes.get_errno())
        raise RealTimeError(
            f"--lock-memory: the system does not allow it ({reason}); `aloft doctor` says how to "
            "change that"
        )


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
