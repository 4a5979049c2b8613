"""Which graphs run here with ``aloft run --local``, and at which endpoints their parts listen.

Each such run keeps a locked file in the user's folder of sockets for as long as it lives. The lock
goes with the process, however it ends, so a file that is not locked belongs to no run any more.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...runtime.language.errors import AloftError
from .endpoints import folder

SUFFIX = ".local"


@dataclass(frozen=True)
class LocalRun:
    """A run of ``aloft run --local``: its process, and the settings that its parts run with, which
    are those of the command line and the parts' endpoints."""

    process: int
    settings: tuple[str, ...]


@contextmanager
def registered(graph: Path, settings: Sequence[str]) -> Iterator[None]:
    """While the context lasts, the run of ``graph`` with these settings can be found.

    Raises:
        AloftError: the user's folder cannot be used.
    """
    path = folder() / f"{os.getpid()}{SUFFIX}"
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
    """The runs of this graph file that live, by the number of their process.

    Raises:
        AloftError: the user's folder cannot be used.
    """
    found = []
    for path in sorted(folder().glob(f"*{SUFFIX}")):
        about = _read(path)
        if about is not None and about.get("graph") == str(graph.resolve()):
            found.append(LocalRun(int(path.stem), tuple(about["settings"])))
    return sorted(found, key=lambda run: run.process)


def settings_of(graph: Path, process: int = 0) -> tuple[str, ...]:
    """The settings of the run of this graph that lives here; empty where there is none.

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
    """What a run says of itself; ``None``, and the file is gone, where no process holds it."""
    with suppress(OSError, ValueError), path.open(encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            about = json.load(file)
            return about if isinstance(about, dict) else None
        path.unlink(missing_ok=True)
    return None
