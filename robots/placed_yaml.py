"""Reads a YAML file as plain data, with the line and column of every key and value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from .validation import RobotError, RobotFault

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class PlacedYaml:
    """The file's ``data``, the ``faults`` of its YAML alone, and where everything stands."""

    data: Any
    root: yaml.Node | None
    faults: tuple[RobotFault, ...]

    @classmethod
    def read(cls, path: Path) -> PlacedYaml:
        """The file's content.

        Raises:
            RobotError: it cannot be read, is no text in UTF-8 or no YAML.
        """
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            fault = RobotFault((), "this is no text in UTF-8", "YAML", f"byte {error.start}")
            raise RobotError(str(path), [fault]) from error
        except OSError as error:
            reason = error.strerror or str(error)
            fault = RobotFault((), f"the file cannot be read: {reason}")
            raise RobotError(str(path), [fault]) from error
        try:
            root, doubled, data = _read_once(text)
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            what = getattr(error, "problem", None) or " ".join(str(error).split())
            line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
            fault = RobotFault((), f"this is no YAML: {what}", line=line, column=column)
            raise RobotError(str(path), [fault]) from error
        return cls(data, root, doubled)

    def place(self, path: tuple[str | int, ...]) -> tuple[int, int]:
        """Line and column of the value at a path, or of the nearest thing that holds it; (0, 0)
        where the file holds nothing of it."""
        node, mark = self.root, None
        for key in path:
            found = None
            if isinstance(node, yaml.MappingNode):
                found = next((v for k, v in node.value if k.value == str(key)), None)
            elif isinstance(node, yaml.SequenceNode) and isinstance(key, int):
                found = node.value[key] if key < len(node.value) else None
            if found is None:
                break
            node, mark = found, found.start_mark
        if mark is None and node is not None and path == ():
            mark = node.start_mark
        return (mark.line + 1, mark.column + 1) if mark else (0, 0)

    def holds(self, path: tuple[str | int, ...]) -> bool:
        """Whether the file has something at that path."""
        found = self.data
        for key in path:
            try:
                found = found[key]
            except (KeyError, IndexError, TypeError):
                return False
        return True

    def placed(self, fault: RobotFault) -> RobotFault:
        """The same fault with its line and column."""
        if fault.line:
            return fault
        line, column = self.place(fault.path)
        if not line and self.root is not None:
            line, column = self.root.start_mark.line + 1, self.root.start_mark.column + 1
        return replace(fault, line=line, column=column)


def _read_once(text: str) -> tuple[yaml.Node | None, tuple[RobotFault, ...], Any]:
    """The tree of a text, the keys that stand twice in it, and its data, which is made from that tree
    rather than by reading the text again."""
    loader = _Loader(text)
    try:
        root = loader.get_single_node()
        doubled = tuple(
            _doubled_keys(root, ())
        )  # before merge keys are resolved in the tree itself
        return root, doubled, None if root is None else loader.construct_document(root)
    finally:
        loader.dispose()


def _doubled_keys(node: yaml.Node | None, path: tuple[str | int, ...]) -> list[RobotFault]:
    """Every key that stands twice in one mapping; YAML itself takes the last without a word."""
    found: list[RobotFault] = []
    if isinstance(node, yaml.MappingNode):
        first: dict[str, int] = {}
        for key, value in node.value:
            name, mark = str(key.value), key.start_mark
            if name in first:
                found.append(
                    RobotFault(
                        (*path, name), f"key {name!r} stands twice", "each key once",
                        f"{name!r} also in line {first[name]}", "",
                        mark.line + 1, mark.column + 1,
                    )
                )  # fmt: skip
            first.setdefault(name, mark.line + 1)
            found += _doubled_keys(value, (*path, name))
    elif isinstance(node, yaml.SequenceNode):
        for k, value in enumerate(node.value):
            found += _doubled_keys(value, (*path, k))
    return found
