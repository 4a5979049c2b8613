"""``aloft view``: shows a recording, or two recordings together."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.output import errors_reported
from .shared.viewing import draw, read, show


def view(
    recording: Annotated[Path, typer.Argument(help="The recording, a .rrd file.")],
    other: Annotated[
        Path | None,
        typer.Option("--with", help="A second recording, to compare with the first in one view."),
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="In a browser instead of a window.")] = False,
    save: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Also keep what is shown, as one .rrd file for any Rerun viewer."
        ),
    ] = None,
    layout: Annotated[
        Path | None,
        typer.Option(help="Your own tabs of plots; by default view.yaml beside the run's graph."),
    ] = None,
    no_show: Annotated[
        bool, typer.Option("--no-show", help="With --out: only write the file.")
    ] = False,
) -> None:
    """Look at a recording: the robot in 3D, its states and every signal."""
    with errors_reported(False):
        if layout is not None and other is not None:
            raise AloftError("--layout is for one recording; leave out --with")
        if no_show and save is None:
            raise AloftError("--no-show would do nothing; add --out FILE.rrd")
        for path in (recording, *((other,) if other else ())):
            if not path.is_file():
                raise AloftError(f"there is no recording {path}; `aloft run` writes one")
            if save is not None and save.exists() and save.samefile(path):
                raise AloftError(f"--out {save} would overwrite the recording; name another file")
        with tempfile.TemporaryDirectory() as folder:
            path = save or Path(folder) / f"{recording.stem}.rrd"
            if other is not None:
                compare(recording, other, path)
            else:
                path = draw(recording, layout, path)
                if save is not None and path == recording:
                    raise AloftError(f"{recording} is no recording of a run; it is all there is")
            if not no_show:
                show(path, web=web)
    raise typer.Exit(ExitCode.SUCCESS)


def compare(first: Path, second: Path, path: Path) -> None:
    """Write both runs into one file for the viewer."""
    from ..logs.recording.drawn_run import write_comparison

    runs = read(first), read(second)
    try:
        write_comparison(path, *runs)
    except OSError as error:
        raise AloftError(f"{path} cannot be written ({error.strerror or error})") from error
