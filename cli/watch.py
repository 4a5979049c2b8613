"""``aloft watch``: shows the signals of another machine in the viewer while it runs."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from ..runtime.language.errors import AloftError
from .shared.observing import As, Keys, Local, observer_of
from .shared.options import Overrides
from .shared.output import errors_reported


def watch(
    graph: Annotated[Path, typer.Argument(help="The graph file that the machines run.")],
    machine: Annotated[str, typer.Argument(help="The machine whose signals are shown.")],
    web: Annotated[bool, typer.Option("--web", help="In a browser.")] = False,
    keys: Keys = None,
    name: As = "viewer",
    local: Local = 0,
    overrides: Overrides = None,
) -> None:
    """Show a machine's signals live, 50 times a second, until Ctrl-C. Nothing is sent to it."""
    from ..logs.recording.live_feed import WatchedPart
    from ..logs.viewing.viewer import start_viewer

    with (
        errors_reported(False),
        observer_of(graph, overrides or [], keys, name, local) as observer,
    ):
        observer.placed.machine(machine)
        if observer.wait_for((machine,), 10.0):
            raise AloftError(f"nothing was heard of {machine!r} for 10 s: does it run?")
        if observer.state_of(machine) == "another graph":
            raise AloftError(f"{machine!r} runs another graph than {graph}")
        viewer = start_viewer("web" if web else "window")
        try:
            typer.echo(
                f"live view: {viewer.page}" if web else "live view: Ctrl-C ends it", err=True
            )
            shown = WatchedPart(observer, machine, viewer.source)
            with suppress(KeyboardInterrupt):
                while viewer.lives() and not shown.problem:
                    time.sleep(0.1)
            shown.close()
            if shown.problem:
                raise AloftError(shown.problem)
        finally:
            viewer.stop()
