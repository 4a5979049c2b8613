"""Reads the files of a graph, each once, finds its includes and reports rings of includes."""

from __future__ import annotations

import os
from pathlib import Path

from ..problems import Code, Problems, nearest
from .document import read_file
from .nodes import ScalarNode
from .written import WrittenGraph, read_graph

Stack = tuple[tuple[Path, str], ...]
"""The files being read, outermost first; for each its real path and the name shown in messages."""


class FileTree:
    """Reads graph files. ``incomplete`` is true if an included file could not be read."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.known: dict[tuple[Path, bool], WrittenGraph | None] = {}
        self.incomplete = False

    def read(self, path: Path, shown: str, *, subgraph: bool) -> WrittenGraph | None:
        """A file as a graph or a sub-graph; ``None`` after a problem."""
        key = (path, subgraph)
        if key not in self.known:
            tree = read_file(path, shown, self.problems)
            written = None
            if tree is not None:
                written = read_graph(tree, shown, path.parent, self.problems, subgraph=subgraph)
            self.known[key] = written
        return self.known[key]

    def locate(self, node: ScalarNode, file: WrittenGraph, stack: Stack) -> tuple[Path, str] | None:
        """The file that ``node`` names, seen from ``file``; ``None`` after a problem."""
        name = str(node.value)
        shown = os.path.normpath(Path(file.file).parent / name)
        try:
            path = (file.folder / name).resolve()
            present = path.is_file()
        except (OSError, ValueError):  # the name is one that no file can have
            path, present = Path(), False
        if not present:
            self._missing(node, path, shown)
            return None
        places = [place for place, _ in stack]
        if path in places:
            ring = [shown for _, shown in stack[places.index(path) :]]
            self.problems.add(
                Code.CYCLE,
                f"{shown} contains itself: {' -> '.join([*ring, shown])}",
                node.where,
                found=name,
                fix=f"remove {name} here",
            )
            return None
        return path, shown

    def _missing(self, node: ScalarNode, path: Path, shown: str) -> None:
        name = Path(str(node.value))
        try:
            present = sorted(other.name for other in path.parent.glob("*.y*ml"))
        except OSError:
            present = []
        similar = tuple((name.parent / n).as_posix() for n in nearest(name.name, present))
        self.problems.add(
            Code.FILE,
            f"there is no file {shown}",
            node.where,
            expected="a file, relative to the one that names it",
            found=str(name),
            nearest=similar,
            fix=similar[0] if similar else "",
        )

    def gather(
        self,
        file: WrittenGraph,
        stack: Stack,
        *,
        subgraph: bool = False,
        seen: dict[Path, None] | None = None,
    ) -> list[WrittenGraph]:
        """All files that a file includes, each once, then the file itself; later ones win."""
        found: list[WrittenGraph] = []
        seen = {} if seen is None else seen
        for node in file.include:
            located = self.locate(node, file, stack)
            if located is None:
                self.incomplete = True
                continue
            path, shown = located
            if path in seen:
                continue
            seen[path] = None
            included = self.read(path, shown, subgraph=False)
            if included is None:
                self.incomplete = True
                continue
            if subgraph:
                self._refuse_graph_keys(included)
            inner = (*stack, located)
            found.extend(self.gather(included, inner, subgraph=subgraph, seen=seen))
        return [*found, file]

    def _refuse_graph_keys(self, included: WrittenGraph) -> None:
        for entry in included.graph:
            self.problems.add(
                Code.MISPLACED_KEY,
                f"{entry.key!r} belongs to the graph that is run; this file is part of a sub-graph",
                entry.key_where,
                at=entry.key,
                fix=f"move {entry.key!r} to the graph that uses the sub-graph",
            )
