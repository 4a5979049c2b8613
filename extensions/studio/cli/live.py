"""Serves the page of a graph that is running, for ``aloft graph --live`` and ``aloft params web``."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ....runtime.language.stages import CheckedGraph
    from ....runtime.placement.placed import PlacedGraph
    from ..diagram.page import Values
    from ..live.live_run import LiveRun
    from ..live.live_server import Opened, WatchedRun
    from ..live.spread_run import SpreadRun

TIMEOUT = 10.0
"""Seconds to wait for parts that run remote."""


@dataclass(frozen=True)
class RemoteRunAddress:
    """The address of the parts of a graph: its file, overrides, the folder of keys and the
    observer's name for TLS, and the process of ``aloft run --local``, zero for the only one."""

    graph: Path
    overrides: Sequence[str] = ()
    keys: Path | None = None
    observer: str = "viewer"
    process: int = 0


def open_live_run(name: str, remote: RemoteRunAddress | None = None) -> WatchedRun:
    """Open the running graph called ``name``, or the only one; all parts of a graph on several
    machines.

    Args:
        name: of the run; empty for the only one.
        remote: how to reach a graph that no process of this machine answers for.

    Raises:
        AloftError: no such graph runs.
    """
    from ....cli.shared.running_graphs import find
    from ..live.live_run import LiveRun

    try:
        path = find(name or (remote.graph.stem if remote is not None else ""))
    except AloftError:
        found = None if remote is None or name else _spread_elsewhere(remote)
        if found is None:
            raise
        return found
    run = LiveRun(path)
    return _whole(run, path, remote) if run.machine else run


def _whole(run: LiveRun, path: Path, remote: RemoteRunAddress | None) -> WatchedRun:
    """Return the whole of the graph of which ``run`` is the part that answers at ``path``."""
    from ....runtime.placement.placed import split_over_machines
    from ....runtime.transports.registry import transport_type
    from ..live.spread_run import SpreadRun

    placed = split_over_machines(run.graph)
    keys = remote.keys if remote is not None else None
    if keys is None and transport_type(placed.machines).needs_keys(placed):
        typer.echo(
            f"only the part on {run.machine} is shown: the links are encrypted, and the other parts "
            "need --keys FOLDER",
            err=True,
        )
        return run

    def again() -> PlacedGraph | None:
        try:
            run.refresh()
        except AloftError:
            return None
        return split_over_machines(run.graph)

    observer = remote.observer if remote is not None else "viewer"
    return SpreadRun(placed, keys, again, path, observer)


def _spread_elsewhere(remote: RemoteRunAddress) -> SpreadRun | None:
    """Find a graph whose parts answer over the network; ``None`` where it is for one process.

    Raises:
        AloftError: the graph is wrong, or none of its parts was heard.
    """
    from ....cli.shared.running_graphs import settings_of
    from ....runtime.loading import checked_file
    from ....runtime.placement.placed import split_over_machines
    from ..live.spread_run import SpreadRun

    def settings() -> tuple[str, ...]:
        return settings_of(remote.graph, remote.process)

    known = settings()
    graph = checked_file(remote.graph, [*known, *remote.overrides])
    if not graph.machines:
        return None
    placed = split_over_machines(graph)

    def again() -> PlacedGraph | None:
        nonlocal known
        try:
            if settings() == known:
                return None
            known = settings()
            return split_over_machines(checked_file(remote.graph, [*known, *remote.overrides]))
        except AloftError:
            return None

    run = SpreadRun(placed, remote.keys, again, _control(placed), remote.observer)
    # the parts of a run that is registered here are there, or come as soon as they have started
    if not known and not run.is_heard(TIMEOUT):
        run.close()
        names = ", ".join(spec.name for spec in placed.machines)
        raise AloftError(f"nothing was heard of {names} for {TIMEOUT:g} s: do they run?")
    return run


def _control(placed: PlacedGraph) -> Path | None:
    """Return the socket of a part on this machine that takes changes of parameters by its usual
    name."""
    from ....cli.shared.running_graphs import path_of
    from ....runtime.live.parameter_endpoint import answers

    for spec in placed.machines:
        with suppress(AloftError):  # not every name can be that of a socket
            path = path_of(f"{placed.graph.name}-{spec.name}")
            if answers(path):
                return path
    return None


def serve_live(run: WatchedRun, save: Path | None = None, opened: Opened = "diagram") -> None:
    """Serve the page until Ctrl-C is pressed."""
    from ....cli.shared.output import stopped_by_signals
    from ....cli.shared.viewing import open_page
    from ..live.live_server import LiveServer

    server = LiveServer(run, save or Path(f"{run.graph.name}-tuned.yaml"), opened)
    with server, stopped_by_signals():
        try:
            typer.echo(f"{server.page}\nthe page is there until you press Ctrl-C")
            open_page(server.page)
            server.serve_forever()
        finally:
            run.close()


def serve_running(
    graph: Path | None,
    running: str = "",
    overrides: Sequence[str] = (),
    keys: Path | None = None,
    name: str = "viewer",
    local: int = 0,
    *,
    save: Path | None = None,
    opened: Opened = "diagram",
) -> None:
    """Show a running graph in a browser until Ctrl-C is pressed.

    Raises:
        AloftError: it does not run.
    """
    if graph is not None and graph.suffix not in (".yaml", ".yml"):
        raise AloftError(f"--live is for a graph that is running; {graph} is none")
    remote = None if graph is None else RemoteRunAddress(graph, overrides, keys, name, local)
    serve_live(open_live_run(running, remote), save, opened)


def serve_diagram(graph: CheckedGraph, values: Values | None = None) -> None:
    """Show the diagram in a browser until Ctrl-C is pressed."""
    from ....cli.shared.viewing import open_page
    from ..diagram.page import ADDRESS, page_server

    server = page_server(graph, values=values)
    page = f"http://{ADDRESS}:{server.server_address[1]}/"
    typer.echo(f"{page}\nthe page is there until you press Ctrl-C")
    open_page(page)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        pass
    finally:
        server.server_close()
