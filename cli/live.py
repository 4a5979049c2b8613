"""Serves the page of a graph that is running, for ``aloft graph --live`` and ``aloft params web``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from ..runtime.live.live_page import Opened
    from ..runtime.live.live_server import Watched


def open_live_run(name: str) -> Watched:
    """The running graph of that name, or the only one there is. Raises ``AloftError``."""
    from ..runtime.live.live_run import LiveRun
    from .endpoints import find

    return LiveRun(find(name))


def serve_live(run: Watched, save: Path | None = None, opened: Opened = "diagram") -> None:
    """Serve the page until Ctrl-C is pressed."""
    from ..runtime.live.live_server import LiveServer
    from .stopping import stopped_by_signals
    from .view import open_page

    server = LiveServer(run, save or Path(f"{run.graph.name}-tuned.yaml"), opened)
    with server, stopped_by_signals():
        typer.echo(f"{server.page}\nthe page is there until you press Ctrl-C")
        open_page(server.page)
        server.serve_forever()
