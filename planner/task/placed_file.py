"""YAML files of the planner, read as graph files are: every value with its line and column."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...runtime.language.stages import Position
from ...runtime.loading.problems import Problems
from ...runtime.loading.reading.document import read_value
from ...runtime.loading.reading.nodes import ListNode, MapNode, Node, plain
from .errors import TaskError

Key = str | int


@dataclass(frozen=True)
class PlacedFile:
    """What is in a file: ``values`` as plain data, and where each of them is."""

    file: str
    values: dict[str, Any]
    tree: MapNode

    def place(self, keys: Sequence[Key], *, key: bool = False) -> str:
        """``file:line:column`` of the value at that path, or of its ``key``; of what comes nearest
        where there is none."""
        node: Node = self.tree
        where = node.where
        for step in keys:
            if isinstance(node, MapNode) and (entry := node.get(str(step))) is not None:
                node, where = entry.value, entry.key_where if key else entry.value.where
            elif isinstance(node, ListNode) and str(step).isdigit() and int(step) < len(node.items):
                node = node.items[int(step)]
                where = node.where
        return str(where)

    def place_of_words(self, text: str) -> str:
        """Where the last of the file's keys is that a message speaks of; the start of the file
        where it speaks of none."""
        spoken = [
            entry.key_where
            for entry in self.tree
            if re.search(rf"\b{re.escape(entry.key)}\b", text)
        ]
        return str(max(spoken, default=self.tree.where))


def read_placed(path: Path, example: str) -> PlacedFile:
    """Read a file that is a mapping.

    Raises:
        TaskError: it cannot be read, is no YAML, or is no mapping; every reason with its place.
    """
    shown, problems = str(path), Problems()
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise TaskError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise TaskError(f"{path} is not UTF-8 text (byte {error.start})") from error
    tree = read_value(text, shown, problems)
    report = problems.report(shown)
    if not report.ok:
        raise TaskError(
            "\n".join(
                f"{p.where}: {p.message}{f'; {p.fix}' if p.fix else ''}" for p in report.problems
            )
        )
    if not isinstance(tree, MapNode):
        found = "nothing" if tree is None else repr(plain(tree))
        where = tree.where if tree else Position(shown, 1, 1)
        raise TaskError(f"{where}: expected keys such as {example!r}, found {found}")
    return PlacedFile(shown, plain(tree), tree)
