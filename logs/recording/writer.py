"""Writes a recording piece by piece: rows, keyframes and notes as they come, the outcome at the end.

``format`` describes the file. Every ``flush`` hands what was written to the operating system, so a
process that is killed afterwards does not lose it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.memory import Snapshot
from ...runtime.running.notes import Note
from ..file.format import BUS, KEYFRAMES, NOTE, RECORDED, SPAN, STATE, Header, spans
from ..file.time_columns import time_columns
from ..viewing.blueprint import recording_blueprint
from .run_stream import RunStream

FLUSH_TIMEOUT = 30.0
"""Seconds a disk may take for what one flush hands over."""


class RecordingWriter:
    """Writes one file, replacing an older one.

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
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.open("wb").close()  # Rerun would only warn, so find out here
        self._stream = rr.RecordingStream(
            "aloft", recording_id=recording_id or header.name, send_properties=False
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        self._run = RunStream(self._stream, header, changes_only=True)
        self._stream.save(self.path, default_blueprint=recording_blueprint(header))
        self._write_start()

    def _write_start(self) -> None:
        import rerun as rr

        header = self.header
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
        self._stream.send_property("aloft", rr.AnyValues(**about))
        self._run.write_start()

    def write_rows(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Write the bus (n, bytes) after each of ``ticks`` (n,), which come in order."""
        import rerun as rr

        if not len(ticks):
            return
        self._run.write_rows(ticks, rows)
        found = spans(ticks)  # last, so that what they speak of is there
        columns = rr.DynamicArchetype.columns("aloft", components={SPAN: found.reshape(-1)})
        partitions = columns.partition(np.full(len(found), 2))
        self._stream.send_columns(RECORDED, time_columns(self.header, found[:, 0]), partitions)

    def write_keyframe(self, snapshot: Snapshot) -> None:
        """Write all that the graph remembered before ``snapshot.tick`` ran."""
        import rerun as rr

        columns = []
        for name, data in ((BUS, snapshot.bus), (STATE, snapshot.state)):
            flat = np.frombuffer(data, np.uint8)
            if len(flat):
                column = rr.DynamicArchetype.columns("aloft", components={name: flat})
                columns += list(column.partition([len(flat)]))
        self._stream.send_columns(
            KEYFRAMES, time_columns(self.header, np.array([snapshot.tick])), columns
        )

    def write_note(self, note: Note) -> None:
        """Write a note twice: as data, and as text for the viewer."""
        self._run.write_notes([note])

    def write_notes(self, notes: Sequence[Note]) -> None:
        """Write notes, in order, at once: a run that is late in each tick has many."""
        self._run.write_notes(notes)

    def write_outcome(self, outcome: dict[str, Any]) -> None:
        """Write the outcome of the run. It comes last."""
        import rerun as rr

        values = {"outcome": json.dumps(outcome), "run_hash": str(outcome.get("run_hash", ""))}
        self._run.write_times(outcome)
        self._stream.send_property("outcome", rr.AnyValues(**values))

    def flush(self) -> None:
        """Hand everything to the operating system. Raises ``OSError`` if it does not take it."""
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT)
        except RuntimeError as error:  # Rerun's writer has ended: the disk is full
            raise OSError(f"{self.path} cannot be written any further ({error})") from error

    def close(self) -> None:
        """Flush and close the file. Raises ``OSError`` as ``flush`` does."""
        self._run.write_rest()
        try:
            self.flush()
        finally:
            self._stream.disconnect()


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
        rr.LineStrips3D.columns(strips=[points, points]),
        rr.StateChange.columns(state=["a", "b"]),
        rr.TextLog.columns(text=["a", "b"], level=["INFO", "INFO"]),
        rr.DynamicArchetype.columns("aloft", components={NOTE: ["a", "b"]}),
    ):
        stream.send_columns("warm-up", times, columns)
    stream.disconnect()
