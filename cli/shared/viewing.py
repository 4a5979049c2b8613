"""Reads recordings, shows them, pages and the viewer, and says which command would show one."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING

import typer

from ...runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ...logs.file.reader import RecordedRun
    from ...logs.viewing.viewer import Viewer


MANY_TICKS = 20_000
"""Ticks that take some seconds to draw."""


def draw(recording: Path, layout: Path | None, path: Path) -> Path:
    """Write a file for the viewer: all of a run, with the user's layout if there is one.

    What is no recording of a run, such as the motion of a plan or a comparison that was kept, is
    shown as it is.
    """
    from ...logs.file.records import NoRunError
    from ...logs.recording.drawn_run import write_view
    from ...logs.viewing.own_layout import blueprint_with, layout_beside, read_layout
    from ...robots.surfaces import missing_meshes

    try:
        run = read(recording)
    except NoRunError as error:
        if layout is not None:
            raise AloftError(f"{error}; it has no signals for the layout {layout}") from error
        return recording
    if len(run.ticks) >= MANY_TICKS:
        typer.echo(f"drawing {len(run.ticks)} ticks ...", err=True)
    for missing in missing_meshes(run.header.robot) if run.header.robot is not None else ():
        typer.echo(f"warning: {missing}", err=True)
    chosen = layout or layout_beside(run.header)
    own = None
    if chosen is not None:
        own = blueprint_with(read_layout(chosen, run.header), run.header)
    try:
        return write_view(path, run, own, diagram_of(run))
    except OSError as error:
        raise AloftError(f"{path} cannot be written ({error.strerror or error})") from error


def diagram_of(run: RecordedRun) -> bytes:
    """Return the block diagram of the graph that ran, as PNG; empty where its code has gone since, or
    where the extension that draws is missing."""
    from ...logs.replay.opened_run import OpenedRun
    from ...runtime.language.extensions import is_provided, provided

    if not is_provided("diagram_png"):
        return b""
    try:
        graph = OpenedRun(run, Path(run.header.source).parent, look=True).graph
    except (AloftError, OSError):
        return b""
    picture = io.BytesIO()
    provided("diagram_png")(graph, picture)
    return picture.getvalue()


def show(file: Path, *, web: bool) -> None:
    """Show a file until the window is closed or Ctrl-C is pressed."""
    from ...logs.viewing.viewer import start_viewer

    keep_open(start_viewer("web" if web else "window", [file]))


def keep_open(viewer: Viewer) -> None:
    """Wait until the window is closed, or for Ctrl-C; then end the viewer."""
    from .output import stopped_by_signals

    try:
        if viewer.kind == "web":
            typer.echo(f"{viewer.page}\nthe page is there until you press Ctrl-C")
            open_page(viewer.page)
        with stopped_by_signals():
            viewer.wait()
    finally:
        viewer.stop()


def open_page(page: str) -> None:
    """Open a page in the user's browser."""
    import webbrowser

    if sys.stdout.isatty():
        webbrowser.open(page)


def how_to_view(recording: Path) -> str:
    """Return the shortest command that shows a recording."""
    program = Path(sys.argv[0])
    here = Path.cwd()
    name = program.relative_to(here) if program.is_relative_to(here) else program
    on_path = program.name != "aloft" or which("aloft") == str(program)
    return f"{'aloft' if on_path else name} view {recording}"


def read(file: Path, *, damaged: bool = False) -> RecordedRun:
    """Read the recording. Raises ``AloftError`` if it cannot be read."""
    from ...logs.file import reader
    from ...logs.recording.output_file import unfinished_name

    try:
        return reader.read(file, damaged=damaged)
    except FileNotFoundError:
        part = unfinished_name(file)
        also = f"; {part} is there: it is being written, or was cut off" if part.exists() else ""
        raise AloftError(f"{file} cannot be read: there is no such file{also}") from None
    except OSError as error:
        raise AloftError(f"{file} cannot be read: {error.strerror or error}") from None
