"""What a replay needs of a run, which may be kept in memory or in a recording."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.layout import Layout
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.language.stages import CheckedGraph
from ...runtime.running.memory import BoundGraph, Snapshot
from ...runtime.running.run_result import RunResult


class Replayable(Protocol):
    """A run that was kept in memory or in a recording.

    Attributes:
        graph: the graph that ran.
        bus, state: the layouts of the rows and of the keyframes' state.
        ticks: all ticks that have rows, increasing.
        keyframes: ticks before which everything the graph remembers was kept, increasing.
        changes: parameters changed while it ran, in order.
        failed: whether a block failed in the tick after the last row.
    """

    @property
    def graph(self) -> CheckedGraph: ...
    @property
    def bus(self) -> Layout: ...
    @property
    def state(self) -> Layout: ...
    @property
    def ticks(self) -> NDArray[np.int64]: ...
    @property
    def keyframes(self) -> Sequence[int]: ...
    @property
    def changes(self) -> Sequence[ParameterChange]: ...
    @property
    def failed(self) -> bool: ...

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """The recorded ticks from ``first`` up to, without, ``last``, and their rows."""

    def keyframe(self, tick: int) -> Snapshot:
        """What the graph remembered before ``tick``, one of ``keyframes``. Raises ``KeyError``."""


@dataclass(frozen=True)
class KeptRun:
    """A run in memory."""

    graph: CheckedGraph
    bus: Layout
    state: Layout
    ticks: NDArray[np.int64]
    all_rows: NDArray[np.uint8]
    snapshots: dict[int, Snapshot]
    changes: tuple[ParameterChange, ...] = ()
    failed: bool = False

    @classmethod
    def of(cls, result: RunResult, keyframes: Keyframes) -> KeptRun:
        """The run that gave ``result``, with the keyframes that one of its sinks has taken."""
        assert result.graph is not None and result.log is not None
        assert result.log.layout is not None and keyframes.layout is not None
        return cls(
            result.graph, result.log.layout, keyframes.layout,
            np.array(result.log.ticks, np.int64), result.log.rows(), keyframes.snapshots,
            result.parameter_changes,
            result.error is not None and result.error.tick not in result.log.ticks[-1:],
        )  # fmt: skip

    @property
    def keyframes(self) -> Sequence[int]:
        """Ticks before which everything was kept."""
        return tuple(self.snapshots)

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """The ticks from ``first`` up to ``last``, and their rows."""
        start, end = bisect_left(self.ticks, first), bisect_left(self.ticks, last)
        return self.ticks[start:end], self.all_rows[start:end]

    def keyframe(self, tick: int) -> Snapshot:
        """What the graph remembered before ``tick``. Raises ``KeyError``."""
        return self.snapshots[tick]


class Keyframes:
    """A sink that takes a snapshot before every tick that ``every`` divides, except the first."""

    def __init__(self, every: int) -> None:
        self.every = every
        self.snapshots: dict[int, Snapshot] = {}
        self.layout: Layout | None = None

    def open(self, bound: BoundGraph) -> None:
        """Forget the snapshots of an earlier run."""
        self._bound = bound
        self.layout = bound.memory.state.layout
        self.snapshots = {}

    def record(self, tick: int) -> None:
        """Take a snapshot, if the next tick is to have one."""
        if (tick + 1) % self.every == 0:
            taken = self._bound.snapshot()
            self.snapshots[tick + 1] = Snapshot(tick + 1, taken.bus, taken.state)

    def close(self) -> None:
        """Nothing to do."""


def nearest_keyframe(recorded: Replayable, tick: int) -> int | None:
    """The last keyframe at or before ``tick``; ``None`` where there is none but the beginning."""
    place = bisect_right(recorded.keyframes, tick)
    return recorded.keyframes[place - 1] if place else None


class RowCursor:
    """Gives rows one after the other, and reads them from the recording in pieces."""

    PIECE = 512
    """Ticks read at once."""

    def __init__(self, recorded: Replayable) -> None:
        self._recorded = recorded
        self._ticks: NDArray[np.int64] = np.zeros(0, np.int64)
        self._rows: NDArray[np.uint8] = np.zeros((0, 0), np.uint8)
        self._first = self._until = -1

    def at(self, tick: int) -> NDArray[np.uint8] | None:
        """The row of ``tick``; ``None`` where it was not recorded."""
        if not self._first <= tick < self._until:
            self._first, self._until = tick, tick + self.PIECE
            self._ticks, self._rows = self._recorded.rows(tick, self._until)
        place = bisect_left(self._ticks, tick)
        if place < len(self._ticks) and self._ticks[place] == tick:
            row: NDArray[np.uint8] = self._rows[place]
            return row
        return None
