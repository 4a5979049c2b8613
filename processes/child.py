"""Main function of a ``ChildProcess``: it reports readiness and failure, and ends with its
parent."""

from __future__ import annotations

import fcntl
import gc
import os
import sys
import threading
from contextlib import suppress
from importlib import import_module
from select import select

from .quick_imports import make_when_called, without_plugins

READY = b"ready\n"
"""Bytes that a child writes into the socket when it is ready."""
_link = -1


def report_ready() -> None:
    """Tell the parent that this process is ready."""
    with suppress(OSError):
        os.write(_link, READY)


def end_with(descriptor: int, number: int) -> None:
    """Let a signal end this process when the other end of a pipe or socket is closed, from which
    nothing else ever comes."""
    if hasattr(fcntl, "F_SETSIG"):
        fcntl.fcntl(descriptor, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(descriptor, fcntl.F_SETSIG, number)
        flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_ASYNC)
        if select([descriptor], [], [], 0)[0]:  # it was closed before
            os.kill(os.getpid(), number)
    else:  # a system whose kernel sends no signal of choice

        def wait() -> None:
            select([descriptor], [], [])
            os.kill(os.getpid(), number)

        threading.Thread(target=wait, daemon=True).start()


def main() -> None:
    """Call the function that the command line names, and tell the parent which exception ends it."""
    global _link
    _link, number, target = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    os.set_inheritable(_link, False)
    if number:
        end_with(_link, number)
    module, function = target.split(":")
    without_plugins()
    make_when_called()
    try:
        work = getattr(import_module(module), function)
        gc.freeze()  # what was imported stays, and is not looked through
        gc.enable()
        work(*sys.argv[4:])
    except Exception as error:
        import json  # an import of 2 ms, which most who import this module do without

        message = {"type": type(error).__name__, "text": str(error)}
        with suppress(OSError):
            os.write(_link, b"\n" + json.dumps(message).encode() + b"\n")
        raise
