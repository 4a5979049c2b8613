"""Reads overrides, ``block.parameter=value``, of the command line, of Python and of ``set``.

An override may also set a key of the graph itself, such as ``rate`` or ``clock.kind``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ....files.document import read_value
from ....files.nodes import Entry, MapNode, Node, ScalarNode, from_plain, move, plain, text_of
from ....files.problems import Code, Position, Problems
from .graph_file import GRAPH_KEYS, SECTION_KEYS

Overrides = Mapping[str, Any] | Iterable[str]
"""``{"landing.w_l": [0.03, 0.04]}`` or ``["landing.w_l=[0.03, 0.04]"]``.

A value may be an ``Entry`` of another file: problems then name its place there.
"""


@dataclass(frozen=True)
class Override:
    """One value to set: the ``block``'s path and the ``path`` of the parameter inside it.

    For a key of the graph itself (``rate``, ``clock.kind``) the block is empty.
    """

    key: str
    block: str
    path: tuple[str, ...]
    value: Node
    where: Position


def place_of(text: str) -> Position:
    """The place of an override: the override itself."""
    return Position(f"--set {text}", 0, 0)


def read_overrides(overrides: Overrides, problems: Problems) -> tuple[Override, ...]:
    """Overrides of the whole run; the last one of a key wins."""
    pairs: list[tuple[str, Node, Position]] = []
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            if isinstance(value, Entry):
                pairs.append((str(key), value.value, value.key_where))
                continue
            shown = value.tolist() if hasattr(value, "tolist") else value
            where = place_of(f"{key}={_short(shown)}")
            pairs.append((str(key), from_plain(value, where), where))
    else:
        for text in overrides:
            key, equals, value_text = text.partition("=")
            where = place_of(text)
            if not equals:
                problems.add(
                    Code.OVERRIDE,
                    f"{text!r} sets nothing",
                    where,
                    expected="block.parameter=value",
                    fix=f"--set {text}=...",
                )
                continue
            node = _read_text(value_text, where, problems)
            if node is not None:
                pairs.append((key.strip(), node, where))
    found = []
    for key, node, where in pairs:
        override = _split(key, node, where, problems)
        if override is not None:
            found.append(override)
    return tuple(found)


def read_sets(entries: Iterable[Entry], prefix: str, problems: Problems) -> tuple[Override, ...]:
    """The entries of a file's ``set``; block paths get ``prefix`` in front."""
    found = []
    for entry in entries:
        block, dot, rest = entry.key.partition(".")
        if dot and block and all(rest.split(".")):
            path = tuple(rest.split("."))
            found.append(Override(entry.key, prefix + block, path, entry.value, entry.key_where))
            continue
        problems.add(
            Code.OVERRIDE,
            f"{entry.key!r} does not name a block's parameter",
            entry.key_where,
            expected="block.parameter: value",
            found=entry.key,
            fix=f"write {entry.key!r} as a key of the graph" if entry.key in GRAPH_KEYS else "",
        )
    return tuple(found)


def _split(key: str, node: Node, where: Position, problems: Problems) -> Override | None:
    block, dot, rest = key.partition(".")
    if not dot and block in GRAPH_KEYS:
        return Override(key, "", (block,), node, where)
    if dot and block and all(rest.split(".")):
        return Override(key, block, tuple(rest.split(".")), node, where)
    problems.add(
        Code.OVERRIDE,
        f"{key!r} does not name a block's parameter",
        where,
        expected="block.parameter=value, or rate, duration, robot",
        found=key,
    )
    return None


def _read_text(text: str, where: Position, problems: Problems) -> Node | None:
    """A value written as YAML, all of it placed at the override."""
    own = Problems()
    node = read_value(text, where.file, own)
    for problem in own.report(where.file).problems:
        problems.add(
            Code.OVERRIDE,
            f"the value cannot be read: {problem.message}",
            where,
            found=text,
            fix=problem.fix,
        )
    if len(own):
        return None
    return ScalarNode(None, where) if node is None else move(node, where)


def _short(value: Any) -> str:
    try:
        text = text_of(plain(from_plain(value, Position("", 0, 0))))
    except (TypeError, ValueError, RecursionError):
        text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def is_graph_key(override: Override, names: Iterable[str]) -> bool:
    """Whether an override sets a key of the graph itself, such as ``rate`` or ``clock.kind``."""
    if not override.block:
        return True
    return override.block in SECTION_KEYS and override.block not in names


def as_entry(override: Override) -> Entry:
    """An override of the graph itself as an entry of its file."""
    path = (override.block, *override.path) if override.block else override.path
    if len(path) == 1:
        return Entry(path[0], override.where, override.value)
    value = MapNode((), override.where).assign(path[1:], override.value, override.where)
    return Entry(path[0], override.where, value)


def merge(graph: dict[str, tuple[Entry, Path]], entry: Entry, folder: Path) -> None:
    """Let a later entry win; mappings are merged key by key."""
    old = graph.get(entry.key)
    if old is not None and isinstance(entry.value, MapNode):
        merged = old[0].value
        if isinstance(merged, MapNode):
            for item in entry.value:
                merged = merged.assign((item.key,), item.value, item.key_where)
            entry = replace(entry, value=merged)
    graph[entry.key] = (entry, folder)
