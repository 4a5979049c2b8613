"""Recognises files that are no graphs, and says which command they are for."""

from __future__ import annotations

from collections.abc import Mapping

from ..language.stages import Position
from .nodes import MapNode
from .problems import Code, Problems
from .written import GRAPH_KEYS

_STUDY = ("arms", "grid", "goals", "plots", "graphs", "graph", "tune", "draws_per_arm")
_ROBOT = ("links", "joints", "feet", "profiles", "standing", "transmission")
_TASK = ("rise", "distance_x", "distance_y", "landing_height", "jumps", "twist", "rotation")
_PART = ("inputs", "outputs")

_KINDS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "a study": (_STUDY, "aloft study {file}"),
    "a robot's description": (_ROBOT, "in a graph: robot: {file}"),
    "a task of the jump planner": (_TASK, "aloft plan {file}"),
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
    return False
