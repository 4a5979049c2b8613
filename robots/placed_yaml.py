"""Reads a YAML file of a robot as plain data, with the line and column of every value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..files.document import read_file
from ..files.nodes import MapNode, plain
from ..files.problems import Code, Problem, Problems
from ..files.validation import locate
from .validation import RobotError, RobotFault

_KIND = ("a robot's description", "name, base, links, joints")


@dataclass(frozen=True)
class PlacedYaml:
    """The file's ``data``, none where it is empty, the ``faults`` of its YAML alone, and where everything stands."""

    data: Any
    tree: MapNode
    faults: tuple[RobotFault, ...]

    @classmethod
    def read(cls, path: Path) -> PlacedYaml:
        """The file's content.

        Raises:
            RobotError: it cannot be read, is no text in UTF-8, no YAML or no mapping.
        """
        problems = Problems()
        tree = read_file(path, str(path), problems, _KIND, may_be_empty=True)
        faults = tuple(map(_fault, problems.report(str(path)).problems))
        if tree is None:
            raise RobotError(str(path), faults)
        return cls(plain(tree) if tree.entries else None, tree, faults)

    def place(self, path: tuple[str | int, ...]) -> tuple[int, int]:
        """Line and column of the value at a path, or of the nearest thing that holds it; (0, 0)
        where the file holds nothing of it."""
        steps, node, _ = locate(self.tree, path)
        if not self.tree.entries or (path and not steps):
            return (0, 0)
        return node.where.line, node.where.column

    def holds(self, path: tuple[str | int, ...]) -> bool:
        """Whether the file has something at that path."""
        return len(locate(self.tree, path)[0]) == len(path)

    def placed(self, fault: RobotFault) -> RobotFault:
        """The same fault with its line and column."""
        if fault.line:
            return fault
        line, column = self.place(fault.path)
        if not line and self.tree.entries:
            line, column = self.tree.where.line, self.tree.where.column
        return replace(fault, line=line, column=column)


def _fault(problem: Problem) -> RobotFault:
    """A problem of the YAML as a fault of the robot."""
    where, message = problem.where, problem.message
    if problem.code is Code.YAML:
        message = f"this is no YAML: {message}"
    return RobotFault(
        (), message, problem.expected, problem.found, problem.fix, where.line, where.column
    )
