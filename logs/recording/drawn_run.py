"""Draws recorded runs from their numbers: every signal, the scene at its full rate, all lanes.

A recording has only what is needed for a first look. ``aloft view`` shows a file that this writes:
one run, or two in every view. A file of two has everything that ``format`` describes, except rows,
keyframes and properties: each run below the name of its file, as the viewer shows these names. Both
runs begin at the same time.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Any

from ...runtime.language.importing import without_imports
from ..file.format import DIAGRAM
from ..file.reader import RecordedRun
from ..viewing.blueprint import recording_blueprint
from ..viewing.drawing import OTHER_RUN, Colors, opened_stream
from ..viewing.plot_views import ShownRun
from .run_stream import RunStream

DRAWN_TICKS = 4096
"""Ticks that are drawn at once: the viewer likes few large pieces."""


def write_view(
    path: str | PathLike[str], run: RecordedRun, layout: Any = None, diagram: bytes = b""
) -> Path:
    """Write all that can be seen of a run, replacing an older file.

    Args:
        path: the file.
        run: the recording; some thousand of its ticks are in memory at a time.
        layout: by default the one that is made from the run's graph.
        diagram: a PNG picture of the graph, which gets a tab of that layout.

    Raises:
        RecordingError: the recording cannot be read.
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    path = Path(path)
    shown = layout
    if layout is None:
        shown = recording_blueprint(run.header, diagram=bool(diagram))
    with opened_stream(path, run.header.name, shown) as stream:
        if diagram:
            write_picture(stream, diagram)
        draw(RunStream(stream, run.header), run)
    return path


def write_picture(stream: Any, diagram: bytes) -> None:
    """Put the picture of the graph into a stream."""
    import rerun as rr

    picture = rr.EncodedImage(contents=diagram, media_type="image/png")
    stream.log(DIAGRAM, picture, static=True)


def draw(out: RunStream, run: RecordedRun) -> None:
    """Draw a whole run into a stream."""
    with without_imports():  # a sensor of a user's own module is not drawn
        out.write_start()
        for batch in run.batches(DRAWN_TICKS):
            out.write_rows(batch.ticks, batch.rows)
        out.write_rest()
        out.write_notes(run.notes)
        if run.outcome is not None:
            out.write_times(dict(run.outcome))


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
        ShownRun(f"{root}/", label)
        for root, label in zip(_roots(name, other), (name, other), strict=True)
    )
    layout = recording_blueprint(first.header, shown)
    with opened_stream(path, f"{name} and {other}", layout) as stream:
        for run, place, colors in zip((first, second), shown, (Colors(), OTHER_RUN), strict=True):
            out = RunStream(stream, run.header, root=place.root, colors=colors, label=place.label)
            draw(out, run)
    return path


def _labels(first: RecordedRun, second: RecordedRun) -> tuple[str, str]:
    """Return the names of the runs: those of their files, with the folders if these are equal."""
    one, two = first.path.stem, second.path.stem
    if one != two:
        return one, two
    one, two = (str(run.path.parent.name + "/" + run.path.stem) for run in (first, second))
    return (one, two) if one != two else ("first", "second")


def _roots(name: str, other: str) -> tuple[str, str]:
    """Return the labels as names of entities."""
    one, two = (re.sub(r"[^A-Za-z0-9_-]+", "_", label) for label in (name, other))
    return (one, two) if one != two else (f"first_{one}", f"second_{two}")
