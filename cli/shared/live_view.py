"""Shows and records a run while it goes on: the options for it, the viewer, and the recorder's process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .output import print_warning

if TYPE_CHECKING:
    from ...logs.recording.recorder_link import RecorderLink
    from ...logs.viewing.viewer import Viewer


class Live(StrEnum):
    """The options of showing a run while it goes on."""

    NONE = "none"
    LIVE = "live"
    WEB = "web"


Rerun = Annotated[
    Live,
    typer.Option("--rerun", help="Show the run while it goes on: in a window, in a browser."),
]
Record = Annotated[
    Path | None,
    typer.Option("--record", help="Where the recording goes; by default recordings/NAME.rrd."),
]


@contextmanager
def recorder_started(*, wanted: bool) -> Iterator[RecorderLink | None]:
    """Start the recorder's process if one is wanted, while the graph is loaded."""
    if not wanted:
        yield None
        return
    from ...logs.recording.recorder_link import start_early

    link = start_early()
    try:
        yield link
    finally:
        if link is not None:
            link.close()


def open_viewer(live: Live, messages: list[str]) -> Viewer | None:
    """Open the viewer that shows the run. Without a viewer the run is not shown, and ``messages`` gets
    the reason."""
    if live is Live.NONE:
        return None
    from ...logs.viewing.viewer import ViewerError, start_viewer
    from .viewing import open_page

    try:
        viewer = start_viewer("web" if live is Live.WEB else "window")
    except ViewerError as error:
        messages.append(f"the run is not shown: {error}")
        print_warning(messages[-1])
        return None
    if live is Live.WEB:
        typer.echo(f"live view: {viewer.page}", err=True)
        open_page(viewer.page)
    return viewer


def leave_viewer(viewer: Viewer, *, wait: bool) -> None:
    """Leave the viewer open after the run: a window until it is closed, a page until Ctrl-C."""
    from .viewing import keep_open

    if viewer.kind != "web":
        return
    if wait and viewer.is_alive():
        keep_open(viewer)
    else:
        viewer.stop()
