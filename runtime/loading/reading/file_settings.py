"""What a file of settings, such as a trial, sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..problems import LoadError, Problems
from .files import FileTree
from .nodes import plain


def settings_of(path: Path) -> dict[str, Any]:
    """Everything that a file and those it includes ``set``, as plain data.

    Raises:
        LoadError: one of the files cannot be read.
    """
    problems = Problems()
    files = FileTree(problems)
    written = files.read(path, str(path), subgraph=False)
    gathered = files.gather(written, ((path.resolve(), str(path)),)) if written else []
    if len(problems):
        raise LoadError(problems.report(str(path)))
    return {entry.key: plain(entry.value) for file in gathered for entry in file.sets}
