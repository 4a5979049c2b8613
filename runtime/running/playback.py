"""A graph in which some blocks do not run: their outputs come from recorded rows of the bus."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.block import Block
from ..language.layout import Layout
from ..language.stages import CheckedGraph
from .differences import Translation
from .memory import BoundGraph


class PlaybackBlock(Block):
    """Stands in for a block: it has the same ports and the same kind of machine, but no state.

    Subclasses made by ``playback_block_type`` declare the ports. Whenever the block would have run, its
    stand-in writes the outputs that were recorded for this tick. It opens no device and moves
    nothing.
    """

    _pairs: list[tuple[NDArray[Any], NDArray[Any]]] = []

    def read_from(self, views: list[tuple[NDArray[Any], NDArray[Any]]]) -> None:
        """Take (source, target) views; the sources change from tick to tick."""
        self._pairs = views

    def copy(self) -> None:
        """Write the outputs."""
        for source, target in self._pairs:
            np.copyto(target, source)


class _PlaybackMealy(PlaybackBlock):
    """A fed block whose outputs change when it steps."""

    def step(self) -> None:
        self.copy()


class _PlaybackMoore(PlaybackBlock):
    """A fed block whose outputs change when it emits."""

    def emit(self) -> None:
        self.copy()

    def update(self) -> None:
        pass


_TYPES: dict[type[Block], type[PlaybackBlock]] = {}


def playback_block_type(block_type: type[Block]) -> type[PlaybackBlock]:
    """Return the stand-in for blocks of that type."""
    if block_type in _TYPES:
        return _TYPES[block_type]
    base = _PlaybackMoore if block_type.is_moore() else _PlaybackMealy
    body = {"__doc__": PlaybackBlock.__doc__, "Params": block_type.Params}
    kind: type[PlaybackBlock] = type(f"Playback{block_type.__name__}", (base,), body)
    kind.inputs, kind.outputs = block_type.inputs, block_type.outputs
    _TYPES[block_type] = kind
    return kind


def playback_graph(graph: CheckedGraph, paths: Iterable[str]) -> CheckedGraph:
    """Return the same graph with the blocks at ``paths`` replaced by stand-ins.

    The bus keeps its layout, and the order of execution stays what it was.
    """
    fed = dict.fromkeys(paths)
    blocks = tuple(
        replace(spec, block_type=playback_block_type(spec.block_type)) if spec.path in fed else spec
        for spec in graph.blocks
    )
    return replace(graph, blocks=blocks)


class Playback:
    """Gives the stand-ins of a bound graph what to write, row by row.

    Args:
        bound: the graph.
        layout: the layout of the recorded rows.

    Raises:
        KeyError: the recording lacks a field that a stand-in must write; its text names it.
    """

    def __init__(self, bound: BoundGraph, layout: Layout) -> None:
        self._row = np.zeros(layout.size, np.uint8)
        have = Translation(layout, bound.memory.bus.layout).names
        known = dict.fromkeys(have)
        self.paths: list[str] = []
        for path, block in bound.blocks.items():
            if not isinstance(block, PlaybackBlock):
                continue
            self.paths.append(path)
            pairs = []
            for port in type(block).outputs:
                for field, target in getattr(block, port).views().items():
                    name = f"{path}.{port}.{field}"
                    if name not in known:
                        raise KeyError(name)
                    pairs.append((layout.view(self._row, name), target))
            block.read_from(pairs)

    def show(self, row: NDArray[np.uint8]) -> None:
        """Make ``row`` (bytes,) the one that the stand-ins write in the next tick."""
        np.copyto(self._row, row)
