"""The process beside the robot that writes the recording; see ``recorder`` for the other side.

It imports what it needs, and waits on a socket for a ``RecorderTask`` and the descriptors of the ring
and of the file; the first record in the ring is the header. On its standard input comes the outcome of the run. The end of the input says that nothing
more will come, also when the process that runs the graph was killed: then what is in the ring is
written, and the file is closed and gets its name. On its standard output it writes a
``RecorderReport`` at the end, as a line of JSON.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...processes.child import report_ready
from ...runtime.running.failures import describe
from ...runtime.running.sink import Note
from ...runtime.running.snapshot import Snapshot
from ..file.format import Header
from ..file.held_fields import split_bus
from .output_file import OutputFile, cause_of, reserve_output, split_name
from .recorder_protocol import KEYFRAME, NOTE, PART, REWIND, ROW, RecorderReport, RecorderTask
from .rerun_import import import_rerun
from .ring import RingReader, RingRecord
from .writer import RecordingWriter

if TYPE_CHECKING:
    from .live_feed import LiveFeed

POLL = 0.02
"""Seconds between two looks at the ring."""
LIVE_PERIOD = 0.1
"""Seconds after which a viewer is shown what has come."""
LAST_SYNC = 2.0
"""Seconds that the end waits for the disk."""
BATCH, BATCH_BYTES = 512, 1 << 24
"""Ticks written at once, and their bytes, at most."""
SLOW_FLUSH = 4.0
"""Number of flush periods for which ticks may wait that are fewer than those of one period of the
graph."""
INDEXED_TICKS = 200_000
"""Ticks of a file, at most, that gets Rerun's index: it is made in memory, of every chunk."""
DRAW_PERIOD = 10.0
"""Seconds between two pieces of what the viewer shows: each costs the viewer time and memory."""


