"""The diagram of a graph as SVG and PNG: what the core asks the extension for."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import BinaryIO

from ....files.problems import listing
from ....runtime.language.errors import AloftError
from ....runtime.language.stages import CheckedGraph
from . import render
from .diagram import diagram, subgraphs
from .layout import Drawing, draw


def svg(graph: CheckedGraph, closed: Collection[str] = ()) -> str:
    """Return the diagram as SVG, with the sub-graphs at the paths ``closed`` closed, or all of them.

    Raises:
        AloftError: there is no such sub-graph.
    """
    return render.svg(_drawing(graph, closed), graph.name)


def png(
    graph: CheckedGraph,
    target: Path | BinaryIO,
    closed: Collection[str] = (),
    *,
    dark: bool = False,
) -> None:
    """Write the diagram as PNG.

    Raises:
        AloftError: there is no such sub-graph.
        OSError: the file cannot be written.
    """
    render.save_png(_drawing(graph, closed), target, dark=dark)


def _drawing(graph: CheckedGraph, closed: Collection[str]) -> Drawing:
    known = subgraphs(graph)
    for path in closed:
        if path not in (*known, "all"):
            raise AloftError(f"there is no sub-graph {path!r}; there is {listing(known)}")
    return draw(diagram(graph, known if "all" in closed else closed))
