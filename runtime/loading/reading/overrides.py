"""Reads overrides, ``block.parameter=value``, of the command line, of Python and of ``set``.

An override may also set a key of the graph itself, such as ``rate`` or ``clock.kind``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
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


def location_of(text: str) -> Position:
    """Return the place of an override: the override itself."""
    return Position(f"--set {text}", 0, 0)


def read_overrides(overrides: Overrides, problems: Problems) -> tuple[Override, ...]:
    """Read the overrides of the whole run; the last one of a key wins."""
    pairs: list[tuple[str, Node, Position]] = []
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            if isinstance(value, Entry):
                pairs.append((str(key), value.value, value.key_where))
                continue
            shown = value.tolist() if hasattr(value, "tolist") else value
            where = location_of(f"{key}={_short(shown)}")
            pairs.append((str(key), from_plain(value, where), where))
    else:
        for text in overrides:
            key, equals, value_text = text.partition("=")
            where = location_of(text)
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
        override = _parameter_override(key, node, where)
        if override is not None:
            found.append(override)
        elif key in GRAPH_KEYS:
            found.append(Override(key, "", (key,), node, where))
        else:
            problems.add(
                Code.OVERRIDE,
                f"{key!r} does not name a block's parameter",
                where,
                expected="block.parameter=value, or rate, duration, robot",
                found=key,
            )
    return tuple(found)


def read_sets(entries: Iterable[Entry], prefix: str, problems: Problems) -> tuple[Override, ...]:
    """Read the entries of a file's ``set``; block paths get ``prefix`` in front."""
    found = []
    for entry in entries:
        override = _parameter_override(entry.key, entry.value, entry.key_where)
        if override is not None:
            found.append(replace(override, block=prefix + override.block))
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


def _parameter_override(key: str, value: Node, where: Position) -> Override | None:
    """Return the override that ``block.parameter`` names; ``None`` if the key has another form."""
    block, *path = key.split(".")
    if block and path and all(path):
        return Override(key, block, tuple(path), value, where)
    return None


def _read_text(text: str, where: Position, problems: Problems) -> Node | None:
    """Read a value written as YAML, all of it placed at the override."""
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
    """Return whether an override sets a key of the graph itself, such as ``rate`` or
    ``clock.kind``."""
    if not override.block:
        return True
    return override.block in SECTION_KEYS and override.block not in names


def merge(graph: MapNode, path: Sequence[str], value: Node, where: Position) -> MapNode:
    """Set the value at ``path`` in the graph's keys; later mappings add to earlier ones.

    Included files and overrides of the graph both come here.
    """
    old = graph.get(path[0])
    adds = len(path) == 1 and old is not None and isinstance(old.value, MapNode)
    if not adds or not isinstance(value, MapNode):
        return graph.assign(path, value, where)
    for item in value:
        graph = graph.assign((*path, item.key), item.value, item.key_where)
    return graph
