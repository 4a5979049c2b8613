"""Recognises files that are no graphs, and says which command they are for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ...language.stages import Position
from ..problems import Code, Problems, listing
from .files import FileTree
from .nodes import MapNode, texts_of
from .written import COMMON_KEYS, GRAPH_KEYS, read_graph

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
