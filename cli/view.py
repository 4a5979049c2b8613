"""``aloft view``: shows a recording, or two recordings together."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .output import errors_reported

if TYPE_CHECKING:
    from ..logs.viewing.viewer import Viewer


def view(
    recording: Annotated[Path, typer.Argument(help="The recording, a .rrd file.")],
    other: Annotated[
        Path | None,
        typer.Option("--with", help="A second recording, to compare with the first in one view."),
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="In a browser instead of a window.")] = False,
    save: Annotated[
        Path | None,
        typer.Option(help="With --with: also keep what is shown, as one .rrd file."),
    ] = None,
    layout: Annotated[
        Path | None,
        typer.Option(help="Your own tabs of plots; by default view.yaml beside the run's graph."),
    ] = None,
    no_show: Annotated[
        bool, typer.Option("--no-show", help="With --save: only write the file.")
    ] = False,
) -> None:
    """Look at a recording: the robot in 3D, its states and every signal."""
    with errors_reported(False):
        if other is None and (save is not None or no_show):
            raise AloftError("--save and --no-show belong to a comparison; add --with OTHER.rrd")
        if layout is not None and other is not None:
            raise AloftError("--layout is for one recording; leave out --with")
        if no_show and save is None:
            raise AloftError("--no-show would do nothing; add --save FILE.rrd")
        for path in (recording, *((other,) if other else ())):
            if not path.is_file():
                raise AloftError(f"there is no recording {path}; `aloft run` writes one")
        with tempfile.TemporaryDirectory() as folder:
            shown = recording
            if other is not None:
                shown = compare(recording, other, save or Path(folder) / "comparison.rrd")
            if not no_show:
                own = None if other else own_layout(recording, layout, Path(folder))
                show(shown, web=web, layout=own)
    raise typer.Exit(ExitCode.SUCCESS)


def compare(first: Path, second: Path, path: Path) -> Path:
    """Write both runs into one file."""
    from ..logs.file.reader import read
    from ..logs.recording.comparison import write_comparison

    try:
        return write_comparison(path, read(first), read(second))
    except OSError as error:
        raise AloftError(f"{path} cannot be written ({error.strerror or error})") from error


def own_layout(recording: Path, layout: Path | None, folder: Path) -> Path | None:
    """The user's layout for a recording, as a file in ``folder`` for the viewer, if there is one."""
    from ..logs.file.reader import read
    from ..logs.viewing.layout_file import blueprint_with, layout_beside, read_layout

    header = read(recording).header
    chosen = layout or layout_beside(header)
    if chosen is None:
        return None
    path = folder / "layout.rbl"
    blueprint_with(read_layout(chosen, header), header).save("aloft", path)
    return path


def show(recording: Path, *, web: bool, layout: Path | None = None) -> None:
    """Show a file until the window is closed or Ctrl-C is pressed."""
    from ..logs.viewing.viewer import start_viewer

    viewer = start_viewer("web" if web else "window", [recording, *((layout,) if layout else ())])
    keep_open(viewer)


def keep_open(viewer: Viewer) -> None:
    """Wait until the window is closed, or for Ctrl-C; then end the viewer."""
    from .stopping import stopped_by_signals

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
    """The shortest command that shows a recording."""
    program = Path(sys.argv[0])
    here = Path.cwd()
    name = program.relative_to(here) if program.is_relative_to(here) else program
    return f"{name if program.name == 'aloft' else 'aloft'} view {recording}"
