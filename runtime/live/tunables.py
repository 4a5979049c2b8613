"""The live parameters of a running graph, one number or list at a time, as a page needs them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ...files.nodes import MapNode, text_of
from ...files.validation import unit_of
from ..language.errors import AloftError
from ..language.stages import CheckedGraph
from ..loading import LoadError, checked_text, flatten

LONGEST_LIST = 12
"""Numbers of a list that have a slider each; a longer one is changed as a text."""
_OPEN_RANGE = 2.0
"""A slider without a bound goes so many times the value's size away from it."""


class Tunables:
    """The parameters of a graph that can be changed while it runs.

    Args:
        graph: the graph as it began to run.
    """

    def __init__(self, graph: CheckedGraph) -> None:
        self._blocks = {spec.path: spec for spec in graph.blocks}
        self._places = _places(graph)

    def rows(self, listed: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """One row for each number, list or text.

        Args:
            listed: the live parameters as the run gives them: ``path``, ``value``, ``unit``, ``text``.

        Returns:
            Plain data: ``path``, ``block``, ``value``, ``start`` (the value when the run began),
            ``unit``, ``text``, ``kind``, ``low`` and ``high`` of a slider, ``bounds`` in words,
            ``choices``, and ``place`` in the file.
        """
        found = []
        for entry in listed:
            block, _, name = entry["path"].rpartition(".")
            spec = self._blocks.get(block)
            if spec is None:
                continue
            start = spec.params.model_dump(mode="json", round_trip=True).get(name)
            info = type(spec.params).model_fields.get(name)
            inside = getattr(spec.params, name, None)
            for path, value, began, field in _leaves(
                entry["path"], entry["value"], start, info, inside
            ):
                found.append(self._row(block, path, value, began, field, entry))
        return found

    def _row(
        self,
        block: str,
        path: str,
        value: Any,
        start: Any,
        info: FieldInfo | None,
        entry: Mapping[str, Any],
    ) -> dict[str, Any]:
        kind, choices = _kind(value, info)
        least, most, words = _bounds(info)
        # A block may know the range of its own parameters better than their declaration.
        own_range = getattr(self._blocks[block].params, "live_range", None)
        if own_range is not None and kind in ("number", "numbers"):
            least, most = own_range(path.removeprefix(f"{block}.").partition(".")[0])
            words = words or _in_words(least, most)
        low, high = _range(start if kind in ("number", "numbers") else None, least, most)
        text = info.description if info is not None and info.description else entry["text"]
        return {
            "path": path,
            "block": block,
            "name": path.removeprefix(f"{block}."),
            "value": value,
            "start": start,
            "unit": (unit_of(info) if info is not None else "")
            or entry["unit"]
            or self._own_unit(block, path),
            "text": text,
            "kind": kind,
            "choices": choices,
            "integer": isinstance(value, int) and info is not None and info.annotation is int,
            "low": low,
            "high": high,
            "bounds": words,
            "place": self._place(path),
        }

    def _own_unit(self, block: str, path: str) -> str:
        """Return the unit that a block's parameters share, where this is one of them."""
        name = path.removeprefix(f"{block}.").partition(".")[0]
        return self._blocks[block].params.own_unit(name)

    def _place(self, path: str) -> str:
        """Return the place where a parameter is written; of one that is not, its block's place."""
        if path in self._places:
            return self._places[path]
        block = path.rpartition(".")[0]
        while block and block not in self._blocks:
            if block in self._places:
                return self._places[block]
            block = block.rpartition(".")[0]
        where = self._blocks[block].where if block else None
        return f"default; its block is in {where}" if where is not None else "default"


def _leaves(
    path: str, value: Any, start: Any, info: FieldInfo | None, inside: Any
) -> Iterator[tuple[str, Any, Any, FieldInfo | None]]:
    """Yield the values of a parameter that are not mappings, with their paths and declarations."""
    if not isinstance(value, Mapping):
        yield path, value, start, info
        return
    fields = type(inside).model_fields if isinstance(inside, BaseModel) else {}
    for key, item in value.items():
        began = start.get(key) if isinstance(start, Mapping) else None
        field = fields.get(key, None if fields else info)
        yield from _leaves(f"{path}.{key}", item, began, field, getattr(inside, str(key), None))


def _kind(value: Any, info: FieldInfo | None) -> tuple[str, list[str]]:
    """Return the kind of control for a value, and its choices if it has any."""
    if isinstance(value, bool):
        return "choice", ["true", "false"]
    if isinstance(value, int | float):
        return "number", []
    if isinstance(value, str) and info is not None and get_origin(info.annotation) is Literal:
        return "choice", [str(choice) for choice in get_args(info.annotation)]
    if (
        isinstance(value, list)
        and 0 < len(value) <= LONGEST_LIST
        and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
    ):
        return "numbers", []
    return "text", []


def _bounds(info: FieldInfo | None) -> tuple[float | None, float | None, str]:
    """Return the least and the greatest value, and the same in words."""
    least: float | None = None
    most: float | None = None
    words = []
    for constraint in _constraints(info):
        for attribute, sign in (("ge", "≥"), ("gt", ">"), ("le", "≤"), ("lt", "<")):
            bound = getattr(constraint, attribute, None)
            if bound is None:
                continue
            words.append(f"{sign} {bound:g}")
            if attribute[0] == "g":
                least = float(bound)
            else:
                most = float(bound)
    return least, most, ", ".join(dict.fromkeys(words))


def _in_words(least: float | None, most: float | None) -> str:
    """Return bounds as a page shows them."""
    known = (("≥", least), ("≤", most))
    return ", ".join(f"{sign} {bound:g}" for sign, bound in known if bound is not None)


def _constraints(info: FieldInfo | None) -> Iterator[Any]:
    """Yield the constraints of a parameter, and of the numbers of a list."""
    if info is None:
        return
    yield from info.metadata
    for inner in get_args(info.annotation):
        for item in getattr(inner, "__metadata__", ()):
            yield from item.metadata if isinstance(item, FieldInfo) else (item,)


def _range(start: Any, least: float | None, most: float | None) -> tuple[float, float]:
    """Return the ends of a slider: the bounds, and where there are none, a likely range."""
    numbers = start if isinstance(start, list) else [start]
    known = [float(x) for x in numbers if isinstance(x, int | float)]
    size = max((abs(x) for x in known), default=0.0) or 1.0
    low = least if least is not None else min(known, default=0.0) - _OPEN_RANGE * size
    high = most if most is not None else max(known, default=0.0) + _OPEN_RANGE * size
    return low, max(high, low)


def _places(graph: CheckedGraph) -> dict[str, str]:
    """Return the place of each parameter that the file gives, by ``block.parameter``."""
    found: dict[str, str] = {}
    if not Path(graph.file).is_file():
        return found
    try:
        flat = flatten(graph.file, graph.overrides)
    except LoadError:
        return found
    for block in flat.blocks:
        _add_locations(block.path, block.parameters, found)
    return found


def _add_locations(path: str, node: MapNode, found: dict[str, str]) -> None:
    for entry in node:
        key = f"{path}.{entry.key}"
        found[key] = str(entry.key_where)
        if isinstance(entry.value, MapNode):
            _add_locations(key, entry.value, found)


FIRST_LINE = "# Values that were tuned while the graph ran; `aloft run` takes this file."


def changed(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the rows of parameters that have another value than when the run began."""
    return [row for row in rows if row["value"] != row["start"]]


def write_overlay(path: Path, graph: CheckedGraph, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Write a graph file that includes ``graph`` and sets what has changed; it loads.

    A file of that name is replaced only if it was written here.

    Args:
        path: of the file.
        graph: the graph as it began to run.
        rows: its parameters; see ``Tunables.rows``.

    Returns:
        The parameters that are set.

    Raises:
        AloftError: nothing has changed, the graph came from no file, or the file cannot be written.
    """
    found = changed(rows)
    if not found:
        raise AloftError("no parameter has another value than when the run began")
    source = Path(graph.file)
    if not source.is_file():
        raise AloftError("the graph was not run from a file that is still there to be included")
    try:
        included = os.path.relpath(source.resolve(), path.resolve().parent)
        text = _text(included, found)
        checked_text(text, path)
        if path.exists() and not path.read_text(encoding="utf-8").startswith(FIRST_LINE):
            raise AloftError(f"{path} is there already; give another name with --out FILE")
        path.write_text(text, encoding="utf-8")
    except LoadError as error:
        raise AloftError(f"the file would not load: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise AloftError(f"{path} cannot be written: {error}") from error
    return [str(row["path"]) for row in found]


def _text(included: str, rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [FIRST_LINE, f"include: [{text_of(included)}]", "set:"]
    for row in rows:
        unit = f" {row['unit']}" if row["unit"] else ""
        lines.append(
            f"  {row['path']}: {text_of(row['value'])}  # was {text_of(row['start'])}{unit}"
        )
    return "\n".join(lines) + "\n"
