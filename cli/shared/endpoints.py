"""Finds the sockets of running graphs."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ...runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ...runtime.live.parameter_endpoint import ParameterEndpoint

SUFFIX = ".sock"


def folder() -> Path:
    """The folder of the sockets, which only the user can read.

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
    """The socket of the run called ``name``. Raises ``AloftError`` for a name that is none."""
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,40}", name) or name.startswith("."):
        raise AloftError(f"{name!r} cannot name a run: use letters, digits, '.', '_' and '-'")
    return folder() / f"{name}{SUFFIX}"


def open_endpoint(name: str) -> ParameterEndpoint:
    """An endpoint for a run of that name. Raises ``AloftError``."""
    from ...runtime.live.parameter_endpoint import ParameterEndpoint

    return ParameterEndpoint(path_of(name))


def find(name: str) -> Path:
    """The socket of the run called ``name``, or of the only one there is.

    Raises:
        AloftError: there is none, or several and no name.
    """
    from ...runtime.live.parameter_endpoint import answers

    running = [path.name.removesuffix(SUFFIX) for path in sorted(folder().glob(f"*{SUFFIX}"))
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
