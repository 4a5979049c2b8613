"""Starts, watches and ends a process beside this one.

    with ChildProcess("the solver", "aloft.planner.solving.solver_process:serve", stdout=True) as child:
        child.wait_until_ready(10.0)
        child.stdin.write(...)

A child is a fresh interpreter, never a copy of this process: a copy would share its robot's ports, and
in a process with several threads it may find a lock that another thread held.

One socket joins both. Through it the child says that it is ready, and which exception ended it. Its
end tells the parent at once that the child has died. It tells the child that the parent has died,
whatever killed that: the kernel sends the child a signal, so it ends even where compiled code holds
the interpreter. (``PR_SET_PDEATHSIG`` fires too early, namely when the *thread* ends that started
the child.) A child that has work to do then, such as damping a robot or closing a file, turns that
off with ``parent_death=None`` and reads the end of its standard input instead.
"""

from __future__ import annotations

import fcntl
import gc
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from select import select
from time import monotonic
from typing import IO, Any, Self

KILL_TIME = 5.0
"""Seconds that a killed process has to disappear; one that the kernel holds is left to it."""
LAST_LINES = 5
"""Lines of a child's standard error that an error quotes."""
_PROGRAM = (
    "import gc, json, sys; gc.disable(); sys.path[:] = json.loads(sys.argv.pop(1)); "
    f"from {__name__} import main; main()"
)
_link = -1


class ChildError(RuntimeError):
    """Raised where a child does not start, or has died.

    Attributes:
        exit_code: its exit code, negative for a signal; ``None`` if it was still running.
        exception: the type's name of the exception that ended it; empty if none did.
    """

    def __init__(self, text: str, exit_code: int | None, exception: str = "") -> None:
        super().__init__(text)
        self.exit_code = exit_code
        self.exception = exception


class ChildProcess:
    """A process that was started here.

    Args:
        name: what errors call it.
        target: ``"package.module:function"``, which is called with ``arguments``; or the path of a
            program that imports nothing of the package. Such a program starts faster, and nothing
            that fails in the package can fail in it. Its first argument is the number of the
            socket's descriptor, to which it writes ``READY``.
        arguments: texts for it.
        descriptors: open files that it inherits under their numbers.
        stdout: whether its standard output is a pipe to here.
        shows_output: whether it prints where this process does; otherwise nothing is seen of it, but
            errors quote the end of its standard error.
        environment: variables that it gets beside those of this process.
        parent_death: the signal that ends it when this process has died; ``None`` if it sees to
            that itself.

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
        shows_output: bool = False,
        environment: Mapping[str, str] | None = None,
        parent_death: signal.Signals | None = signal.SIGKILL,
    ) -> None:
        self.name = name
        self._owner = os.getpid()
        self._said = b""
        self._errors = None if shows_output else _file_without_name()
        self._socket, theirs = socket.socketpair()
        if isinstance(target, Path):
            command = ["-I", "-S", str(target), str(theirs.fileno())]
        else:
            folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
            number = str(int(parent_death or 0))
            command = ["-c", _PROGRAM, folders, str(theirs.fileno()), number, target]
        output = None if shows_output else subprocess.DEVNULL
        try:
            self._process = subprocess.Popen(
                [sys.executable, *command, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE if stdout else output,
                stderr=self._errors,
                pass_fds=[theirs.fileno(), *descriptors],
                env={**os.environ, **(environment or {})},
                start_new_session=True,  # Ctrl-C in the terminal is for this process
            )
        except BaseException:
            self._close()
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

    @property
    def is_own(self) -> bool:
        """Whether it is a child of this process, which may be a copy of the one that started it."""
        return self._owner == os.getpid()

    def fileno(self) -> int:
        """The socket, for ``select``: it can be read when the child has died."""
        return self._socket.fileno()

    def is_alive(self) -> bool:
        """Whether it is running."""
        return self.is_own and self._process.poll() is None

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
                raise ChildError(f"{self.name} was not ready within {seconds:g} s", None)
            if not self._listen(left):
                raise self.failure()

    def failure(self) -> ChildError:
        """Why it has died: its exception or exit code, and the last lines of its standard error."""
        end = monotonic() + KILL_TIME
        while (left := end - monotonic()) > 0 and self._listen(left):
            pass
        code = self.wait(max(0.0, end - monotonic()))
        message: dict[str, Any] = {}
        for line in self._said.splitlines():
            if line.startswith(b"{"):
                message = json.loads(line)
        if message:
            how = f"failed with {message['type']}: {message['text']}"
        elif code is None:
            how = "does not answer"
        elif code < 0:
            how = f"was killed by {signal.Signals(-code).name}"
        else:
            how = f"ended with exit code {code}"
        lines = [] if message else self.last_lines()
        text = "; ".join([f"{self.name} {how}", *lines])
        return ChildError(text, code, message.get("type", ""))

    def last_lines(self) -> list[str]:
        """The end of what it wrote to its standard error, if that is kept."""
        if self._errors is None:
            return []
        size = self._errors.seek(0, os.SEEK_END)
        text = os.pread(self._errors.fileno(), 4096, max(0, size - 4096))
        return [line for line in text.decode(errors="replace").splitlines() if line][-LAST_LINES:]

    def stop(self, *, asked: float = 0.0, terminated: float = 0.0) -> int | None:
        """End it: close its standard input, then SIGTERM, then SIGKILL. Returns its exit code.

        Args:
            asked: seconds it has to end by itself, once its standard input has ended.
            terminated: seconds it has after SIGTERM; with zero it gets none.
        """
        if not self.is_own:
            self._close()
            return None
        with suppress(OSError):
            self.stdin.close()
        code = self.wait(asked)
        if code is None and terminated:
            self._process.terminate()
            code = self.wait(terminated)
        if code is None:
            self._process.kill()
            code = self.wait(KILL_TIME)
        self._close()
        return code

    def _close(self) -> None:
        self._socket.close()
        if self._errors is not None and not self._errors.closed:
            self._errors.close()
        if (process := getattr(self, "_process", None)) is not None:
            for pipe in filter(None, (process.stdin, process.stdout)):
                with suppress(OSError):
                    pipe.close()

    def _listen(self, seconds: float) -> bool:
        """Read what it says within that time. Returns false when it can say no more."""
        if not select([self._socket], [], [], seconds)[0]:
            return True
        try:
            part = self._socket.recv(65536)
        except OSError:
            part = b""
        self._said += part
        return bool(part)


def _file_without_name() -> IO[bytes]:
    import tempfile  # it takes long, and most of who imports this module starts no child

    return tempfile.TemporaryFile()


READY = b"ready\n"
"""What a child writes into the socket when it is ready."""


def report_ready() -> None:
    """In the child: tell the parent that it is ready."""
    with suppress(OSError):
        os.write(_link, READY)


def end_with(descriptor: int, number: int) -> None:
    """End this process with a signal when the other end of a pipe or socket, from which nothing ever
    comes, is closed."""
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
    """In the child: call the function, and tell the parent which exception ends it."""
    global _link
    _link, number, target = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    os.set_inheritable(_link, False)
    if number:
        end_with(_link, number)
    module, function = target.split(":")
    try:
        work = getattr(import_module(module), function)
        gc.freeze()  # what was imported stays, and is not looked through
        gc.enable()
        work(*sys.argv[4:])
    except Exception as error:
        message = {"type": type(error).__name__, "text": str(error)}
        with suppress(OSError):
            os.write(_link, b"\n" + json.dumps(message).encode() + b"\n")
        raise
