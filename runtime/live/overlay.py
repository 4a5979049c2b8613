"""Writes the values that were tuned into a graph file that includes the graph they are for."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..language.errors import AloftError
from ..language.stages import CheckedGraph
from ..loading import LoadError, load_text
from ..loading.reading.nodes import text_of

FIRST_LINE = "# Values that were tuned while the graph ran; `aloft run` takes this file."


def changed(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows of parameters that have another value than when the run began."""
    return [row for row in rows if row["value"] != row["start"]]


def write_overlay(path: Path, graph: CheckedGraph, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Write a graph file that includes ``graph`` and sets what has changed; it loads.

    A file of that name is replaced only if it was written here.

    Args:
        path: of the file.
        graph: the graph as it began to run.
        rows: its parameters; see ``Tunables.rows``.

    Returns:
        The parameters that are set.

    Raises:
        AloftError: nothing has changed, the graph came from no file, or the file cannot be written.
    """
    found = changed(rows)
    if not found:
        raise AloftError("no parameter has another value than when the run began")
    source = Path(graph.file)
    if not source.is_file():
        raise AloftError("the graph was not run from a file that is still there to be included")
    try:
        included = os.path.relpath(source.resolve(), path.resolve().parent)
        text = _text(included, found)
        load_text(text, path)
        if path.exists() and not path.read_text(encoding="utf-8").startswith(FIRST_LINE):
            raise AloftError(f"{path} is there already; give another name with --save FILE")
        path.write_text(text, encoding="utf-8")
    except LoadError as error:
        raise AloftError(f"the file would not load: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise AloftError(f"{path} cannot be written: {error}") from error
    return [str(row["path"]) for row in found]


def _text(included: str, rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [FIRST_LINE, f"include: [{text_of(included)}]", "set:"]
    for row in rows:
        unit = f" {row['unit']}" if row["unit"] else ""
        lines.append(
            f"  {row['path']}: {text_of(row['value'])}  # was {text_of(row['start'])}{unit}"
        )
    return "\n".join(lines) + "\n"
