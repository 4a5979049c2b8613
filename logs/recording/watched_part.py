"""Shows one part of a graph that runs on another machine, from what it says of itself."""

from __future__ import annotations

import numpy as np

from ...runtime.links.observer import Observer
from ...runtime.links.part import part_graph
from ...runtime.running.memory import Memory
from ..file.header import make_header
from .live_feed import LiveFeed


class WatchedPart:
    """Feeds a viewer with the bus of another machine's part.

    The layout of the bus follows from the graph, so only the numbers travel. A row that comes after
    a later one, as from a part that was started again, begins the time anew.

    Args:
        observer: connected.
        machine: whose part it is.
        source: where the viewer listens.
    """

    def __init__(self, observer: Observer, machine: str, source: str) -> None:
        graph = part_graph(observer.placed, machine)
        bus = Memory(graph.blocks, graph.robot).bus
        header = make_header(graph, bus.layout, bus.buffer.tobytes())
        self.taken = 0
        self._feed = LiveFeed(source, header)
        observer.rows(machine, header.bus.size, self._take)

    @property
    def problem(self) -> str:
        """Why nothing is shown any more; empty while all is well."""
        return self._feed.problem

    def close(self) -> None:
        """Let the viewer have what has come."""
        self._feed.finish(None)

    def _take(self, tick: int, row: bytes) -> None:
        self.taken += 1
        rows = np.frombuffer(row, np.uint8)[None]
        self._feed.rows(np.array([tick], np.int64), rows)
