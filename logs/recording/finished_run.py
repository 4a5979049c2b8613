"""Writes a finished run, which is kept in memory, into one Rerun file; see ``format``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from ...runtime.running.run_result import RunResult
from ...runtime.running.sinks import parameter_note
from ..file.header import make_header
from .writer import RecordingWriter


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
    began = time.perf_counter()
    log = result.log
    if result.graph is None or log is None or log.layout is None:
        raise RuntimeError("this run kept no log; run it with log=True")
    ticks, rows = np.array(log.ticks, np.int64), log.rows()
    start = rows[0].tobytes() if len(rows) else bytes(log.layout.size)
    first = log.ticks[0] if log.ticks else 0
    header = make_header(result.graph, log.layout, start, first_tick=first)
    writer = RecordingWriter(path, header, result.run_hash)
    try:
        writer.write_rows(ticks, rows)
        changes = [parameter_note(change) for change in result.parameter_changes]
        writer.write_notes(sorted([*log.notes, *changes], key=lambda note: note.tick))
        writer.write_outcome(result.to_json())
    finally:
        writer.close()
    return Recording(writer.path, writer.path.stat().st_size, time.perf_counter() - began)
