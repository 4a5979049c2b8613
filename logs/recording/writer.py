"""Writes a recording piece by piece: rows, keyframes and notes as they come, the outcome at the end.

``format`` describes the content and ``messages`` the file. Rerun makes the messages in memory; they
are sealed and written here. Whatever was written is with the operating system when the call
returns, so a process that is killed afterwards does not lose it, and the file always ends with a
whole message.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.sink import Note, parameter_note
from ...runtime.running.snapshot import Snapshot
from ..file.format import BUS, HELD, KEYFRAMES, PACKED, ROWS, STATE, Header, spans, time_columns
from ..file.held_fields import split_bus
from ..file.index import Index
from ..file.messages import (
    ARROW,
    CLOSING,
    END,
    FILE_HEAD,
    HEAD,
    SEAL_SIZE,
    Content,
    FileMessage,
    closing,
    sealed,
    split,
)
from ..file.row_codec import pack
from ..viewing.blueprint import recording_blueprint
from ..viewing.drawing import RECORDED
from .output_file import OutputFile, reserve_output
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
    ) -> None:
        import rerun as rr

        self.output = output or reserve_output(Path(path))
        self.header = header
        self.path = self.output.target
        self._size = self._messages = self._drawable = 0
        self._begun = False
        self._index = Index(SEAL_SIZE)
        self.recorded = 0
        self._undrawn: list[tuple[NDArray[np.int64], NDArray[np.uint8]]] = []
        self._stream = rr.RecordingStream(
            "aloft", recording_id=recording_id or header.name, send_properties=False
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        self._made = self._stream.binary_stream()
        self._bus = split_bus(header)
        self._before: NDArray[np.uint8] | None = None
        self._last = -2
        shown = replace(header, bus=self._bus.base.layout)  # what is held is too large to be drawn
        self._run = RunStream(self._stream, shown, detail=RECORDED)
        self._write_start()

    def _write_start(self) -> None:
        import rerun as rr

        header = self.header
        about = {
            "header": replace(header, contents={}).to_json(),
            "name": header.name,
            "graph": header.graph,
            "base_rate_hz": repr(header.base_rate),
            "overrides": json.dumps(dict(header.overrides)),
            "seeds": json.dumps(dict(header.seeds)),
            "versions": json.dumps(dict(header.versions)),
            "machine": json.dumps(dict(header.machine)),
            "schema_hashes": json.dumps(header.schema_hashes),
        }
        self._stream.send_property("aloft", rr.AnyValues(**about))
        files = json.dumps(dict(header.contents))
        self._stream.send_property("files", rr.AnyValues(contents=files))
        self._put(Content.START)
        layout = recording_blueprint(header, main_only=RECORDED.main_only)
        rr.send_blueprint(layout, make_active=False, make_default=True, recording=self._stream)
        self._run.write_start()
        self._put(Content.PICTURE)

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
        if len(ticks):
            self._undrawn.append((ticks.copy(), rows.copy()))
            self._drawable += len(ticks)
            if self._drawable >= min(DRAWN_TICKS, DRAWN_BYTES // max(1, rows.shape[1])):
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
            self._send_packed(f"{HELD}/{number}", int(ticks[start]), rows[start:end])
            self._put(Content.HELD, int(ticks[start]), int(ticks[end - 1]))
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
        self._send_packed(ROWS, first, rows)
        self._put(Content.ROWS, first, first + len(rows) - 1)
        self.recorded += len(rows)

    def _send_packed(self, entity: str, first: int, rows: NDArray[np.uint8]) -> None:
        import rerun as rr

        packed = pack(first, rows)
        # as an Arrow array: Rerun would make a Python object of each byte of a NumPy array
        column = rr.DynamicArchetype.columns("aloft", components={PACKED: _bytes(packed)})
        times = time_columns(self.header, np.array([first]))
        self._stream.send_columns(entity, times, list(column.partition([len(packed)])))

    def draw(self) -> None:
        """Write for the viewer what has come since this was called last."""
        if not self._undrawn:
            return
        ticks, rows = (np.concatenate(parts) for parts in zip(*self._undrawn, strict=True))
        self._undrawn, self._drawable = [], 0
        self._run.write_rows(ticks, rows)
        self._put(Content.PICTURE, int(ticks[0]), int(ticks[-1]))

    def write_keyframe(self, snapshot: Snapshot) -> None:
        """Write all that the graph remembered before ``snapshot.tick`` ran."""
        import rerun as rr

        columns = []
        for name, data in ((BUS, snapshot.bus), (STATE, snapshot.state)):
            if data:
                column = rr.DynamicArchetype.columns("aloft", components={name: _bytes(data)})
                columns += list(column.partition([len(data)]))
        times = time_columns(self.header, np.array([snapshot.tick]))
        self._stream.send_columns(KEYFRAMES, times, columns)
        self._put(Content.KEYFRAME, snapshot.tick, snapshot.tick)

    def write_notes(self, notes: Sequence[Note]) -> None:
        """Write notes, in order, as data and as text for the viewer; at once, as a run that is late in
        each tick has many."""
        if notes:
            self._run.write_notes(notes)
            self._put(Content.NOTES, notes[0].tick, notes[-1].tick)

    def write_outcome(self, outcome: dict[str, Any]) -> None:
        """Write the outcome of the run. It comes last."""
        import rerun as rr

        self.draw()
        self._run.write_rest()
        self._run.write_times(outcome)
        self._put(Content.PICTURE)
        values = {"outcome": json.dumps(outcome), "run_hash": str(outcome.get("run_hash", ""))}
        self._stream.send_property("outcome", rr.AnyValues(**values))
        self._put(Content.OUTCOME)

    def _put(self, content: Content, first: int = 0, last: int = -1) -> None:
        """Seal and write what Rerun has made of what was sent. Raises ``OSError``."""
        data = self._made.read(flush=True) or b""
        out = bytearray()
        known, messages = 0, self._messages
        if data and not self._begun:
            out += data[:FILE_HEAD]
            known, self._begun = crc32(data[:FILE_HEAD]), True
        index, places = b"", {}
        for offset, head, body in split(data):
            kind = HEAD.unpack(head)[0]
            if kind == END:
                index = body
                break
            places[offset + HEAD.size] = self._size + len(out) + HEAD.size
            holds = content if kind == ARROW else Content.PICTURE
            seal = FileMessage(0, 0, ARROW, holds, messages, first, last)
            out += sealed(head, body, seal, known)
            known = 0
            messages += 1
        self._write(bytes(out))
        self._index.add(index, places)
        self._messages = messages

    def _write(self, data: bytes) -> None:
        """Write all of ``data`` at the file's end, or, if there is no room, nothing of it."""
        rest = memoryview(data)
        at = self._size
        try:
            while rest:
                count = os.pwrite(self.output.descriptor, rest, at)
                rest, at = rest[count:], at + count
        except OSError as error:
            os.ftruncate(self.output.descriptor, self._size)
            why = error.strerror or error
            raise OSError(f"{self.path} cannot be written any further ({why})") from error
        self._size = at

    def close(self) -> str:
        """Close the file and give it its name. Returns a warning if something was odd about it.

        Raises:
            OSError: the disk is full; what stood in the file before remains readable.
        """
        try:
            self.draw()
            self._run.write_rest()
            self._put(Content.PICTURE)
            self._write_closing()
        finally:
            warning = self.abandon()
        return warning

    def _write_closing(self) -> None:
        """Close the file, without an index where there is no room for it: only Rerun's tools use it."""
        try:
            self._write(closing(self._size, self._index.whole(), self._messages))
        except OSError:
            self._write(CLOSING)

    def abandon(self) -> str:
        """Give the file its name as it is, after a failure. Returns a warning or nothing."""
        try:
            return self.output.publish()
        finally:
            self._stream.disconnect()
            self.output.close()


def _bytes(data: bytes) -> Any:
    """Wrap bytes in an Arrow array that shares their memory."""
    import pyarrow as pa

    return pa.Array.from_buffers(pa.uint8(), len(data), [None, pa.py_buffer(data)])


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
