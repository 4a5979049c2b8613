"""Starts, watches and ends a process beside this one.

    with ChildProcess("the solver", "aloft.planner.solving.solver_process:serve", stdout=True) as
    child:
        child.wait_until_ready(10.0)
        child.stdin.write(...)

A child is a fresh interpreter, never a copy of this process: a copy would share its robot's ports, and
in a process with several threads it may find a lock that another thread held.

A socket joins the two. Through it the child reports that it is ready, and which exception ended it; and
its end tells the parent at once that the child has died. When the parent has died, whatever killed
it, the kernel sends the child a signal, which ends it even in the middle of compiled code.
(``PR_SET_PDEATHSIG`` fires too early: when the *thread* that started the child ends.) A child that
has a file to close first turns that off with ``parent_death=None`` and waits for the end of its
standard input instead.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from select import select
from time import monotonic
from typing import IO, Self

from .child import READY, main

KILL_TIME = 5.0
"""Seconds that a killed process has to disappear; one that the kernel holds is left to it."""
_PROGRAM = (
    "import gc, json, sys; gc.disable(); sys.path[:] = json.loads(sys.argv.pop(1)); "
    f"from {main.__module__} import main; main()"
)


class ChildError(RuntimeError):
    """Raised where a child does not start, or has died."""


class ChildProcess:
    """A process that this one has started. What it prints shows where this process prints, too.

    Args:
        name: what errors call it.
        target: ``"package.module:function"``, which is called with ``arguments``; or the path of a
            program that imports nothing of the package. Such a program starts faster, and nothing
            that fails in the package can fail in it. Its first argument is the number of the
            socket's descriptor, to which it writes ``READY``.
        arguments: texts for it.
        descriptors: open files that it inherits under their numbers.
        stdout: whether its standard output is a pipe to here.
        quiet: whether nothing is seen of what it prints.
        environment: variables that it gets beside those of this process.
        parent_death: the signal that ends a function when this process has died; ``None`` if the
            function sees to that itself, as a program always does.

    Attributes:
        stdin: the pipe to its standard input.
        stdout: the pipe from its standard output, if there is one.

    Raises:
        OSError: it cannot be started.
    """

    def __init__(
        self,
        name: str,
        target: str | Path,
        arguments: Sequence[str] = (),
        *,
        descriptors: Sequence[int] = (),
        stdout: bool = False,
        quiet: bool = False,
        environment: Mapping[str, str] | None = None,
        parent_death: signal.Signals | None = signal.SIGKILL,
    ) -> None:
        self.name = name
        self._owner = os.getpid()
        self._said = b""
        self._socket, theirs = socket.socketpair()
        if isinstance(target, Path):
            command = ["-I", "-S", str(target), str(theirs.fileno())]
        else:
            folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
            number = str(int(parent_death or 0))
            command = ["-c", _PROGRAM, folders, str(theirs.fileno()), number, target]
        shown = subprocess.DEVNULL if quiet else None
        try:
            self._process = subprocess.Popen(
                [sys.executable, *command, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE if stdout else shown,
                stderr=shown,
                pass_fds=[theirs.fileno(), *descriptors],
                env={**os.environ, **(environment or {})},
                start_new_session=True,  # Ctrl-C in the terminal is for this process
            )
        except BaseException:
            self._socket.close()
            raise
        finally:
            theirs.close()
        assert self._process.stdin is not None
        self.stdin: IO[bytes] = self._process.stdin
        self.stdout: IO[bytes] | None = self._process.stdout

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def is_alive(self) -> bool:
        """Return whether the process runs as a child of this very process, not of one that was
        forked."""
        return self._owner == os.getpid() and self._process.poll() is None

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        self._process.send_signal(number)

    def wait(self, seconds: float) -> int | None:
        """Wait until it has ended. Returns its exit code, or ``None`` if it is still running."""
        with suppress(subprocess.TimeoutExpired):
            return self._process.wait(seconds)
        return None

    def wait_until_ready(self, seconds: float) -> None:
        """Wait until it has called ``report_ready``.

        Raises:
            ChildError: it has died, or takes longer; it is for the caller to end it then.
        """
        end = monotonic() + seconds
        while READY not in self._said:
            left = end - monotonic()
            if left <= 0:
                raise ChildError(f"{self.name} was not ready within {seconds:g} s")
            if not self._listen(left):
                raise self.failure()

    def failure(self) -> ChildError:
        """Return the cause of its death: its exception, or its exit code."""
        end = monotonic() + KILL_TIME
        while (left := end - monotonic()) > 0 and self._listen(left):
            pass
        code = self.wait(max(0.0, end - monotonic()))
        for line in self._said.splitlines():
            if line.startswith(b"{"):
                message = json.loads(line)
                return ChildError(f"{self.name} failed with {message['type']}: {message['text']}")
        if code is None:
            return ChildError(f"{self.name} does not answer")
        if code < 0:
            return ChildError(f"{self.name} was killed by {signal.Signals(-code).name}")
        return ChildError(f"{self.name} ended with exit code {code}")

    def stop(self, *, asked: float = 0.0) -> int | None:
        """Close its standard input, and kill it if it has not ended by itself ``asked`` seconds later.

        Returns its exit code; ``None`` in a copy of the process that started it, and if the kernel
        holds it.
        """
        with suppress(OSError):
            self.stdin.close()
        code = None
        if self._owner == os.getpid():
            code = self.wait(asked)
            if code is None:
                self._process.kill()
                code = self.wait(KILL_TIME)
        self._socket.close()
        if self.stdout is not None:
            self.stdout.close()
        return code

    def _listen(self, seconds: float) -> bool:
        """Read its messages within that time; return false when no more can come."""
        if not select([self._socket], [], [], seconds)[0]:
            return True
        try:
            part = self._socket.recv(65536)
        except OSError:
            part = b""
        self._said += part
        return bool(part)


def processors() -> int:
    """Return the number of processors that this process may use, which is how many children can work at once."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
