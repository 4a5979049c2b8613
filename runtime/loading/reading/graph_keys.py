"""Merges what a graph's files and overrides say about the graph itself, such as its rate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from .nodes import Entry, MapNode
from .overrides import Override

_MAPPINGS = ("clock", "dimensions", "machines", "place", "links")
"""The keys of a graph whose values are mappings."""


def is_graph_key(override: Override, names: Iterable[str]) -> bool:
    """Whether an override sets a key of the graph itself, such as ``rate`` or ``clock.kind``."""
    if not override.block:
        return True
    return override.block in _MAPPINGS and override.block not in names


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
