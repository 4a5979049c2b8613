"""Writes a recording bit by bit: rows, keyframes and notes as they come, the outcome at the end.

``format`` says what is in the file. Every ``flush`` hands all that was written to the operating
system: a process killed after it loses nothing of that.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.memory import Snapshot
from ..runtime.notes import Note
from .blueprint import recording_blueprint
from .format import (
    BUS,
    EVENTS,
    EXACT,
    KEYFRAMES,
    NOTE,
    NOTES,
    SIGNALS,
    STATE,
    STATES,
    Header,
    RecordedRows,
    entity_of,
)  # fmt: skip
from .robot_view import RobotWriter, port_with_pose
from .signal_names import element_names
from .time_columns import time_columns

FLUSH_TIMEOUT = 30.0
"""Seconds a disk may take for what one flush hands over."""


class RecordingWriter:
    """One file that is being written, replacing what was there.

    Args:
        path: the file; its folder is made.
        header: what is known before the first tick.
        recording_id: by default the graph's name; recordings of one run hold the same data.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """

    def __init__(self, path: str | PathLike[str], header: Header, recording_id: str = "") -> None:
        import rerun as rr

        self.path, self.header = Path(path), header
        self._layout = header.bus.layout()
        self._last_states: dict[str, int] = {}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.open("wb").close()  # Rerun would only warn, so find out here
        self._stream = rr.RecordingStream(
            "aloft", recording_id=recording_id or header.name, send_properties=False
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        port = port_with_pose(header)
        self._robot = RobotWriter(self._stream, header, port) if port is not None else None
        self._stream.save(self.path, default_blueprint=recording_blueprint(header, port))
        self._write_start()

    def _write_start(self) -> None:
        import rerun as rr

        header, stream = self.header, self._stream
        stream.log("graph", rr.TextDocument(header.graph, media_type="text/plain"), static=True)
        about = {
            "header": header.to_json(),
            "name": header.name,
            "graph": header.graph,
            "base_rate_hz": repr(header.base_rate),
            "overrides": json.dumps(dict(header.overrides)),
            "seeds": json.dumps(dict(header.seeds)),
            "versions": json.dumps(dict(header.versions)),
            "machine": json.dumps(dict(header.machine)),
            "schema_hashes": json.dumps(header.schema_hashes),
        }
        stream.send_property("aloft", rr.AnyValues(**about))
        for field in header.bus.fields:
            names = element_names(field, header.robot)
            if names and not field.constant:
                entity = entity_of(SIGNALS, field.name)
                stream.log(entity, rr.SeriesLines(names=names), static=True)
        if self._robot is not None:
            self._robot.write_static()

    def write_rows(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Write the bus (n, bytes) after each of ``ticks`` (n,), which come in order."""
        if not len(ticks):
            return
        batch = RecordedRows(self.header, ticks, rows, self._layout)
        self._write_signals(batch)
        self._write_states(batch)
        if self._robot is not None:
            self._robot.write(batch)

    def write_keyframe(self, snapshot: Snapshot) -> None:
        """Write all that the graph remembered before ``snapshot.tick`` ran."""
        import rerun as rr

        columns = []
        for name, data in ((BUS, snapshot.bus), (STATE, snapshot.state)):
            flat = np.frombuffer(data, np.uint8)
            if len(flat):
                column = rr.DynamicArchetype.columns("aloft", components={name: flat})
                columns += list(column.partition([len(flat)]))
        self._stream.send_columns(KEYFRAMES, self._times(np.array([snapshot.tick])), columns)

    def write_note(self, note: Note) -> None:
        """Write a note, for machines and for people."""
        import rerun as rr

        times = self._times(np.array([note.tick]))
        text = json.dumps(asdict(note))
        columns = rr.DynamicArchetype.columns("aloft", components={NOTE: [text]})
        self._stream.send_columns(NOTES, times, columns)
        self._write_events(times, [note.text], [note.level])

    def write_outcome(self, outcome: dict[str, Any]) -> None:
        """Write what came of the run, last of all."""
        import rerun as rr

        values = {"outcome": json.dumps(outcome), "run_hash": str(outcome.get("run_hash", ""))}
        self._stream.send_property("outcome", rr.AnyValues(**values))

    def flush(self) -> None:
        """Hand everything to the operating system. Raises ``OSError`` if it does not take it."""
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT)
        except RuntimeError as error:  # Rerun's writer has ended: the disk is full
            raise OSError(f"{self.path} cannot be written any further ({error})") from error

    def close(self) -> None:
        """Flush and close the file. Raises ``OSError`` as ``flush`` does."""
        try:
            self.flush()
        finally:
            self._stream.disconnect()

    def _times(self, ticks: NDArray[np.int64]) -> list[Any]:
        return time_columns(self.header, ticks)

    def _write_signals(self, batch: RecordedRows) -> None:
        import rerun as rr

        times = self._times(batch.ticks)
        for field in batch.fields():
            values = batch.signal(field.name)
            flat = np.ascontiguousarray(values.reshape(len(values), -1))
            columns = list(rr.Scalars.columns(scalars=flat.astype(np.float64, copy=False)))
            if field.dtype == "int64":
                exact = rr.DynamicArchetype.columns("aloft", components={EXACT: flat.reshape(-1)})
                columns += list(exact.partition(np.full(len(flat), flat.shape[1])))
            self._stream.send_columns(entity_of(SIGNALS, field.name), times, columns)

    def _write_states(self, batch: RecordedRows) -> None:
        """Write each change of a number whose values have names, and the same as text."""
        import rerun as rr

        for field in batch.fields():
            if not field.values or field.shape:
                continue
            numbers = batch.signal(field.name)
            last = self._last_states.get(field.name, int(numbers[0]) - 1)
            self._last_states[field.name] = int(numbers[-1])
            changes = np.flatnonzero(np.diff(numbers, prepend=last))
            if not len(changes):
                continue
            labels = [field.values.get(int(n), str(n)) for n in numbers[changes]]
            times = self._times(batch.ticks[changes])
            states = rr.StateChange.columns(state=labels)
            self._stream.send_columns(entity_of(STATES, field.name), times, states)
            texts = [f"{field.name}: {label}" for label in labels]
            self._write_events(times, texts, ["INFO"] * len(texts))

    def _write_events(self, times: Sequence[Any], texts: list[str], levels: list[str]) -> None:
        import rerun as rr

        columns = rr.TextLog.columns(text=texts, level=levels)
        self._stream.send_columns(EVENTS, times, columns)


def warm_up() -> None:
    """Have Rerun import what it imports when it is first used, which takes a third of a second."""
    import rerun as rr

    stream = rr.RecordingStream("warm-up", send_properties=False)
    times = [rr.TimeColumn("tick", sequence=np.arange(2))]
    points, turns = np.zeros((2, 3)), np.zeros((2, 3, 3))
    for columns in (
        rr.Scalars.columns(scalars=points),
        rr.Transform3D.columns(translation=points, mat3x3=turns),
        rr.Arrows3D.columns(origins=points, vectors=points),
        rr.Points3D.columns(positions=points),
        rr.StateChange.columns(state=["a", "b"]),
        rr.TextLog.columns(text=["a", "b"], level=["INFO", "INFO"]),
        rr.DynamicArchetype.columns("aloft", components={NOTE: ["a", "b"]}),
    ):
        stream.send_columns("warm-up", times, columns)
    stream.disconnect()
