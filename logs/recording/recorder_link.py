"""The side of the recorder that is in the graph's process: the ring, and two pipes to the writer."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from select import select
from typing import Any

from .place import Place
from .recorder_process import HEADER, Report, Task
from .ring import RingWriter, fitting_capacity, make_memory, space_of

_MAIN = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[2]); "
    "from aloft.logs.recording.recorder_process import main; main(sys.argv[1])"
)
START_TIME = 30.0
"""Seconds the process may take to be ready for a run in real time."""
STALL_TIME = 60.0
"""Seconds without any progress that are worth a warning, and more than a robot waits. A process
that is slow, as its disk is slow or the machine has too much to do, makes progress."""
GIVE_UP_TIME = 600.0
"""Seconds without any progress after which a simulation gives the process up, too."""


class RecorderLink:
    """A recorder's process that was started for one file, and the ring it reads.

    Args:
        place: the file's place, if there is to be a file. The process takes it over.
        header: of the recording, as text.
        capacity: least size of the ring [bytes].
        flush_period, sync_period, live, split: see ``Task``.
        least: the size with which the ring makes do where files may not be larger.

    Raises:
        OSError: the process cannot be started.
    """

    def __init__(
        self,
        place: Place | None,
        header: str,
        capacity: int,
        flush_period: float,
        sync_period: float,
        live: str = "",
        split: int = 0,
        least: int = 1 << 16,
    ) -> None:
        text = header.encode()
        head = space_of(len(text))
        capacity = fitting_capacity(max(1 << 16, capacity + head), least + head)
        descriptor = -1
        try:
            descriptor = make_memory(capacity)
            self.ring = RingWriter(descriptor, capacity)
            self.ring.write(HEADER, 0, text)
            path = str(place.target.absolute()) if place is not None else ""
            file, keep = (place.descriptor, place.keep) if place is not None else (-1, 0)
            task = Task(
                descriptor, capacity, path, file, keep, flush_period, sync_period, live, split
            )
            folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
            # not forked, as a copy of this process would hold its robot; and in a session of its
            # own, so that nobody's Ctrl-C ends it before the run has come to rest
            self._process = subprocess.Popen(
                [sys.executable, "-c", _MAIN, json.dumps(asdict(task)), folders],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=[descriptor, *([file] if file >= 0 else [])],
                # What fails, a viewer or the disk, this process says in a line of its own; Rerun's log
                # would say it again several times, as raw lines. Who wants them sets RUST_LOG.
                env={"RUST_LOG": "off", **os.environ},
                start_new_session=True,
            )
        except BaseException:
            if place is not None:
                place.discard()
            raise
        finally:
            if descriptor >= 0:
                os.close(descriptor)
            if place is not None:
                place.close()  # the process holds the file and its lock
        assert self._process.stdin is not None and self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        self._said = b""
        self._seen, self._since = (0, 0), time.monotonic()

    @property
    def process_id(self) -> int:
        """The process's number."""
        return self._process.pid

    def lives(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def stalled_for(self) -> float:
        """The seconds since the process last made progress, or since ``stirs`` was called.

        It makes progress when it takes something out of the ring, and, where the system tells,
        when it reads or writes a file, as it does while it starts and while it ends.
        """
        seen = self.ring.read_back, self._bytes_moved()
        if seen != self._seen:
            self._seen, self._since = seen, time.monotonic()
        return time.monotonic() - self._since

    def _bytes_moved(self) -> int:
        """The bytes that the process has read and written so far; zero where nothing tells it."""
        try:
            with open(f"/proc/{self.process_id}/io", encoding="ascii") as file:
                return sum(int(line.split()[1]) for line in file if line[1:5] == "char")
        except (OSError, ValueError, IndexError):
            return 0

    def stirs(self) -> None:
        """Restart the clock of ``stalled_for``, because the process had nothing to read until now."""
        self._since = time.monotonic()

    def wait_until_ready(self) -> bool:
        """Wait until the process reads from the ring. Returns whether it does."""
        end = time.monotonic() + START_TIME
        while b"\n" not in self._said and time.monotonic() < end:
            if not self._listen(0.1):
                return False
        return b"\n" in self._said

    def finish(
        self, outcome: dict[str, Any], goes_on: Callable[[], bool]
    ) -> tuple[Report | None, str]:
        """Tell the outcome and wait for the end, as long as ``goes_on`` says so.

        Returns:
            What the process says was done, if it came to that, and else why it did not.
        """
        with suppress(BrokenPipeError):  # it has ended, which is seen below
            self._input.write(json.dumps(outcome).encode())
            self._input.flush()
        with suppress(BrokenPipeError):
            self._input.close()
        self.stirs()
        while self._listen(0.05):
            # In this order: the process may end just now, and then ``goes_on`` says no as well.
            if not goes_on() and self.lives():
                return None, f"the recorder has been stuck for {self.stalled_for():.0f} s"
        self._output.close()
        code = self._process.wait()
        self.ring.close()
        lines = [json.loads(line) for line in self._said.splitlines()]
        if lines and "rows" in lines[-1]:
            return Report(**lines[-1]), ""
        how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        return None, f"the recorder {how}"

    def _listen(self, seconds: float) -> bool:
        """Read the process's messages within that time. Returns false when no more can come."""
        if not select([self._output], [], [], seconds)[0]:
            return True
        part = os.read(self._output.fileno(), 65536)
        self._said += part
        return bool(part)
