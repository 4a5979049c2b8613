"""What a run depended on beside its graph: the files that parameters name, and the user's project."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...runtime.language.stages import CheckedGraph
from ...runtime.running.memory import BoundGraph

_SHIPPED = Path(str(files(__package__.partition(".logs")[0]) / "graphs"))
MOST_BYTES = 1 << 26
"""Files that are larger are not looked at."""


def parameter_files(graph: CheckedGraph) -> dict[str, str]:
    """The SHA-256 of every file that a parameter names, by ``block.parameter: name``.

    A file is looked for beside the graph, and then among the shipped graphs.
    """
    found = {}
    for spec in graph.blocks:
        for name, value in spec.params:
            path = _file(value, Path(spec.folder))
            if path is not None:
                found[f"{spec.path}.{name}: {value}"] = sha256(path.read_bytes()).hexdigest()
    return found


def files_read(bound: BoundGraph) -> dict[str, str]:
    """As ``parameter_files``, with the files that blocks have found themselves when they were set up,
    such as plans: those in a block's attribute ``files_read``."""
    found = parameter_files(bound.graph)
    for path, block in bound.blocks.items():
        for file in getattr(block, "files_read", ()):
            found[f"{path}: {file.name}"] = sha256(file.read_bytes()).hexdigest()
    return found


def other_files(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """What has become of the files ``then``, in words."""
    found = []
    for name, content in then.items():
        if name not in now:
            found.append(f"the file of {name} is not there, or is not used any more")
        elif now[name] != content:
            found.append(f"the file of {name} has other content")
    return found


def _file(value: Any, folder: Path) -> Path | None:
    if not isinstance(value, str | Path) or not str(value) or "\n" in str(value):
        return None
    try:
        for place in (folder, _SHIPPED):
            path = place / value
            if path.is_file() and path.stat().st_size <= MOST_BYTES:
                return path
    except (OSError, ValueError):  # a text that can be no name
        return None
    return None


def project_state(folder: Path) -> str:
    """The commit of the project that ``folder`` is in, and whether files differ from it; empty where
    it is no project under git."""
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return ""
    return f"{commit} with changes" if changed else commit


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder or "."), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=2.0, check=True)
    return done.stdout.strip()
