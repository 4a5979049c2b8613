"""The shipped graphs that differ in kind."""

from functools import cache
from pathlib import Path
from typing import Any

import yaml

from aloft.runtime.loading.reading.files import graph_path, shipped_graphs

# Every worker reads all shipped graphs while it collects the tests; PyYAML's own parser takes 5 s for them.
LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def kinds(of_robots: bool = False) -> dict[str, Path]:
    """By address the first of the shipped graphs that have the same kinds of blocks (and, if that is
    asked for, the same robot): those that another task, another scene or another length makes of it
    run the same code with other numbers."""
    found: dict[object, tuple[str, Path]] = {}
    for address, path in shipped_graphs().items():
        robot, used = contents(path)
        if address != "aloft:robots/jump":  # the others in its folder include it and name the robot
            found.setdefault((used, robot if of_robots else ""), (address, path))
    return dict(found.values())


@cache
def contents(path: Path) -> tuple[str, frozenset[str]]:
    """The robot that a graph names, and the kinds of blocks that it and what it includes have."""
    tree = yaml.load(path.read_text(encoding="utf-8"), LOADER)
    robot, used = tree.get("robot", ""), set()
    for block in tree.get("blocks", {}).values():
        used.add(str(block.get("use")))
    for name, value in tree.get("set", {}).items():
        if name.endswith(".use"):
            used.add(str(value))
    for name in tree.get("include", ()):
        theirs, more = contents(graph_path(name, path.parent))
        robot, used = robot or theirs, used | more
    return robot, frozenset(used)
