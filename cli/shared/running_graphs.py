"""Finds graphs that run: by their sockets, by their machines, and those of ``aloft run --local``.

Each run with ``--local`` keeps a locked file in the user's folder of sockets for as long as it lives. The lock
goes with the process, however it ends, so a file that is not locked belongs to no run any more.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ...runtime.links.observer import Observer
    from ...runtime.live.parameter_endpoint import ParameterEndpoint


SOCKET_SUFFIX = ".sock"


def folder() -> Path:
    """Return the folder of the sockets, which only the user can read.

    Raises:
        AloftError: it cannot be made, or belongs to somebody else.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    user = os.getuid()
    path = Path(runtime) / "aloft" if runtime else Path(tempfile.gettempdir()) / f"aloft-{user}"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        owner = path.stat().st_uid
    except OSError as error:
        raise AloftError(f"{path} cannot be used: {error.strerror or error}") from error
    if owner != user:
        raise AloftError(f"{path} belongs to somebody else, so no graph can be reached there")
    return path


def path_of(name: str) -> Path:
    """Return the socket of the run called ``name``. Raises ``AloftError`` for a name that is none."""
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,40}", name) or name.startswith("."):
        raise AloftError(f"{name!r} cannot name a run: use letters, digits, '.', '_' and '-'")
    return folder() / f"{name}{SOCKET_SUFFIX}"


def open_endpoint(name: str, *, paused: bool = False) -> ParameterEndpoint:
    """Open an endpoint for a run called ``name``, which begins ``paused`` or not. Raises
    ``AloftError``."""
    from ...runtime.live.parameter_endpoint import ParameterEndpoint

    return ParameterEndpoint(path_of(name), paused=paused)


def find(name: str) -> Path:
    """Find the socket of the run called ``name``, or of the only one there is.

    Raises:
        AloftError: there is none, or several and no name.
    """
    from ...runtime.live.parameter_endpoint import answers

    running = [path.name.removesuffix(SOCKET_SUFFIX) for path in sorted(folder().glob(f"*{SOCKET_SUFFIX}"))
               if answers(path)]  # fmt: skip
    if name in running or (not name and len(running) == 1):
        return path_of(name or running[0])
    if not running:
        raise AloftError(
            "no graph is running whose parameters can be changed; `aloft run GRAPH --params NAME` "
            "starts one"
        )
    listed = ", ".join(running)
    if name:
        raise AloftError(f"no running graph is called {name!r}; there is {listed}")
    raise AloftError(f"several graphs are running: {listed}; say which one, --run {running[0]}")


LOCAL_SUFFIX = ".local"


@dataclass(frozen=True)
class LocalRun:
    """A run of ``aloft run --local``: its process, and the settings that its parts run with, which
    are those of the command line and the parts' endpoints."""

    process: int
    settings: tuple[str, ...]


@contextmanager
def registered(graph: Path, settings: Sequence[str]) -> Iterator[None]:
    """Make the run of ``graph`` with these settings one that can be found while the context lasts.

    Raises:
        AloftError: the user's folder cannot be used.
    """
    path = folder() / f"{os.getpid()}{LOCAL_SUFFIX}"
    about = {"graph": str(graph.resolve()), "settings": list(settings)}
    # whoever finds it locked also finds it whole: the lock comes first, the name last
    partial = path.with_suffix(".partial")
    try:
        with partial.open("w", encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            json.dump(about, file)
            file.flush()
            partial.replace(path)
            yield
    finally:
        path.unlink(missing_ok=True)


def local_runs(graph: Path) -> list[LocalRun]:
    """Find the runs of this graph file that live, by the number of their process.

    Raises:
        AloftError: the user's folder cannot be used.
    """
    found = []
    for path in sorted(folder().glob(f"*{LOCAL_SUFFIX}")):
        about = _read(path)
        if about is not None and about.get("graph") == str(graph.resolve()):
            found.append(LocalRun(int(path.stem), tuple(about["settings"])))
    return sorted(found, key=lambda run: run.process)


def settings_of(graph: Path, process: int = 0) -> tuple[str, ...]:
    """Return the settings of the run of this graph that lives here; empty where there is none.

    Args:
        graph: the file.
        process: the number of the process, where there are several; zero: the only one.

    Raises:
        AloftError: there are several and no number, or none has that number.
    """
    runs = local_runs(graph)
    chosen = [run for run in runs if process in (0, run.process)]
    if len(chosen) == 1:
        return chosen[0].settings
    listed = ", ".join(str(run.process) for run in runs)
    if len(chosen) > 1:
        raise AloftError(
            f"{graph} runs here {len(runs)} times with --local, as the processes {listed}; say which "
            f"one, --local {runs[0].process}"
        )
    if process:
        there = f"there is {listed}" if runs else "there is none"
        raise AloftError(f"no `aloft run {graph} --local` has the process {process}; {there}")
    return ()


def _read(path: Path) -> dict[str, Any] | None:
    """Read a run's description of itself; ``None``, and the file is gone, where no process holds
    it."""
    with suppress(OSError, ValueError), path.open(encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            about = json.load(file)
            return about if isinstance(about, dict) else None
        path.unlink(missing_ok=True)
    return None


Keys = Annotated[
    Path | None, typer.Option(help="The folder of `aloft keys`, or the observer's own, for TLS.")
]
Local = Annotated[
    int,
    typer.Option(
        min=0, help="The process ID of `aloft run --local`, if several run this graph here."
    ),
]
As = Annotated[
    str, typer.Option("--as", help="The observer's name, as given to `aloft keys --observer`.")
]


def observer_of(
    graph: Path, overrides: list[str], keys: Path | None, name: str, process: int = 0
) -> Observer:
    """Make an observer of a graph's machines, not yet connected.

    Where ``aloft run --local`` runs the graph here, its settings and endpoints count, and
    ``process`` says which run where there are several.

    Raises:
        AloftError: the graph is wrong, names no machines, or does not fit the keys; or it is not
            clear which run is meant.
    """
    from ...runtime.links.observer import Observer
    from ...runtime.loading import checked_file
    from ...runtime.placement.placed import split_over_machines

    placed = split_over_machines(checked_file(graph, [*settings_of(graph, process), *overrides]))
    return Observer(placed, keys, name)
