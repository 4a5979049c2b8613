"""Writes what a graph needs beside itself into a folder: its robot's description, and the user's modules."""

from __future__ import annotations

import ast
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import yaml

from ..files.nodes import ScalarNode, plain
from ..robots.description import ROBOT_FILES, RobotDescription
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
        pending += [p for p in _imported(each, root) if not (folder / p.relative_to(root)).exists()]


def _imported(file: Path, root: Path) -> Iterator[Path]:
    """Yield the files below ``root`` that a module imports, with the packages they are in."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names: list[str] = []
        base = root
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = file.parents[node.level - 1] if node.level else root
            module = node.module or ""
            names = [module, *(f"{module}.{alias.name}".strip(".") for alias in node.names)]
        for name in filter(None, names):
            parts = name.split(".")
            places = [base.joinpath(*parts[:k], "__init__.py") for k in range(1, len(parts) + 1)]
            for place in (*places, base.joinpath(*parts).with_suffix(".py")):
                if place.is_file() and place.is_relative_to(root) and _OURS not in place.parents:
                    yield place
