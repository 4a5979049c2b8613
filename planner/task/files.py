"""The planner's files and its exceptions.

YAML is read as graph files are: every value with its line and column. Files are written as a whole or not at
all, even if the process is killed meanwhile.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...files.cache import cache_root, make_folders
from ...files.document import read_value
from ...files.nodes import ListNode, MapNode, Node, plain
from ...files.problems import Position, Problems
from ...runtime.language.errors import AloftError, need_extra


class JumpTaskError(AloftError, ValueError):
    """A task cannot be read, or asks for what contradicts itself; the message has every reason."""


class PlanError(AloftError):
    """A jump that cannot be planned. ``family`` names the constraint family that cannot be met,
    ``violation`` is how far the best attempt missed it, in that family's unit."""

    def __init__(self, message: str, *, family: str = "", violation: float = 0.0) -> None:
        super().__init__(message)
        self.family = family
        self.violation = violation


def need_planner() -> None:
    """Raise ``MissingExtraError`` where CasADi is not installed, without which no plan is made."""
    need_extra("casadi", "plan", "planning a jump")


Key = str | int


@dataclass(frozen=True)
class LocatedFile:
    """Content of a file: ``values`` as plain data, and the place of each of them."""

    file: str
    values: dict[str, Any]
    tree: MapNode

    def place(self, keys: Sequence[Key], *, key: bool = False) -> str:
        """Return ``file:line:column`` of the value at that path, or of its ``key``; of what comes nearest where there
        is none.
        """
        node: Node = self.tree
        where = node.where
        for step in keys:
            if isinstance(node, MapNode) and (entry := node.get(str(step))) is not None:
                node, where = entry.value, entry.key_where if key else entry.value.where
            elif isinstance(node, ListNode) and str(step).isdigit() and int(step) < len(node.items):
                node = node.items[int(step)]
                where = node.where
        return str(where)

    def location_of_words(self, text: str) -> str:
        """Return the place of the last of the file's keys that a message names; the start of the file where it names
        none.
        """
        named_keys = [
            entry.key_where
            for entry in self.tree
            if re.search(rf"\b{re.escape(entry.key)}\b", text)
        ]
        return str(max(named_keys, default=self.tree.where))


def read_located(path: Path, example: str) -> LocatedFile:
    """Read a file that is a mapping.

    Raises:
        JumpTaskError: it cannot be read, is no YAML, or is no mapping; every reason with its place.
    """
    shown, problems = str(path), Problems()
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise JumpTaskError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise JumpTaskError(f"{path} is not UTF-8 text (byte {error.start})") from error
    tree = read_value(text, shown, problems)
    report = problems.report(shown)
    if not report.ok:
        raise JumpTaskError(
            "\n".join(
                f"{p.where}: {p.message}{f'; {p.fix}' if p.fix else ''}" for p in report.problems
            )
        )
    if not isinstance(tree, MapNode):
        found = "nothing" if tree is None else repr(plain(tree))
        where = tree.where if tree else Position(shown, 1, 1)
        raise JumpTaskError(f"{where}: expected keys such as {example!r}, found {found}")
    return LocatedFile(shown, plain(tree), tree)


ABANDONED = 3600.0
"""Age from which a partial file counts as abandoned by its writer [s]."""


def write_whole(path: Path, data: bytes) -> Path:
    """Write a file, replacing what is there: readers see the old one or the new one, never half.

    In the user's cache folder the file and its folders are this user's only, else they would not be used.
    """
    root = cache_root()
    private = root is not None and root in path.parents
    if private:
        make_folders(path.parent)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            if private:
                part.chmod(0o600)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path


def remove_abandoned(folder: Path) -> None:
    """Remove the parts that a process left behind which was killed while it wrote one."""
    for part in folder.glob(".*.part"):
        try:
            if time.time() - part.stat().st_mtime > ABANDONED:
                part.unlink()
        except FileNotFoundError:
            continue  # it was not abandoned after all
