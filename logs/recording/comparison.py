"""Writes two runs into one Rerun file, which shows them together in every view.

The file has everything that ``format`` describes, except rows, keyframes and properties: each run
below the name of its file, as the viewer shows these names. Both runs begin at the same time.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

from ..file.reader import RecordedRun
from ..viewing.blueprint import recording_blueprint
from ..viewing.plot_views import Shown
from ..viewing.scene_part import OTHER_RUN, Colors
from .run_stream import RunStream
from .whole_view import draw, opened_stream


def write_comparison(path: str | PathLike[str], first: RecordedRun, second: RecordedRun) -> Path:
    """Write both runs, replacing an older file. The layout is made from the first run's graph.

    Raises:
        RecordingError: a recording cannot be read.
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    path = Path(path)
    name, other = _labels(first, second)
    shown = tuple(
        Shown(f"{root}/", label)
        for root, label in zip(_roots(name, other), (name, other), strict=True)
    )
    layout = recording_blueprint(first.header, shown)
    with opened_stream(path, f"{name} and {other}", layout) as stream:
        for run, place, colors in zip((first, second), shown, (Colors(), OTHER_RUN), strict=True):
            out = RunStream(stream, run.header, root=place.root, colors=colors, label=place.label)
            draw(out, run)
    return path


def _labels(first: RecordedRun, second: RecordedRun) -> tuple[str, str]:
    """The names of the runs: those of their files, with the folders if these are equal."""
    one, two = first.path.stem, second.path.stem
    if one != two:
        return one, two
    one, two = (str(run.path.parent.name + "/" + run.path.stem) for run in (first, second))
    return (one, two) if one != two else ("first", "second")


def _roots(name: str, other: str) -> tuple[str, str]:
    """The labels as names of entities."""
    one, two = (re.sub(r"[^A-Za-z0-9_-]+", "_", label) for label in (name, other))
    return (one, two) if one != two else (f"first_{one}", f"second_{two}")
