"""The values of a graph file as immutable trees; every key and value has its place in the file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from .problems import Position

Item = TypeVar("Item")
Plain = None | bool | int | float | str
"""Plain value of a scalar."""


@dataclass(frozen=True)
class ScalarNode:
    """One value."""

    value: Plain
    where: Position


@dataclass(frozen=True)
class ListNode:
    """A list."""

    items: tuple[Node, ...]
    where: Position


@dataclass(frozen=True)
class Entry:
    """One ``key: value`` of a mapping."""

    key: str
    key_where: Position
    value: Node


@dataclass(frozen=True)
class MapNode:
    """A mapping, in the order it is written; keys are text."""

    entries: tuple[Entry, ...]
    where: Position

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def get(self, key: str) -> Entry | None:
        """Return the entry of a key."""
        for entry in self.entries:
            if entry.key == key:
                return entry
        return None

    def keys(self) -> tuple[str, ...]:
        """All keys in order."""
        return tuple(entry.key for entry in self.entries)

    def assign(self, path: Sequence[str], value: Node, key_where: Position) -> MapNode:
        """Return a copy with the value at ``path`` set; mappings on the way are made where missing.

        Where a YAML file is named on the way, ``task: tasks/hop.yaml``, the value is a change of
        what is in that file: ``task: {file: tasks/hop.yaml, rise: 12 cm}``.
        """
        key, rest = path[0], path[1:]
        old = self.get(key)
        if rest:
            inner = _inside(old.value) if old else None
            value = (inner or MapNode((), key_where)).assign(rest, value, key_where)
        new = Entry(key, key_where, value)
        if old is None:
            return MapNode((*self.entries, new), self.where)
        return MapNode(tuple(new if e is old else e for e in self.entries), self.where)


Node = ScalarNode | ListNode | MapNode

FILE_KEY = "file"
"""The key of a mapping that names the file which the other keys change."""


def changed(item: Item, **changes: Any) -> Item:
    """Return a copy of a dataclass with some values, as ``dataclasses.replace`` does in twenty times as long: of the stages
    of a graph every block gets several. It is for classes that check nothing when they are made and keep nothing later.
    """
    made = object.__new__(type(item))
    values = vars(
        item
    ).copy()  # shares its keys with that of the other, which ``update`` of a new one would not
    values.update(changes)
    object.__setattr__(made, "__dict__", values)
    return made


def _inside(node: Node) -> MapNode | None:
    """Return the mapping that a value set inside ``node`` goes into; ``None`` if nothing of it
    stays."""
    if isinstance(node, ScalarNode) and str(node.value).endswith((".yaml", ".yml")):
        return MapNode((Entry(FILE_KEY, node.where, node),), node.where)
    return node if isinstance(node, MapNode) else None


def plain(node: Node) -> Any:
    """Return the tree as plain Python data, without places."""
    if isinstance(node, ScalarNode):
        return node.value
    if isinstance(node, ListNode):
        return [plain(item) for item in node.items]
    return {entry.key: plain(entry.value) for entry in node.entries}


def texts_of(node: Node) -> Iterator[str]:
    """Every text inside of a value, in the order of the file; keys are none of them."""
    if isinstance(node, ScalarNode):
        if isinstance(node.value, str):
            yield node.value
        return
    for inner in node.items if isinstance(node, ListNode) else (e.value for e in node):
        yield from texts_of(inner)


def from_plain(value: Any, where: Position) -> Node:
    """Return a tree of plain Python data (also NumPy arrays and scalars), all of it at one
    place."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        entries = (Entry(str(key), where, from_plain(item, where)) for key, item in value.items())
        return MapNode(tuple(entries), where)
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        return ListNode(tuple(from_plain(item, where) for item in value), where)
    if value is None or isinstance(value, (bool, int, float, str)):
        return ScalarNode(value, where)
    return ScalarNode(str(value), where)


def move(node: Node, where: Position) -> Node:
    """Return the same tree with every place replaced by ``where``."""
    return from_plain(plain(node), where)


def kind(node: Node) -> str:
    """Describe the type of a value in words, for messages."""
    if isinstance(node, MapNode):
        return "a mapping"
    if isinstance(node, ListNode):
        return "a list"
    value = node.value
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return f"{str(value).lower()} (true or false)"
    if isinstance(value, str):
        return f"the text {value!r}"
    return f"the number {text_of(value)}"


_PLAIN_TEXT = re.compile(r"[A-Za-z_$][A-Za-z0-9_./$~-]*(?: [A-Za-z0-9_./^$~-]+)*$")
_QUANTITY_TEXT = re.compile(r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)? [A-Za-z%][A-Za-z0-9 /^%]*$")
# Words that readers of YAML 1.1 do not take for texts.
_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off"})
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def _quoted(text: str) -> str:
    out = []
    for character in text:
        code = ord(character)
        if character in _ESCAPES:
            out.append(_ESCAPES[character])
        elif code < 32 or 0x7F <= code < 0xA0 or code in (0x85, 0x2028, 0x2029, 0xFEFF):
            out.append(f"\\u{code:04x}")
        elif 0xD800 <= code < 0xE000 or code in (0xFFFE, 0xFFFF):
            out.append("\\ufffd")  # a YAML file cannot hold this character
        else:
            out.append(character)
    return '"' + "".join(out) + '"'


def text_of(value: Any) -> str:
    """Plain data as YAML in one line that reads back as the same value."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        if math.isnan(value):
            return ".nan"
        if value in (float("inf"), float("-inf")):
            return ".inf" if value > 0 else "-.inf"
        text = repr(value)
        # YAML 1.1 readers take 1e-05 for text; 1.0e-05 is a number to all of them.
        return text if "." in text or "e" not in text else text.replace("e", ".0e")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        bare = _PLAIN_TEXT.match(value) or _QUANTITY_TEXT.match(value)
        return value if bare and value.lower() not in _WORDS else _quoted(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{text_of(str(k))}: {text_of(v)}" for k, v in value.items()) + "}"
    return "[" + ", ".join(text_of(item) for item in value) + "]"
