"""The process that writes a recording, started before there is anything to write.

Its imports take about as long as loading a graph does, and go on beside that.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from .recorder_task import Task, send_task

_MAIN = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[2]); "
    "from aloft.logs.recording.recorder_process import main; main(int(sys.argv[1]))"
)


class WriterProcess:
    """A process that writes a recording as soon as it is told which.

    Attributes:
        process: the process, which ends by itself when its standard input does, or the connection
            without a task.

    Raises:
        OSError: it cannot be started.
    """

    def __init__(self) -> None:
        self._connection, other = socket.socketpair()
        folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
        with other:
            # not forked, as a copy of this process would hold its robot; and in a session of its
            # own, so that nobody's Ctrl-C ends it before the run has come to rest
            self.process = subprocess.Popen(
                [sys.executable, "-c", _MAIN, str(other.fileno()), folders],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=[other.fileno()],
                start_new_session=True,
            )

    @property
    def pipes(self) -> tuple[IO[bytes], IO[bytes]]:
        """Its standard input and output."""
        assert self.process.stdin is not None and self.process.stdout is not None
        return self.process.stdin, self.process.stdout

    def begin(self, task: Task, files: Sequence[int]) -> None:
        """Tell it what to write; see ``send_task``."""
        with self._connection:
            send_task(self._connection, task, files)

    def leave(self) -> None:
        """Let it end without a task."""
        self._connection.close()
        self.process.kill()
        for pipe in self.pipes:
            pipe.close()
        self.process.wait()


_ahead: list[WriterProcess] = []


@contextmanager
def recorder_ahead(*, wanted: bool = True) -> Iterator[None]:
    """Within the context the process of the first recorder has been started already."""
    if not wanted:
        yield
        return
    with suppress(OSError):  # then it fails again, and is told, when it is needed
        _ahead.append(WriterProcess())
    try:
        yield
    finally:
        while _ahead:
            _ahead.pop().leave()


def writer_process() -> WriterProcess:
    """The process that was started ahead, if it lives, or a new one. Raises ``OSError``."""
    while _ahead:
        found = _ahead.pop()
        if found.process.poll() is None:
            return found
        found.leave()
    return WriterProcess()
