"""The process beside the robot that writes the recording; see ``recorder`` for the other side.

It is told what to do by a ``Task`` on its command line and by the first record in the ring, the
header. On its standard input comes the outcome of the run. The end of the input says that nothing
more will come, also when the process that runs the graph was killed: then what is in the ring is
written, and the file is closed. On its standard output it says, in lines of JSON, that it is ready
and, at the end, a ``Report``.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.running.failures import describe
from ...runtime.running.memory import Snapshot
from ...runtime.running.notes import Note
from ..file.format import Header
from ..file.repair import RepairError, repair
from ..file.tail import TailWriter, record_type
from .live_feed import LiveFeed
from .ring import Record, RingReader
from .writer import RecordingWriter, warm_up

HEADER, ROW, KEYFRAME, NOTE = 1, 2, 3, 4
"""The kinds of records in the ring; a keyframe is the bytes of the bus, then of the state."""
POLL = 0.02
"""Seconds between two looks at the ring."""
LIVE_PERIOD = 0.1
"""Seconds after which a viewer is shown what has come."""
LAST_SYNC = 2.0
"""Seconds that the end waits for the disk."""
BATCH, BATCH_BYTES = 4096, 1 << 25
"""Ticks written at once, and their bytes, at most."""
BATCH_TIME = 10.0
"""Seconds between two batches, at most."""


@dataclass(frozen=True)
class Task:
    """What to write: the ring's ``descriptor`` and ``capacity``, the file, and how many seconds may
    pass before what has come is handed to the operating system (``flush_period``), and before that
    is told to put it on the disk (``sync_period``); an empty path stands for no file. ``live`` is
    where a viewer listens that shows the run while it goes on, if one does."""

    descriptor: int
    capacity: int
    path: str
    flush_period: float
    sync_period: float
    live: str = ""


@dataclass
class Report:
    """What was done: rows surely written, the file's size [bytes], the most memory used [bytes], and
    what went wrong, if anything; then ``lost`` rows may not be in the file. ``live_problem`` says
    why
    the viewer did not show all of the run."""

    rows: int = 0
    size: int = 0
    memory: int = 0
    problem: str = ""
    lost: int = 0
    live_problem: str = ""


class RecorderProcess:
    """Takes records out of the ring and writes them: ticks in batches, which keep the file and the
    memory small, and until a batch is full into the file's tail; notes at every flush."""

    def __init__(self, task: Task) -> None:
        self.report = Report()
        self._task = task
        self._ring = RingReader(task.descriptor, task.capacity)
        record = next(self._ring.records())
        header = Header.from_json(bytes(record.data).decode())
        self._bus_size = header.bus.size
        batch = max(1, min(BATCH, BATCH_BYTES // (self._bus_size + 8)))
        self._batch = np.zeros(batch, record_type(self._bus_size))
        self._ticks, self._rows = self._batch["tick"], self._batch["row"]
        self._filled = self._flushed_rows = 0
        self._notes: list[Note] = []
        self._last_tick = header.first_tick
        self._dirty = False
        self._syncing = threading.Thread()
        self._writer: RecordingWriter | None = None
        self._broken: RecordingWriter | None = None
        self._tail: TailWriter | None = None
        warm_up()
        if task.path:
            self._guard(lambda: self._open(header))
        self.feed = LiveFeed(task.live, header) if task.live else None
        self._fed_rows = 0
        self._flushed = self._synced = self._written = self._fed = time.monotonic()

    def _open(self, header: Header) -> None:
        self._tail = TailWriter(Path(self._task.path))
        self._writer = RecordingWriter(self._task.path, header)
        self._writer.flush()

    def take(self) -> None:
        """Take all records out of the ring, and flush if it is time."""
        for record in self._ring.records():
            self._take_one(record)
        now = time.monotonic()
        if now - self._fed >= LIVE_PERIOD:
            self._feed_rows()
            self._fed = now
        if now - self._flushed >= self._task.flush_period:
            self.flush()
            self._flushed = now
        if now - self._synced >= self._task.sync_period:
            self.sync()
            self._synced = now

    def _take_one(self, record: Record) -> None:
        if record.kind == ROW:
            self._rows[self._filled] = np.frombuffer(record.data, np.uint8)
            self._ticks[self._filled] = self._last_tick = record.tick
            self._filled += 1
            if self._filled == len(self._batch):
                self._write_batch()
        elif record.kind == KEYFRAME:
            bus, state = bytes(record.data[: self._bus_size]), bytes(record.data[self._bus_size :])
            self._write(lambda writer: writer.write_keyframe(Snapshot(record.tick, bus, state)))
        elif record.kind == NOTE:
            note = Note(**json.loads(bytes(record.data)))
            self._notes.append(note)
            if self.feed is not None:
                self.feed.note(note)

    def flush(self) -> None:
        """Hand everything that was taken from the ring to the operating system."""
        if time.monotonic() - self._written >= BATCH_TIME:
            self._write_batch()
        new = self._batch[self._flushed_rows : self._filled]
        if len(new) and self._writer is not None and self._tail is not None:
            tail = self._tail
            self._guard(lambda: tail.append(new))
        self._settle()
        self._write_notes()
        if self._dirty and self._writer is not None:
            self._guard(self._writer.flush)
        self._dirty = False

    def sync(self) -> None:
        """Have what was flushed put on the disk, which a thread waits for: a busy disk may take
        seconds, and the ring must be emptied meanwhile."""
        if self._writer is not None and not self._syncing.is_alive():
            self._syncing = threading.Thread(target=self._sync, daemon=True)
            self._syncing.start()

    def _sync(self) -> None:
        with suppress(OSError, ValueError):  # a disk that cannot take it fails the next flush too
            if self._tail is not None:
                self._tail.sync()
            descriptor = os.open(self._task.path, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

    def finish(self, outcome: dict[str, Any] | None) -> Report:
        """Write what is left and close the file."""
        self.take()
        self._write_batch()
        if outcome is None:
            text = "the process that ran the graph ended without a word"
            self._notes.append(Note(self._last_tick + 1, "fault", text, "ERROR"))
        self._write_notes()
        if outcome is not None:
            self._write(lambda writer: writer.write_outcome(outcome))
        if self._writer is not None:
            self._guard(self._writer.close)
            self.sync()
            if self._syncing.is_alive():
                self._syncing.join(LAST_SYNC)
        if self._tail is not None and (self._writer is not None or not self._tail.count):
            self._tail.remove()  # all is in the recording
        if self.feed is not None:
            self.feed.finish(outcome)
            self.report.live_problem = self.feed.problem
        if self._task.path and Path(self._task.path).is_file():
            self.report.size = Path(self._task.path).stat().st_size
        self.report.memory = _memory()
        return self.report

    def problems(self) -> list[str]:
        """The problems so far."""
        found = []
        if self.report.problem:
            found.append(f"nothing more is recorded: {self.report.problem}")
        if self.feed is not None and self.feed.problem:
            found.append(f"nothing more is shown live: {self.feed.problem}")
        return found

    def _feed_rows(self) -> None:
        """Show the rows that have come since the last time."""
        first, self._fed_rows = self._fed_rows, self._filled
        if self.feed is not None and self._filled > first:
            ticks, rows = self._ticks[first : self._filled], self._rows[first : self._filled]
            self.feed.rows(ticks.copy(), rows.copy())

    def _write_batch(self) -> None:
        """Write the ticks that wait for it, and wait until the operating system has them."""
        self._feed_rows()
        if self._filled and self._writer is not None:
            ticks = self._ticks[: self._filled].copy()
            rows = self._rows[: self._filled]
            self._write(lambda writer: writer.write_rows(ticks, rows))
        if self._writer is not None:
            self._guard(self._writer.flush)
        self._settle()
        if self._writer is not None and self._tail is not None:
            self._guard(self._tail.clear)
        self._filled = self._flushed_rows = self._fed_rows = 0
        self._written = time.monotonic()

    def _write_notes(self) -> None:
        notes, self._notes = self._notes, []
        if notes:
            self._write(lambda writer: writer.write_notes(notes))

    def _settle(self) -> None:
        """Count the rows that were handed over as written or, where that failed, as lost."""
        count = self._filled - self._flushed_rows
        if self._writer is None:
            self.report.lost += count if self._task.path else 0
        else:
            self.report.rows += count
        self._flushed_rows = self._filled

    def _rescue(self) -> None:
        """Write the ticks that the file did not take into the tail, as far as there is room."""
        if self._tail is not None:
            with suppress(OSError):
                self._tail.append(self._batch[self._tail.count : self._filled])
            self.report.rows += self._tail.count - self._flushed_rows
            self._flushed_rows = self._tail.count

    def _write(self, write: Callable[[RecordingWriter], None]) -> None:
        writer = self._writer
        if writer is not None:
            self._guard(lambda: write(writer))
            self._dirty = True

    def _guard(self, work: Callable[[], None]) -> None:
        """Call a function that writes. After a failure nothing is written any more, but the ring is emptied."""
        try:
            work()
        except Exception as error:  # noqa: BLE001  # whatever it is, the robot goes on
            self.report.problem = describe(error)
            # kept, as Rerun may wait for ever when a stream whose file failed is let go
            self._broken, self._writer = self._writer, None
            with suppress(OSError, RepairError):
                repair(self._task.path)  # so that what was written before can be read
            self._rescue()


def _memory() -> int:
    """The largest amount of memory that this process has used [bytes]."""
    try:
        import resource
    except ImportError:  # not on Windows
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def main(task: str) -> None:
    """Do what the task says, until standard input ends."""
    # Whoever stops the graph means the graph: this process ends with it, and not before.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    recorder = RecorderProcess(Task(**json.loads(task)))
    _say({"ready": True})
    told: set[str] = set()
    text, source = b"", sys.stdin.fileno()
    while True:
        if select.select([source], [], [], POLL)[0]:
            part = os.read(source, 65536)
            if not part:
                break
            text += part
        recorder.take()
        for problem in recorder.problems():
            if problem not in told:
                told.add(problem)  # now, as the run may go on for hours
                print(f"warning: {problem}", file=sys.stderr)
    _say(asdict(recorder.finish(json.loads(text) if text else None)))
    sys.stderr.flush()
    os._exit(0)  # a thread that a viewer or a full disk holds would keep this process from ending


def _say(data: dict[str, Any]) -> None:
    try:
        print(json.dumps(data), flush=True)
    except BrokenPipeError:  # nobody listens any more
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # until the end
