"""Reads the files of a graph, each once, finds its includes and reports rings of includes.

A shipped file has an address in place of a path, which works from any folder: ``aloft:jump``,
``aloft:trials/robust``. A file that is no graph, such as a task or a study, is recognised, and the report names the
command that it is for.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ....files.document import read_file
from ....files.nodes import MapNode, ScalarNode, plain, texts_of
from ....files.problems import Code, LoadError, Position, Problems, listing, nearest
from ...language.extensions import extensions
from .graph_file import COMMON_KEYS, GRAPH_KEYS
from .written import WrittenGraph, read_graph

Stack = tuple[tuple[Path, str], ...]
"""The files being read, outermost first; for each its real path and the name shown in messages."""

PREFIX = "aloft:"
FOLDER = Path(__file__).parents[3] / "graphs"
"""The graphs of the core."""


ALIKE = 0.75
"""Similarity, from 0 to 1, above which a shipped graph may be meant by the name of a missing file."""


def graph_folders() -> dict[str, Path]:
    """Return the folders of shipped graphs by what their addresses begin with: ``aloft:`` for the core's,
    ``aloft:hopping/`` for those of an extension."""
    found = {PREFIX: FOLDER}
    for each in extensions():
        if (each.folder / "graphs").is_dir():
            found[f"{PREFIX}{each.name}/"] = each.folder / "graphs"
    return found


def shipped_graphs() -> dict[str, Path]:
    """Return the files of all shipped graphs by address, such as ``aloft:jump``, sorted."""
    by_address = {
        f"{prefix}{path.relative_to(folder).with_suffix('').as_posix()}": path
        for prefix, folder in graph_folders().items()
        for path in (*folder.glob("*.yaml"), *folder.glob("robots/*.yaml"))
    }
    return {address: by_address[address] for address in sorted(by_address)}


def graph_path(path: str | Path, folder: Path = Path()) -> Path:
    """Return the file that a path, seen from ``folder``, or an address stands for; an unknown address is no file."""
    text = str(path)
    if not text.startswith(PREFIX):
        return folder / path
    name = f"{text.removesuffix('.yaml')}.yaml"
    if ".." in Path(name.removeprefix(PREFIX)).parts:
        return Path(path)
    core = FOLDER / name.removeprefix(PREFIX)
    if core.is_file():
        return core
    for prefix, place in graph_folders().items():
        if name.startswith(prefix) and (file := place / name.removeprefix(prefix)).is_file():
            return file
    return Path(path)


def addresses_like(path: Path) -> tuple[str, ...]:
    """Return the addresses of shipped files that may be meant by a path where there is no file."""
    known = {
        f"{prefix}{file.relative_to(folder).with_suffix('').as_posix()}"
        for prefix, folder in graph_folders().items()
        for file in folder.rglob("*.yaml")
    }
    wanted = str(path.with_suffix("")).removeprefix(PREFIX).removeprefix("graphs/")
    if f"{PREFIX}{wanted}" in known:
        return (f"{PREFIX}{wanted}",)
    # Without the prefix, which all have, and only what differs by a letter or two: a file of one's own
    # that is missing is not a shipped one.
    names = sorted(each.removeprefix(PREFIX) for each in known)
    return tuple(f"{PREFIX}{each}" for each in nearest(wanted, names, cutoff=ALIKE))


def files_like(name: str, folder: Path) -> tuple[str, ...]:
    """Names of files that may be meant by a name where there is none, the likeliest first."""
    try:
        present = sorted(other.name for other in folder.glob("*.y*ml"))
    except OSError:
        present = []
    near = nearest(Path(name).name, present)
    similar = tuple((Path(name).parent / other).as_posix() for other in near)
    shipped = addresses_like(Path(name))
    return (*shipped, *similar) if len(shipped) == 1 or not similar else similar


def summary(path: Path) -> str:
    """Return the first sentence of the comment at the top of a file; empty where there is none."""
    words: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        words.append(line.removeprefix("# "))
    return " ".join(words).partition(". ")[0].rstrip(".")


class FileTree:
    """Reads graph files. ``incomplete`` is true if an included file could not be read."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.known: dict[tuple[Path, bool], WrittenGraph | None] = {}
        self.incomplete = False

    def read(self, path: Path, shown: str, *, subgraph: bool) -> WrittenGraph | None:
        """Read a file as a graph or a sub-graph; ``None`` after a problem."""
        key = (path, subgraph)
        if key not in self.known:
            tree = read_file(path, shown, self.problems)
            written = None
            if tree is not None:
                written = read_graph(tree, shown, path.parent, self.problems, subgraph=subgraph)
            self.known[key] = written
        return self.known[key]

    def locate(self, node: ScalarNode, file: WrittenGraph, stack: Stack) -> tuple[Path, str] | None:
        """Find the file that ``node`` names, seen from ``file``; ``None`` after a problem."""
        name = str(node.value)
        shown = os.path.normpath(graph_path(name, Path(file.file).parent))
        try:
            path = graph_path(name, file.folder).resolve()
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
        name = str(node.value)
        similar = files_like(name, path.parent)
        self.problems.add(
            Code.FILE,
            f"there is no file {shown}",
            node.where,
            expected="a file, relative to the one that names it, or a shipped one such as aloft:jump",
            found=name,
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


def settings_of(path: Path) -> dict[str, Any]:
    """Return all values that a file and those it includes ``set``, as plain data.

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


_STUDY = ("arms", "grid", "goals", "plots", "graphs", "graph", "tune", "falsify", "draws_per_arm")
_ROBOT = ("links", "joints", "feet", "profiles", "standing", "transmission")
_TASK = ("rise", "distance_x", "distance_y", "landing_height", "jumps", "twist", "rotation")
_HARDWARE = ("bus", "board", "drives", "motors", "soft_start", "dead_man")
_PART = ("inputs", "outputs")

_KINDS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "a study": (_STUDY, "aloft study {file}"),
    "a robot's description": (_ROBOT, "in a graph: robot: {file}"),
    "a task of the jump planner": (_TASK, "aloft plan {file}"),
    "a robot's hardware": (
        _HARDWARE,
        "in a graph: robot: {{use: hal.BearRobot, with: {{hardware: {file}}}}}",
    ),
    "a sub-graph, a part of a graph": (_PART, "in a graph: blocks: {{part: {{use: {file}}}}}"),
}


def is_another_kind(tree: MapNode, shown: str, problems: Problems) -> bool:
    """Return whether a file given as a graph is none; then note it, with the fix.

    A file with a key that only graphs have is a graph, however wrong the others are.
    """
    keys = [entry.key for entry in tree if not entry.key.startswith("_")]
    of_graphs = [key for key in GRAPH_KEYS if key not in ("robot", "actuators")]
    if "links" in keys and "joints" in keys:  # a robot's links, not those between machines
        of_graphs.remove("links")
    if any(key in of_graphs for key in keys):
        return False
    for kind, (telling, command) in _KINDS.items():
        found = [key for key in keys if key in telling]
        if found and ("blocks" not in keys or telling is _PART):
            problems.add(
                Code.WRONG_KIND,
                f"{shown} is {kind}, not a graph that can be run",
                Position(shown, 1, 1),
                expected=f"keys such as {', '.join(GRAPH_KEYS[:3])}, blocks",
                found=", ".join(found),
                fix=command.format(file=shown),
            )
            return True
    return _is_to_be_included(tree, keys, shown, problems)


def _is_to_be_included(tree: MapNode, keys: list[str], shown: str, problems: Problems) -> bool:
    """Return whether a file changes or reads blocks that only a graph that includes it has.

    A file with blocks of its own counts if it needs two more at least: one may be misspelt.
    """
    if not keys or any(key not in COMMON_KEYS for key in keys):
        return False
    files = FileTree(Problems())  # what is wrong in them is said when they are read as a graph
    root = read_graph(tree, shown, Path(shown).parent, files.problems, subgraph=False)
    *included, _ = files.gather(root, ((Path(shown).resolve(), shown),))
    if files.incomplete or any(file.graph for file in (root, *included)):
        return False
    own: list[str] = []
    named: dict[str, None] = {}
    for file in (root, *included):
        own += [block.name for block in file.blocks]
        inputs = [block.inputs for block in file.blocks if block.inputs]
        targets = [entry.key for entry in (*file.sets, *file.wires)]
        sources = [*inputs, *(entry.value for entry in file.wires)]
        for text in [*targets, *(text for node in sources for text in texts_of(node))]:
            if found := _BLOCK.match(text):
                named[found[1]] = None
    missing = [name for name in named if name not in own]
    if len(missing) < (2 if own else 1):
        return False
    problems.add(
        Code.WRONG_KIND,
        f"{shown} is a part that graphs include, not a graph that can be run",
        Position(shown, 1, 1),
        expected="a graph, which says its rate",
        found=f"no rate, and settings or wires of blocks that are not here: {listing(missing)}",
        fix=f"in a graph with such blocks: include: {shown}",
    )
    return True


_BLOCK = re.compile(r"([A-Za-z]\w*)[./]")
