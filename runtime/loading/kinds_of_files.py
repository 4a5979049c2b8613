"""Recognises files that are no graphs, and says which command they are for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ..language.stages import Position
from .document import read_file
from .nodes import MapNode, Node, texts_of
from .problems import Code, Problems, listing
from .written import COMMON_KEYS, GRAPH_KEYS

_STUDY = ("arms", "grid", "goals", "plots", "graphs", "graph", "tune", "draws_per_arm")
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
    """Whether a file given as a graph is none; then that is noted, with what to do with it.

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
    """Whether a file changes or reads blocks that only a graph has which includes it.

    A file with blocks of its own counts if it needs two more at least: one may be misspelt.
    """
    if not keys or any(key not in COMMON_KEYS for key in keys):
        return False
    trees = _with_included(tree, Path(shown), {})
    if trees is None or any(each.get(key) is not None for each in trees for key in GRAPH_KEYS):
        return False
    own = [entry.key for each in trees for entry in _mapping(each, "blocks")]
    named: dict[str, None] = {}
    for each in trees:
        inputs = [_mapping(e.value, "in") for e in _mapping(each, "blocks")]
        targets = [e.key for key in ("set", "wires") for e in _mapping(each, key)]
        sources = [text for node in (*inputs, _mapping(each, "wires")) for text in texts_of(node)]
        for text in [*targets, *sources]:
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


def _with_included(tree: MapNode, path: Path, seen: dict[Path, None]) -> list[MapNode] | None:
    """A file and all that it includes, each once; ``None`` if one of them cannot be read."""
    trees = [tree]
    entry = tree.get("include")
    for text in texts_of(entry.value) if entry else ():
        file = (path.parent / text).resolve()
        if file in seen:
            continue
        seen[file] = None
        included = read_file(file, str(file), Problems())
        below = _with_included(included, file, seen) if included is not None else None
        if below is None:
            return None
        trees += below
    return trees


def _mapping(node: Node, key: str) -> MapNode:
    """The mapping below a key; empty where there is none."""
    entry = node.get(key) if isinstance(node, MapNode) else None
    value = entry.value if entry else None
    return value if isinstance(value, MapNode) else MapNode((), node.where)