class RecorderProcess:
    """Takes records out of the ring and writes them: ticks and notes at every flush."""

    def __init__(self, task: RecorderTask, ring: int, file: int | None = None) -> None:
        self.report = RecorderReport()
        self._task = task
        self._ring = RingReader(ring, task.capacity)
        record = next(self._ring.records())
        header = Header.from_json(bytes(record.data).decode())
        self._bus_size = header.bus.size
        self._bus = split_bus(header)
        base = self._bus.base.layout
        batch = max(1, min(BATCH, BATCH_BYTES // max(1, base.size)))
        self._ticks = np.zeros(batch, np.int64)
        self._rows = np.zeros((batch, base.size), np.uint8)
        self._held: list[list[tuple[int, NDArray[np.uint8]]]] = [[] for _ in self._bus.held]
        self._now: list[NDArray[np.uint8] | None] = [None for _ in self._bus.held]
        """The last row of each held group."""
        self._held_bytes, self._begins = 0, True
        self._filled = self._taken = 0
        self._notes: list[Note] = []
        self._changes: list[Note] = []
        """The changes of parameters so far, which each file of several has."""
        self._last_tick = header.first_tick - 1
        self._syncing = threading.Thread()
        self._sync_error: OSError | None = None
        self._header = header
        self._rows_before = self._size_before = 0
        self._files: list[str] = []
        self._writer: RecordingWriter | None = None
        self._failed: RecordingWriter | None = None
        self._output: OutputFile | None = None
        if file is not None:
            self._output = OutputFile(Path(task.path), file, task.keep)
            self._guard(lambda: self._open(header))
        self._shown = replace(header, bus=base)
        self.feed = _live_feed(task.live, self._shown) if task.live else None
        self._fed_rows = self._rewinds = 0
        self._flushed = self._synced = self._drawn = self._fed = time.monotonic()

    def _open(self, header: Header) -> None:
        assert self._output is not None
        self._begins = True
        self._writer = RecordingWriter(
            self._output.target, header, output=self._output, indexed=self._is_short()
        )

    def _is_short(self) -> bool:
        """Tell whether the file's index has room in memory until the file is closed."""
        ticks = self._task.split or self._header.ticks
        return ticks is not None and ticks <= INDEXED_TICKS

    def _go_back(self, tick: int) -> None:
        """Go on with ``tick``, which has been run before, in a new file and as a new run of the viewer."""
        self._write_batch()
        self._changes = [note for note in self._changes if note.tick < tick]
        self._split(tick, back=True)
        self._last_tick = tick - 1
        if self.feed is not None:
            self.feed.finish(None)
            self._rewinds += 1
            name = f"{self._header.name}, again from {tick / self._header.base_rate:.3f} s"
            self.feed = _live_feed(self._task.live, self._shown, f"{name} ({self._rewinds})")

    def _split(self, tick: int, *, back: bool = False) -> None:
        """Close the file, and go on in a new one with the tick ``tick``, or ``back`` with it."""
        writer, output = self._writer, self._output
        if writer is None or output is None:
            return
        following = split_name(Path(self._task.path), len(self._files) + 2)
        self._write_batch()
        self._write_notes()
        ticks = (self._last_tick + 1 if back else tick) - self._begun_at()
        outcome = _went_on(following, ticks, tick if back else None)
        self._write(lambda writer: writer.write_outcome(outcome))
        self._guard(self._close)
        if self.report.problem:
            return
        self._files.append(str(output.target))
        self._rows_before += writer.recorded
        self._size_before += output.target.stat().st_size
        self._writer = None
        self._header = replace(self._header, first_tick=tick, run_begin=self._begun_at())
        self._guard(lambda: self._open_following(following))
        self._notes = list(self._changes)

    def _begun_at(self) -> int:
        """Return the first tick of the run."""
        header = self._header
        return header.first_tick if header.run_begin is None else header.run_begin

    def _open_following(self, path: Path) -> None:
        self._output = reserve_output(path, self._task.keep)
        self._open(self._header)

    def take(self) -> None:
        """Take all records out of the ring, and flush if it is time."""
        for record in self._ring.records():
            self._take_one(record)
        now = time.monotonic()
        if now - self._fed >= LIVE_PERIOD:
            self._feed_rows()
            self._fed = now
        if self._flush_is_due(now - self._flushed):
            self.flush()
            self._flushed = now
        if now - self._synced >= self._task.sync_period:
            self.sync()
            self._synced = now

    def _flush_is_due(self, waited: float) -> bool:
        """Tell whether it is time: a simulation that is slower than real time may wait longer, as
        small batches are larger in the file."""
        period = self._task.flush_period
        full = self._filled >= period * self._header.base_rate
        return waited >= (period if full else SLOW_FLUSH * period)

    def _take_one(self, record: RingRecord) -> None:
        if record.kind in (ROW, PART):
            self._take_row(record)
            self._ticks[self._filled] = self._last_tick = record.tick
            self._filled += 1
            self._taken += 1
            if self._filled == len(self._ticks) or self._held_bytes >= BATCH_BYTES:
                self._write_batch()
        elif record.kind == KEYFRAME:
            bus, state = bytes(record.data[: self._bus_size]), bytes(record.data[self._bus_size :])
            if 0 < self._task.split <= record.tick - self._header.first_tick:
                self._split(record.tick)
            self._write(lambda writer: writer.write_keyframe(Snapshot(record.tick, bus, state)))
        elif record.kind == REWIND:
            self._go_back(record.tick)
        elif record.kind == NOTE:
            note = Note(**json.loads(bytes(record.data)))
            self._notes.append(note)
            if note.kind == "parameter":
                self._changes.append(note)
            if self.feed is not None:
                self.feed.note(note)

    def _take_row(self, record: RingRecord) -> None:
        """Keep the base of a row, and of each held group its row where it is due, or begins a file."""
        data = np.frombuffer(record.data, np.uint8)
        whole, base = record.kind == ROW, self._bus.base
        if not self._bus.held:
            self._rows[self._filled] = data
            return
        self._rows[self._filled] = base.take(data[None])[0] if whole else data[: base.layout.size]
        place = base.layout.size
        for number, part in enumerate(self._bus.held):
            if whole:
                self._now[number] = part.take(data[None])[0]
            elif part.is_due(record.tick):
                self._now[number] = data[place : place + part.layout.size].copy()
                place += part.layout.size
            row = self._now[number]
            if row is not None and (whole or self._begins or part.is_due(record.tick)):
                self._held[number].append((record.tick, row))
                self._held_bytes += row.nbytes
        self._begins = False

    def flush(self) -> None:
        """Hand everything that was taken from the ring to the operating system."""
        self._write_batch()
        self._write_notes()
        if time.monotonic() - self._drawn >= DRAW_PERIOD:
            self._write(lambda writer: writer.draw())
            self._drawn = time.monotonic()

    def sync(self) -> None:
        """Have what was flushed put on the disk, which a thread waits for: a busy disk may take
        seconds, and the ring must be emptied meanwhile."""
        if self._writer is not None and not self._syncing.is_alive():
            own = os.dup(self._writer.output.descriptor)  # which a split may close meanwhile
            self._syncing = threading.Thread(target=self._sync, args=(own,), daemon=True)
            self._syncing.start()

    def _sync(self, descriptor: int) -> None:
        try:
            os.fsync(descriptor)
        except OSError as error:  # of a disk that is full or lost, which some systems say only now
            self._sync_error = error
        finally:
            os.close(descriptor)

    def finish(self, outcome: dict[str, Any] | None) -> RecorderReport:
        """Write what is left, close the file and give it its name."""
        self.take()
        self._write_batch()
        if outcome is None:
            text = "the process that ran the graph ended without a word"
            self._notes.append(Note(self._last_tick + 1, "fault", text, "ERROR"))
        self._write_notes()
        if outcome is not None:
            self._write(lambda writer: writer.write_outcome(outcome))
        if self._writer is not None:
            self.sync()
            if self._syncing.is_alive():
                self._syncing.join(LAST_SYNC)
        if self._sync_error is not None and not self.report.problem:
            why = self._sync_error.strerror or self._sync_error
            self._note_problem(
                self._sync_error, f"{self._task.path} may not be on the disk ({why})"
            )
        self._count()
        self._guard(self._close)
        if self.feed is not None:
            self.feed.finish(outcome)
            self.report.live_problem = self.feed.problem
        self.report.size = self._size_before
        if self._output is not None and self._output.target.is_file():
            self.report.size += self._output.target.stat().st_size
            if self._files:
                self._files.append(str(self._output.target))
        self.report.files = tuple(self._files)
        self.report.memory = _memory()
        return self.report

    def _close(self) -> None:
        """Close the file; one that could not be written to its end gets its name as it is, unless
        no tick is in it: then what had that name before stays."""
        if self._writer is not None:
            odd = self._writer.close()
            self.report.odd = "; ".join(filter(None, (self.report.odd, odd)))
        elif self._output is not None:
            if self._failed is not None and self._failed.recorded:
                self._output.publish()
            else:
                self._output.discard()
                self._output = None

    def _count(self) -> None:
        """Count the ticks in the file, and those that are not."""
        writer = self._writer or self._failed
        self.report.rows = self._rows_before + (writer.recorded if writer is not None else 0)
        self.report.lost = self._taken - self.report.rows if self._task.path else 0

    def problems(self) -> list[str]:
        """Return the problems so far."""
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
        """Write the ticks that wait for it."""
        self._feed_rows()
        ticks, rows = self._ticks[: self._filled], self._rows[: self._filled]
        held = [
            (np.array([tick for tick, _ in kept], np.int64), np.array([row for _, row in kept]))
            for kept in self._held
        ]
        self._write(lambda writer: writer.write_groups(ticks, rows, held))
        self._filled = self._fed_rows = self._held_bytes = 0
        self._held = [[] for _ in self._bus.held]

    def _write_notes(self) -> None:
        notes, self._notes = self._notes, []
        self._write(lambda writer: writer.write_notes(notes))

    def _write(self, write: Callable[[RecordingWriter], None]) -> None:
        writer = self._writer
        if writer is not None:
            self._guard(lambda: write(writer))

    def _guard(self, work: Callable[[], None]) -> None:
        """Call a function that writes. After a failure nothing is written any more, but the ring is emptied."""
        try:
            work()
        except Exception as error:  # noqa: BLE001  # whatever it is, the robot goes on
            self._note_problem(error, str(error) if isinstance(error, OSError) else describe(error))
            self._failed, self._writer = self._writer or self._failed, None

    def _note_problem(self, error: Exception, text: str) -> None:
        self.report.problem = text
        self.report.error_number = cause_of(error)


def _live_feed(source: str, header: Header, name: str = "") -> LiveFeed:
    from .live_feed import LiveFeed  # imports what only a viewer of a part needs

    return LiveFeed(source, header, name)


def _went_on(path: Path, ticks: int, back_to: int | None) -> dict[str, Any]:
    """Return the outcome in a file of a run that goes on in the file ``path``, or goes back there;
    ``ticks`` were run so far."""
    back = "" if back_to is None else f"went back to tick {back_to} and "
    return {
        "success": False,
        "reason": f"the run {back}goes on in {path.name}",
        "exit_code": 0,
        "run_hash": "",
        "ticks": ticks,
        "metrics": {},
        "blocks": {},
        "goes_on_in": path.name,
        "back_to": back_to,
    }


def _memory() -> int:
    """Return the largest amount of memory that this process has used [bytes]."""
    try:
        import resource
    except ImportError:  # not on Windows
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


class _NotInstalled:
    """Finds for Python that packages of some names are not there."""

    def find_spec(self, name: str, *_: Any) -> None:
        """Raise ``ModuleNotFoundError`` for these packages; all else is for other finders."""
        if name in ("pandas", "dateutil"):
            raise ModuleNotFoundError(name)


def block_pandas_import() -> None:
    """Let imports of pandas fail in this process, and of what comes with it. Arrow would import them where they are
    installed, only to see that no value here comes from them, which takes longer than all else that this process
    does for a short run."""
    sys.meta_path.insert(0, _NotInstalled())


def main(tasks: str) -> None:
    """Do what the task from the socket ``tasks`` says, until standard input ends."""
    # Whoever stops the graph means the graph: this process ends with it, and not before.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    block_pandas_import()
    import_rerun()  # which takes longest, and is needed first when there is a task
    with socket.socket(fileno=int(tasks)) as source_of_tasks:
        task, descriptors, _, _ = socket.recv_fds(source_of_tasks, 1 << 16, 2)
    if not task:
        return  # there was no run
    recorder = RecorderProcess(RecorderTask(**json.loads(task)), *descriptors)
    report_ready()
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
