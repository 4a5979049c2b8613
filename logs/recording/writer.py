"""Writes a recording piece by piece: rows, keyframes and notes as they come, the outcome at the end.

``format`` describes the content, ``records`` the records in the file, and ``record_stream`` writes them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.sink import Note, parameter_note
from ...runtime.running.snapshot import Snapshot
from ..file.format import FORMAT, Header, spans, time_columns
from ..file.held_fields import split_bus
from ..file.records import Content, Record, packed_text
from ..file.row_codec import pack, pack_keyframe
from ..viewing.blueprint import recording_blueprint
from ..viewing.drawing import RECORDED
from .output_file import OutputFile, reserve_output
from .record_stream import RecordStream
from .run_stream import RunStream

if TYPE_CHECKING:
    from ...runtime.running.run_result import RunResult

DRAWN_TICKS, DRAWN_BYTES = 4096, 1 << 25
"""Ticks that are drawn at once and their bytes, at most: the viewer likes few large pieces."""
ROWS_AT_ONCE = 512
"""Ticks that are packed together, at most."""
PACKED_BYTES = 1 << 25
"""Bytes of the rows that are packed together, at most, but that one row may have more."""
LEAST_ROWS = 16
"""Ticks that are not packed in smaller pieces on a disk that is nearly full."""


class RecordingWriter:
    """Writes one file, replacing an older one when it is closed.

    Args:
        path: the file; its folder is made.
        header: what is known before the first tick.
        recording_id: by default the graph's name; recordings of one run hold the same data.
        output: the file reserved for it, if that was done before.
        indexed: whether the file gets Rerun's index at its end, which takes memory for each chunk until then.

    Attributes:
        recorded: the number of ticks in the file.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        header: Header,
        recording_id: str = "",
        output: OutputFile | None = None,
        *,
        indexed: bool = True,
    ) -> None:
        import rerun as rr

        self.output = output or reserve_output(Path(path))
        self.header = header
        self.path = self.output.target
        self.recorded = self._undrawn = 0
        self._stream = rr.RecordingStream(
            "aloft", recording_id=recording_id or header.name, send_properties=False
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        self._records = RecordStream(self._stream, self.output, index=indexed)
        self._bus = split_bus(header)
        size = self._bus.base.layout.size
        most = min(DRAWN_TICKS, max(1, DRAWN_BYTES // max(1, size)))
        self._drawn_ticks = np.empty(most, np.int64)
        self._drawn_rows = np.empty((most, size), np.uint8)
        self._before: NDArray[np.uint8] | None = None
        self._last = -2
        shown = replace(header, bus=self._bus.base.layout)  # what is held is too large to be drawn
        self._run = RunStream(self._stream, shown, detail=RECORDED)
        self._write_start()

    def _write_start(self) -> None:
        import rerun as rr

        header = self.header
        whole = {"format": FORMAT, "versions": dict(header.versions)}
        about = {
            "about": json.dumps(whole),
            "name": header.name,
            "graph": header.graph,
            "base_rate_hz": repr(header.base_rate),
            "overrides": json.dumps(dict(header.overrides)),
            "seeds": json.dumps(dict(header.seeds)),
            "versions": json.dumps(dict(header.versions)),
            "machine": json.dumps(dict(header.machine)),
            "schema_hashes": json.dumps(header.schema_hashes),
        }
        self._put_text(Content.START, replace(header, contents={}).to_json())
        self._put_text(Content.FILES, json.dumps(dict(header.contents)))
        self._stream.send_property("aloft", rr.AnyValues(**about))
        layout = recording_blueprint(header, main_only=RECORDED.main_only)
        rr.send_blueprint(layout, make_active=False, make_default=True, recording=self._stream)
        self._run.write_start()
        self._records.put_drawn()

    def _put_text(self, content: Content, text: str, times: Sequence[Any] = (), first: int = 0, last: int = -1) -> None:  # fmt: skip
        data, size = packed_text(text)
        self._records.put(Record(content, first=first, last=last, whole=size), data, times)

    def _times(self, tick: int) -> list[Any]:
        return time_columns(self.header, np.array([tick]))

    def write_rows(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Write the bus (n, bytes) after each of ``ticks`` (n,), which come in order.

        The rows are copied; curves and the robot in 3D are drawn of several thousand at once.
        """
        if not self._bus.held or not len(ticks):
            self.write_groups(ticks, rows, ())
            return
        before = self._before if int(ticks[0]) == self._last + 1 else None
        kept = self._bus.changed(ticks, rows, before)
        self._before, self._last = rows[-1].copy(), int(ticks[-1])
        held = [
            (ticks[places], part.take(rows[places]))
            for places, part in zip(kept, self._bus.held, strict=True)
        ]
        self.write_groups(ticks, self._bus.base.take(rows), held)

    def write_groups(
        self,
        ticks: NDArray[np.int64],
        rows: NDArray[np.uint8],
        held: Sequence[tuple[NDArray[np.int64], NDArray[np.uint8]]],
    ) -> None:
        """Write the base (n, bytes of the base) of the bus at ``ticks`` (n,), and of each held group the ticks at
        which it is kept with its rows; see ``file.held_fields``."""
        for number, (at, some) in enumerate(held):
            self._write_held(number, at, some)
        for first, last in spans(ticks) if len(ticks) else ():
            most = min(ROWS_AT_ONCE, max(1, PACKED_BYTES // max(1, rows.shape[1])))
            for begin in range(int(first), int(last) + 1, most):
                end = min(begin + most, int(last) + 1)
                start = int(np.searchsorted(ticks, begin))
                self._write_packed(begin, rows[start : start + end - begin])
        while len(ticks):
            begin = self._undrawn
            self._undrawn = end = min(begin + len(ticks), len(self._drawn_ticks))
            self._drawn_ticks[begin:end], ticks = ticks[: end - begin], ticks[end - begin :]
            self._drawn_rows[begin:end], rows = rows[: end - begin], rows[end - begin :]
            if end == len(self._drawn_ticks):
                self.draw()

    def _write_held(self, number: int, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Write rows of a held group: one message for those that follow each other by its period."""
        if not len(ticks):
            return
        period = self._bus.held[number].period
        most = max(1, PACKED_BYTES // max(1, rows.shape[1]))
        start = 0
        while start < len(ticks):
            end = start + 1
            while end < min(len(ticks), start + most) and ticks[end] - ticks[end - 1] == period:
                end += 1
            first, last = int(ticks[start]), int(ticks[end - 1])
            held = Record(Content.HELD, group=number, first=first, last=last)
            self._records.put(held, pack(first, rows[start:end]), self._times(first))
            start = end

    def _write_packed(self, first: int, rows: NDArray[np.uint8]) -> None:
        """Write rows as one message; where there is no room for it, as many as there is room for.

        Raises:
            OSError: not all of them could be written.
        """
        try:
            self._write_whole(first, rows)
        except OSError:
            if len(rows) <= LEAST_ROWS:
                raise
            half = len(rows) // 2
            self._write_packed(first, rows[:half])
            self._write_packed(first + half, rows[half:])

    def _write_whole(self, first: int, rows: NDArray[np.uint8]) -> None:
        record = Record(Content.ROWS, first=first, last=first + len(rows) - 1)
        self._records.put(record, pack(first, rows), self._times(first))
        self.recorded += len(rows)

    def draw(self) -> None:
        """Write for the viewer what has come since this was called last."""
        if not self._undrawn:
            return
        count, self._undrawn = self._undrawn, 0
        self._run.write_rows(self._drawn_ticks[:count], self._drawn_rows[:count])
        self._records.put_drawn()

    def write_keyframe(self, snapshot: Snapshot) -> None:
        """Write all that the graph remembered before ``snapshot.tick`` ran."""
        data, size = pack_keyframe(snapshot.bus, snapshot.state)
        tick = snapshot.tick
        record = Record(Content.KEYFRAME, first=tick, last=tick, whole=size)
        self._records.put(record, data, self._times(tick))

    def write_notes(self, notes: Sequence[Note]) -> None:
        """Write notes, in order, as data and as text for the viewer; at once, as a run that is late in
        each tick has many."""
        if notes:
            self._run.write_notes(notes)
            first, last = notes[0].tick, notes[-1].tick
            text = json.dumps([asdict(note) for note in notes])
            self._put_text(Content.NOTES, text, self._times(first), first, last)

    def write_outcome(self, outcome: dict[str, Any]) -> None:
        """Write the outcome of the run. It comes last."""
        import rerun as rr

        self.draw()
        self._run.write_rest()
        self._run.write_times(outcome)
        names = [name for name in ("success", "reason", "run_hash") if outcome.get(name)]
        if names:
            shown = rr.AnyValues(**{name: str(outcome[name]) for name in names})
            self._stream.send_property("outcome", shown)
        self._put_text(Content.OUTCOME, json.dumps(outcome))

    def close(self) -> str:
        """Close the file and give it its name. Returns a warning if something was odd about it.

        Raises:
            OSError: the disk is full; what stood in the file before remains readable.
        """
        try:
            self.draw()
            self._run.write_rest()
            self._records.close()
        finally:
            warning = self.abandon()
        return warning

    def abandon(self) -> str:
        """Give the file its name as it is, after a failure. Returns a warning or nothing."""
        try:
            return self.output.publish()
        finally:
            self._records.abandon()
            self.output.close()


@dataclass(frozen=True)
class Recording:
    """A recording that was written: its path, its size and how long the writing took [s]."""

    path: Path
    size: int
    seconds: float


def write_recording(path: str | PathLike[str], result: RunResult) -> Recording:
    """Write a whole run, also one that failed, to ``path``, replacing what is there.

    It holds no keyframes; a ``Recorder`` writes those, while the run goes on.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
        RuntimeError: the run kept no log.
    """
    # a recorder's process, which has the header, starts without what makes one
    from ..file.code import code_of, remember
    from ..file.header import make_header

    began = time.perf_counter()
    log = result.log
    if result.graph is None or log is None or log.layout is None:
        raise RuntimeError("this run kept no log; run it with log=True")
    ticks, rows = np.array(log.ticks, np.int64), log.rows()
    start = rows[0].tobytes() if len(rows) else bytes(log.layout.size)
    first = log.ticks[0] if log.ticks else 0
    header = make_header(result.graph, log.layout, start, first_tick=first)
    if result.graph.resolved is not None:
        remember(code_of(result.graph.resolved, result.graph.robot))
    writer = RecordingWriter(path, header, result.run_hash)
    try:
        writer.write_rows(ticks, rows)
        changes = [parameter_note(change) for change in result.parameter_changes]
        writer.write_notes(sorted([*log.notes, *changes], key=lambda note: note.tick))
        writer.write_outcome(result.to_json())
    finally:
        writer.close()
    return Recording(writer.path, writer.path.stat().st_size, time.perf_counter() - began)
