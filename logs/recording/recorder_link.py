"""The process of a recorder, as the recorder sees it: started, told what to record, watched and ended."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from importlib.util import find_spec
from select import select
from typing import Any

from ...processes.child_process import ChildProcess
from .output_file import OutputFile
from .recorder_protocol import HEADER, RecorderReport, RecorderTask
from .ring import RingWriter, fitting_capacity, make_memory, space_of

START_TIME = 30.0
"""Seconds the process may take to be ready for a run in real time."""
ENDING = 10.0
"""Seconds from the process's report to its end."""


def rerun_is_installed() -> bool:
    """Tell whether the process will find Rerun."""
    return find_spec("rerun") is not None


def start_early() -> RecorderLink | None:
    """Start the process for a run that will be recorded; ``None`` where the recorder will say why
    not."""
    with suppress(OSError):
        return RecorderLink() if rerun_is_installed() else None
    return None


class RecorderLink:
    """A recorder's process, and the ring it reads.

    The process starts with this object and imports what it needs, Rerun above all, which takes it
    longer than a short run. What it is to record it is told by ``begin``. Whoever knows early that a
    run will be recorded makes the link early; if ``begin`` was not called, ``close`` ends the process.

    Raises:
        OSError: the process cannot be started.
    """

    def __init__(self) -> None:
        self._tasks, theirs = socket.socketpair()
        try:
            self._process = ChildProcess(
                "the recorder",
                f"{__package__}.recorder_process:main",
                [str(theirs.fileno())],
                descriptors=[theirs.fileno()],
                stdout=True,
                # What fails, a viewer or the disk, this process says in a line of its own; Rerun's log
                # would say it again several times, as raw lines. Who wants them sets RUST_LOG.
                environment={"RUST_LOG": os.environ.get("RUST_LOG", "off")},
                parent_death=None,  # it completes the file when its input ends
            )
        except BaseException:
            self._tasks.close()
            raise
        finally:
            theirs.close()
        assert self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        self._said = b""
        self._seen, self._since = (0, 0), time.monotonic()

    def begin(
        self, task: RecorderTask, output: OutputFile | None, header: str, least: int = 1 << 16
    ) -> None:
        """Tell the process what to record.

        Args:
            task: with the least capacity of the ring [bytes], and without descriptors.
            output: the file, locked, if there is to be a file. The process takes it over.
            header: of the recording, as text.
            least: the size with which the ring makes do where files may not be larger.

        Raises:
            OSError: there is no memory for the ring, or the process has ended.
        """
        text = header.encode()
        head = space_of(len(text))
        capacity = fitting_capacity(max(1 << 16, task.capacity + head), least + head)
        descriptor = -1
        try:
            descriptor = make_memory(capacity)
            self.ring = RingWriter(descriptor, capacity)
            self.ring.write(HEADER, 0, text)
            message = json.dumps(asdict(replace(task, capacity=capacity))).encode()
            handed = [descriptor, *([output.descriptor] if output is not None else [])]
            socket.send_fds(self._tasks, [message], handed)
        except BaseException:
            if output is not None:
                output.discard()
            raise
        finally:
            self._tasks.close()
            if descriptor >= 0:
                os.close(descriptor)
            if output is not None:
                output.close()  # the process holds the file and its lock

    def close(self) -> None:
        """End the process if it was not told what to record."""
        if self._tasks.fileno() >= 0:
            self._tasks.close()
            self._process.stop()

    @property
    def process_id(self) -> int:
        """The process's number."""
        return self._process.pid

    def is_alive(self) -> bool:
        """Tell whether the process is running."""
        return self._process.is_alive()

    def stalled_for(self) -> float:
        """Return the seconds since the process last made progress, or since ``reset_stall_timer``
        was called.

        It makes progress when it takes something out of the ring, and, where the system tells,
        when it reads or writes a file, as it does while it starts and while it ends.
        """
        seen = self.ring.read_back, self._bytes_moved()
        if seen != self._seen:
            self._seen, self._since = seen, time.monotonic()
        return time.monotonic() - self._since

    def _bytes_moved(self) -> int:
        """Return the bytes that the process has read and written so far; zero where nothing tells
        it."""
        try:
            with open(f"/proc/{self.process_id}/io", encoding="ascii") as file:
                return sum(int(line.split()[1]) for line in file if line[1:5] == "char")
        except (OSError, ValueError, IndexError):
            return 0

    def reset_stall_timer(self) -> None:
        """Restart the clock of ``stalled_for``, because the process had nothing to read until now."""
        self._since = time.monotonic()

    def wait_until_ready(self) -> None:
        """Wait until the process reads from the ring. Raises ``ChildError``."""
        self._process.wait_until_ready(START_TIME)

    def finish(
        self, outcome: dict[str, Any], goes_on: Callable[[], bool]
    ) -> tuple[RecorderReport | None, str]:
        """Tell the outcome and wait for the end, as long as ``goes_on`` says so.

        Returns:
            What the process says was done, if it came to that, and else why it did not.
        """
        with suppress(BrokenPipeError):  # it has ended, which is seen below
            self._input.write(json.dumps(outcome).encode())
            self._input.flush()
        with suppress(BrokenPipeError):
            self._input.close()
        self.reset_stall_timer()
        while self._listen(0.05):
            # In this order: the process may end just now, and then ``goes_on`` says no as well.
            if not goes_on() and self.is_alive():
                return None, f"the recorder has been stuck for {self.stalled_for():.0f} s"
        whole = self._said.endswith(b"\n")
        problem = "" if whole else str(self._process.failure())
        self._process.stop(asked=ENDING)
        self.ring.close()
        return (None, problem) if problem else (RecorderReport(**json.loads(self._said)), "")

    def _listen(self, seconds: float) -> bool:
        """Read the process's report within that time. Returns false when no more can come."""
        if not select([self._output], [], [], seconds)[0]:
            return True
        part = os.read(self._output.fileno(), 65536)
        self._said += part
        return bool(part)
