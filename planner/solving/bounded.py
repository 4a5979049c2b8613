"""Bounds the time of a call that may loop forever inside a library, by running it in a copy of this process.

It is meant for processes with one thread; see ``solver_process`` for others.
"""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable
from typing import Any


def cpu_time() -> float:
    """Processor time [s] of this process, of those it has waited for, and what others counted."""
    if not hasattr(os, "fork"):
        return time.process_time()
    import resource

    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime + _elsewhere


_elsewhere = 0.0


def count(seconds: float) -> None:
    """Count processor time that another process has spent for this one."""
    global _elsewhere
    _elsewhere += seconds


def bounded(function: Callable[[], Any], limit: int) -> tuple[bool, Any]:
    """Whether ``function`` came to its end within ``limit`` seconds of processor time, and what it
    returned, which has to be picklable.

    It is called in a copy of this process, so it changes nothing here. Where processes cannot be
    copied it is called here, without a limit.

    Raises:
        RuntimeError: the function raised; the text is its error's.
    """
    if not hasattr(os, "fork"):
        return True, function()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _answer(function, limit, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        data = pipe.read()
    os.waitpid(child, 0)
    if not data:
        return False, None
    raised, value = pickle.loads(data)
    if raised:
        raise RuntimeError(value)
    return True, value


def _answer(function: Callable[[], Any], limit: int, writing: int) -> None:
    """In the copy: do it, write the answer, and end without anything else."""
    import resource

    # What this process has used so far does not count, and was not passed on.
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    try:
        data = pickle.dumps((False, function()))
    except BaseException as error:  # noqa: BLE001 - a copy of the process ends here
        data = pickle.dumps((True, f"{type(error).__name__}: {error}"))
    with os.fdopen(writing, "wb") as pipe:
        pipe.write(data)
    os._exit(0)
