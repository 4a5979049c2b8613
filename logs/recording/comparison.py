"""Writes two runs into one Rerun file, which shows them together in every view.

The file has everything that ``format`` describes, except keyframes and properties: the first run
below ``first`` and the second one below ``second``. Both runs begin at the same time.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..file.reader import RecordedRun
from ..viewing.blueprint import recording_blueprint
from ..viewing.plot_views import Shown
from ..viewing.scene_part import OTHER_RUN, Colors
from .run_stream import RunStream


def write_comparison(path: str | PathLike[str], first: RecordedRun, second: RecordedRun) -> Path:
    """Write both runs, replacing an older file. The layout is made from the first run's graph.

    Raises:
        RecordingError: a recording cannot be read.
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    import rerun as rr

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.open("wb").close()  # Rerun would only warn, so find out here whether it can be written
    name, other = _labels(first, second)
    shown = (Shown("first/", name), Shown("second/", other))
    stream = rr.RecordingStream("aloft", recording_id=f"{name} and {other}", send_properties=False)
    rr.set_log_time_enabled(False, recording=stream)
    stream.save(path, default_blueprint=recording_blueprint(first.header, shown))
    try:
        for run, place, colors in zip((first, second), shown, (Colors(), OTHER_RUN), strict=True):
            out = RunStream(stream, run.header, root=place.root, colors=colors, label=place.label)
            out.write_start()
            out.write_rows(run.ticks, run.rows)
            for note in run.notes:
                out.write_note(note)
            if run.outcome is not None:
                out.write_times(dict(run.outcome))
    finally:
        stream.flush(timeout_sec=30)
        stream.disconnect()
    return path


def _labels(first: RecordedRun, second: RecordedRun) -> tuple[str, str]:
    """The names of the runs: those of their files, with the folders if these are equal."""
    one, two = first.path.stem, second.path.stem
    if one != two:
        return one, two
    one, two = (str(run.path.parent.name + "/" + run.path.stem) for run in (first, second))
    return (one, two) if one != two else ("first", "second")
