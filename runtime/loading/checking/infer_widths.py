"""Widths follow from wires: a parameter such as ``n`` that is the size of an input need not be given.

It is taken from a list among the block's parameters that has as many numbers, or from the signal that is
wired. Where neither says it, the parameter keeps its default. Of a ring of blocks in which none says it,
the first one's default is that of all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from math import prod
from typing import Any

from ....files.nodes import ListNode, Node, ScalarNode, changed, from_plain, plain
from ....robots.description import RobotDescription
from ...language.block import Block
from ...language.flat_graph import FlatBlock, FlatWire, WireElement
from ...language.parameters import ScalarOrVector
from ...language.selection import Selection, select
from ...language.signals import Field, Signal
from .block_check import BlockDraft

_LISTS = (ScalarOrVector, ScalarOrVector | None)
"""Types of parameters that, where they are lists, have a number for each of ``n`` elements."""


class Widths:
    """Finds the widths of a graph's blocks.

    Args:
        blocks: all blocks by path.
        type_of: the class of a block, ``None`` where it has none.
        draft_of: the draft of a block that has all its widths.
        robot: the graph's.
    """

    def __init__(
        self,
        blocks: Mapping[str, FlatBlock],
        type_of: Callable[[FlatBlock], type[Block] | None],
        draft_of: Callable[[FlatBlock], BlockDraft],
        robot: RobotDescription | None,
    ) -> None:
        self._blocks, self._type_of, self._draft_of = blocks, type_of, draft_of
        self._names = robot.element_names if robot is not None else {}
        self._open: dict[str, list[str]] = {}
        self._found: dict[str, dict[str, int]] = {}

    def find(self) -> None:
        """Find all widths; ``filled`` writes them."""
        readers: dict[str, list[str]] = {}
        for path, flat in self._blocks.items():
            block_type = self._type_of(flat)
            names = list(open_widths(flat, block_type)) if block_type is not None else []
            if names:
                self._open[path] = names
                for wire in flat.wires.values():
                    for inner in wire.inner():
                        readers.setdefault(inner.source_block, []).append(path)
        queue = deque(self._open)
        assumed = iter(list(self._open))
        while True:
            while queue:
                path = queue.popleft()
                if self._settle(path):
                    queue.extend(readers.get(path, ()))
            stuck = next((path for path in assumed if path in self._open), None)
            if stuck is None:
                return
            del self._open[stuck]  # its default
            queue.extend(readers.get(stuck, ()))

    def filled(self, flat: FlatBlock) -> FlatBlock:
        """Return the block with the widths that were found."""
        for name, width in self._found.get(flat.path, {}).items():
            node = from_plain(width, flat.where)
            flat = changed(flat, parameters=flat.parameters.assign((name,), node, flat.where))
        return flat

    def _settle(self, path: str) -> bool:
        """Find the widths of a block. Returns whether all of them have become known."""
        flat = self._blocks[path]
        block_type = self._type_of(flat)
        left = []
        for name in self._open.get(path, ()):
            width = self._width(flat, block_type, name) if block_type is not None else None
            if width is None:
                left.append(name)
            else:
                self._found.setdefault(path, {})[name] = width
        if path not in self._open or left:
            if left:
                self._open[path] = left
            return False
        del self._open[path]
        return True

    def _width(self, flat: FlatBlock, block_type: type[Block], name: str) -> int | None:
        """Return a width, ``None`` while nothing says it."""
        lists = _lists_of(block_type) if name == "n" else ()  # type: ignore[arg-type]  # a class is hashable; mypy asks its instances
        for key in lists:
            entry = flat.parameters.get(key)
            value = entry.value if entry is not None else None
            if isinstance(value, ListNode) and value.items:
                return len(value.items)
        for port, declared in block_type.inputs.items():
            wire = flat.wires.get(port)
            for field in declared.signal.fields.values():
                if wire is not None and field.shape == (name,):
                    width = self._arriving(wire, field, declared.signal)
                    if width is not None and width > 0:
                        return width
        return None

    def _arriving(self, wire: FlatWire, field: Field, signal: type[Signal]) -> int | None:
        """Return the number of elements that arrive at a field of an input."""
        if wire.constant is not None:
            return None
        if not wire.slices:
            return self._selected(WireElement(wire.where, wire), field.name)
        alone = len(signal.fields) == 1
        for wire_slice in wire.slices:
            if wire_slice.field == field.name or (alone and not wire_slice.field):
                if not wire_slice.is_list and isinstance(wire_slice.items[0].literal, ScalarNode):
                    return None  # one number for all elements
                total = 0
                for item in wire_slice.items:
                    literal = item.literal
                    part = (
                        _count(literal) if literal is not None else self._selected(item, field.name)
                    )
                    if part is None:
                        return None
                    total += part
                return total
        return None

    def _selected(self, item: WireElement, wanted: str) -> int | None:
        """Return how many elements are selected of a source."""
        source = self._blocks.get(item.wire.source_block) if item.wire is not None else None
        source_type = self._type_of(source) if source is not None else None
        if item.wire is None or source is None or source_type is None or source.path in self._open:
            return None
        output = source_type.outputs.get(item.wire.source_port)
        if output is None:  # ports that depend on parameters
            output = self._draft_of(source).outputs.get(item.wire.source_port)
        fields = output.signal.fields if output is not None else {}
        only = next(iter(fields)) if len(fields) == 1 else ""
        field = fields.get(item.selection.field or (wanted if wanted in fields else only))
        shape = self._draft_of(source).shape(field) if field is not None else None
        if field is None or shape is None:
            return None
        if not item.selection.indices:
            return prod(shape)
        rows = self._names.get(str(field.shape[0]), ()) if field.shape else ()
        try:
            return int(select(Selection("", item.selection.indices), shape, rows).size)
        except ValueError:
            return None  # which is reported later


def open_widths(flat: FlatBlock, block_type: type[Block]) -> Iterator[str]:
    """Return the parameters that are sizes of a block's inputs and that the graph does not give."""
    widths = _widths_of(block_type)  # type: ignore[arg-type]  # a class is hashable; mypy asks its instances
    return (name for name in widths if flat.parameters.get(name) is None)


@lru_cache(maxsize=1024)
def _lists_of(block_type: type[Block]) -> tuple[str, ...]:
    """Return the parameters that may be lists with a number for each of ``n`` elements."""
    fields = block_type.Params.model_fields.items()
    return tuple(name for name, info in fields if info.annotation in _LISTS)


@lru_cache(maxsize=1024)
def _widths_of(block_type: type[Block]) -> tuple[str, ...]:
    """Return the parameters that are sizes of a class's inputs."""
    fields = block_type.Params.model_fields
    sizes = dict.fromkeys(
        size
        for port in block_type.inputs.values()
        for field in port.signal.fields.values()
        if len(field.shape) == 1 and isinstance(size := field.shape[0], str)
    )
    return tuple(
        name for name in sizes if (info := fields.get(name)) is not None and info.annotation is int
    )


def _count(node: Node) -> int:
    """Return how many numbers a constant has."""
    value: Any = plain(node)
    return len(value) if isinstance(value, list) else 1
