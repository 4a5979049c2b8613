"""Writes what a graph needs beside itself into a folder: its robot's description, and the user's modules."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import yaml

from ..files.nodes import ScalarNode, plain
from ..robots.description import ROBOT_FILES, RobotDescription
from .language.block_files import imported_files
from .language.flat_graph import FlatGraph

_OURS = Path(__file__).parents[1]


def with_robot_beside(graph: FlatGraph, robot: RobotDescription | None, folder: Path) -> FlatGraph:
    """Return a graph that finds its robot in ``folder``, where the robot is described by a file: its description is
    written there, as ``robot.yaml``."""
    if graph.robot is None or robot is None:
        return graph
    if not str(plain(graph.robot.value)).endswith(ROBOT_FILES):
        return graph
    data = yaml.safe_dump(robot.content(), sort_keys=False)
    (folder / "robot.yaml").write_text(data, encoding="utf-8")
    name = replace(graph.robot, value=ScalarNode("robot.yaml", graph.robot.value.where))
    return replace(graph, robot=name, robot_folder=graph.folder)


def is_own_module(imported: str) -> bool:
    """Return whether a module is a file of the user's, and not installed."""
    file = Path(getattr(sys.modules.get(imported), "__file__", None) or "")
    return file.is_file() and "site-packages" not in file.parts


def copy_module(name: str, imported: str, folder: Path) -> None:
    """Copy a user's module, and the modules beside it that it imports, as they are below its root;
    an installed module is not copied.

    Args:
        name: what a graph calls it.
        imported: its name among the modules that are imported.
    """
    if not is_own_module(imported):
        return
    file = Path(str(sys.modules[imported].__file__)).resolve()
    root = file.parents[len(name.split(".")) - (0 if file.name == "__init__.py" else 1)]
    pending = [file]
    while pending:
        each = pending.pop()
        copy = folder / each.relative_to(root)
        if copy.exists():
            continue
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(each, copy)
        found = imported_files(each, root)
        pending += [p for p in found if not (folder / p.relative_to(root)).exists()]
