"""Executes a recorded run again, as a whole or in part, and compares it with the recording.

There are three kinds of replay. They differ in the blocks that run; the outputs of all other blocks
are fed from the recording:

* all blocks run: a simulation repeats itself from its seed. A background block whose results came
  late in real time does not run: its outputs do not follow from its inputs alone;
* all blocks run except those whose outputs come from outside the graph: the run of a real robot is
  repeated on its recorded sensor readings;
* only some changed blocks run. This shows what they would have done in the recorded situation; their
  outputs do not act on the recorded run.

Nothing outside is touched in any of them: blocks whose outputs come from the real world, and those that act on it
(``Block.acts_outside``), never run.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.errors import AloftError
from ...runtime.language.layout import Layout
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.language.registry import block_name
from ...runtime.language.stages import BlockSpec, CheckedGraph, ClockSpec
from ...runtime.loading.checking.parameters import adjust
from ...runtime.running.differences import Difference, RowComparison, Translation
from ...runtime.running.executor import Executor
from ...runtime.running.memory import BoundGraph
from ...runtime.running.playback import Playback, PlaybackBlock, playback_graph
from ...runtime.running.run_result import RunResult
from ...runtime.running.sink import Note, Sink
from ...runtime.running.snapshot import Snapshot


class Replayable(Protocol):
    """A run that was kept in memory or in a recording.

    Attributes:
        graph: the graph that ran.
        bus, state: the layouts of the rows and of the keyframes' state.
        ticks: all ticks that have rows, increasing.
        keyframes: ticks before which everything the graph remembers was kept, increasing.
        changes: parameters changed while it ran, in order.
        failed: whether a block failed in the tick after the last row.
        late: the background blocks of which a result was late.
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
    @property
    def late(self) -> Sequence[str]: ...

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return the recorded ticks from ``first`` up to, without, ``last``, and their rows."""

    def keyframe(self, tick: int) -> Snapshot:
        """Return the graph's memory before ``tick``, one of ``keyframes``. Raises ``KeyError``."""


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
    late: Sequence[str] = ()

    @classmethod
    def of(cls, result: RunResult, keyframes: Keyframes) -> KeptRun:
        """Return the run that gave ``result``, with the keyframes that one of its sinks has taken."""
        assert result.graph is not None and result.log is not None
        assert result.log.layout is not None and keyframes.layout is not None
        return cls(
            result.graph, result.log.layout, keyframes.layout,
            np.array(result.log.ticks, np.int64), result.log.rows(), keyframes.snapshots,
            result.parameter_changes,
            result.error is not None and result.error.tick not in result.log.ticks[-1:],
            late_blocks(result.log.notes),
        )  # fmt: skip

    @property
    def keyframes(self) -> Sequence[int]:
        """Ticks before which everything was kept."""
        return tuple(self.snapshots)

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return the ticks from ``first`` up to ``last``, and their rows."""
        start, end = bisect_left(self.ticks, first), bisect_left(self.ticks, last)
        return self.ticks[start:end], self.all_rows[start:end]

    def keyframe(self, tick: int) -> Snapshot:
        """Return the graph's memory before ``tick``. Raises ``KeyError``."""
        return self.snapshots[tick]


class Keyframes(Sink):
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


def late_blocks(notes: Iterable[Note]) -> tuple[str, ...]:
    """Return the background blocks of which a result was late, by the notes of a run."""
    return tuple(dict.fromkeys(str(note.data["block"]) for note in notes if note.kind == "late"))


def nearest_keyframe(recorded: Replayable, tick: int) -> int | None:
    """Return the last keyframe at or before ``tick``; ``None`` where there is none but the
    beginning."""
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
        """Return the row of ``tick``; ``None`` where it was not recorded."""
        if not self._first <= tick < self._until:
            self._first, self._until = tick, tick + self.PIECE
            self._ticks, self._rows = self._recorded.rows(tick, self._until)
        place = bisect_left(self._ticks, tick)
        if place < len(self._ticks) and self._ticks[place] == tick:
            row: NDArray[np.uint8] = self._rows[place]
            return row
        return None


Inputs = Literal["seed", "recorded"]
BeforeTick = Callable[[BoundGraph, int], None]
PIECE = 256
"""Ticks compared at once."""


class ReplayError(AloftError):
    """Raised if a recording cannot be replayed as requested."""


@dataclass(frozen=True)
class Replayed:
    """The result of a replay.

    Attributes:
        result: the result of the run.
        signals: the fields of the blocks that ran, compared tick by tick.
        states: what these remember, compared at every keyframe.
        first_tick: the tick with which the replay began.
        ran: the blocks that ran; all others were fed.
        notes: what could not be compared, and why.
        ticks, rows: of the replay, where they were to be kept; in ``bus``'s layout.
    """

    result: RunResult
    bound: BoundGraph
    signals: RowComparison
    states: RowComparison
    first_tick: int
    ran: tuple[str, ...]
    notes: tuple[str, ...] = ()
    ticks: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    rows: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))

    @property
    def first(self) -> Difference | None:
        """The first difference. Within one tick, the state at its beginning comes before its signals."""
        found = [d for d in (self.states.first, self.signals.first) if d is not None]
        return min(found, key=lambda d: d.tick) if found else None

    @property
    def identical(self) -> bool:
        """True if every byte that was compared is the same, and nothing was left out."""
        return self.first is None and not self.notes


def replay(
    recorded: Replayable,
    *,
    graph: CheckedGraph | None = None,
    inputs: Inputs | None = None,
    run: Sequence[str] | None = None,
    first_tick: int | None = None,
    snapshot: Snapshot | None = None,
    last_tick: int | None = None,
    beyond: int | None = None,
    keep: bool = False,
    before_tick: BeforeTick | None = None,
    sinks: Sequence[Sink] = (),
) -> Replayed:
    """Execute a recorded run again.

    Args:
        recorded: the run.
        graph: what to run; by default what ran. Another one has other blocks or parameters.
        inputs: ``seed``: every block runs; ``recorded``: those whose outputs come from outside
            are fed; by default the former if a simulator is all there is outside.
        run: run only these blocks, and feed all others.
        first_tick: begin at the last keyframe at or before it; by default at the beginning.
        snapshot: begin with it, at its tick, instead.
        last_tick: end before it; by default with the recording.
        beyond: run on without the recording and end before this tick, if it comes later.
        keep: whether to keep the replayed rows.
        before_tick: called with the graph before every tick, and once after the last.
        sinks: further sinks of the run.

    Raises:
        ReplayError: there is no such block or no such tick, ticks are missing, or a block is to run that acts
            outside.
        RunError: a block could not be set up.
    """
    graph = graph or recorded.graph
    if not len(recorded.ticks):
        raise ReplayError("the recording holds no tick")
    fed = _fed(graph, inputs or default_inputs(graph), run, recorded.late)
    if snapshot is None:
        snapshot = _beginning(recorded, first_tick)
    start = snapshot.tick if snapshot else 0
    end = int(recorded.ticks[-1]) + 1
    if last_tick is not None:
        end = min(end, last_tick)
    elif recorded.failed and not fed:
        end += 1  # into the tick that failed
    compared = end
    end = max(end, beyond or 0)
    if end <= start:
        raise ReplayError(f"no tick from {start} up to {end} is in the recording")
    _expect_no_gap(recorded, fed, start, end)
    bound = BoundGraph(playback_graph(graph, fed))
    bound.clock.tick = start
    follower = Follower(recorded, bound, snapshot, keep, before_tick)
    result = Executor(
        bound, clock=ClockSpec("free"), sinks=[follower, *sinks], log=False,
        on_ready=follower.ready,
    ).run(end - start)  # fmt: skip
    notes = list(follower.notes)
    if compared - start - follower.seen > recorded.failed:
        notes.append(f"it ended after {follower.seen} of {compared - start} ticks: {result.reason}")
    return Replayed(
        result, bound, follower.signals, follower.states, start, follower.ran, tuple(notes),
        *follower.kept(),
    )  # fmt: skip


def default_inputs(graph: CheckedGraph) -> Inputs:
    """Return ``seed`` if the run can be repeated from its seed, ``recorded`` otherwise."""
    real = any(spec.block_type.outside == "real" for spec in graph.blocks)
    return "recorded" if real else "seed"


def _fed(
    graph: CheckedGraph, inputs: Inputs, run: Sequence[str] | None, late: Sequence[str]
) -> list[str]:
    """Return the blocks that do not run."""
    paths = [spec.path for spec in graph.blocks]
    if run is not None:
        for path in run:
            if path not in paths:
                raise ReplayError(f"there is no block {path!r}; there is {', '.join(paths)}")
        for path in run:
            if is_outside(graph.block(path)):
                raise ReplayError(
                    f"{path} ({block_name(graph.block(path).block_type)}) acts outside of the graph, and a "
                    "replay touches nothing there; replay another block"
                )
        return [path for path in paths if path not in run]
    recorded = inputs == "recorded"
    return [
        spec.path
        for spec in graph.blocks
        if spec.path in late or is_outside(spec) or (recorded and spec.block_type.outside != "no")
    ]


def is_outside(spec: BlockSpec) -> bool:
    """Return whether a block reaches beyond the run: robots, pads, networks, other processes."""
    return spec.block_type.outside == "real" or spec.block_type.acts_outside


def _beginning(recorded: Replayable, first_tick: int | None) -> Snapshot | None:
    """Return the keyframe to begin with; ``None`` where the run begins as it did."""
    first, last = int(recorded.ticks[0]), int(recorded.ticks[-1])
    start = first
    if first_tick is not None:
        if not first <= first_tick <= last:
            raise ReplayError(
                f"tick {first_tick} is not in the recording, which has {first} to {last}"
            )
        nearest = nearest_keyframe(recorded, first_tick)
        start = first if nearest is None else nearest
    if start == 0:
        return None
    if start not in recorded.keyframes:
        raise ReplayError(
            f"the recording begins at tick {start}, and holds nothing of what the graph "
            "remembered there; begin at a keyframe with --from: "
            + (", ".join(map(str, recorded.keyframes)) or "there is none")
        )
    return recorded.keyframe(start)


def _expect_no_gap(recorded: Replayable, fed: Sequence[str], start: int, end: int) -> None:
    """Raise if blocks are to be fed and some tick was not recorded."""
    ticks = recorded.ticks
    if int(ticks[0]) == start == 0 and len(ticks) == ticks[-1] + 1:
        return
    inside = ticks[(ticks >= start) & (ticks < end)]
    gaps = np.flatnonzero(np.diff(inside) > 1)
    if fed and len(gaps):
        before, after = inside[gaps[0]], inside[gaps[0] + 1]
        raise ReplayError(
            f"ticks {before + 1} to {after - 1} were not recorded, so blocks cannot be fed from "
            f"the recording there; begin after them with --from-tick {after}"
        )


class Follower(Sink):
    """A sink that feeds the blocks that do not run, applies recorded changes of parameters, and compares."""

    def __init__(
        self, recorded: Replayable, bound: BoundGraph, beginning: Snapshot | None, keep: bool,
        before_tick: BeforeTick | None = None,
    ) -> None:  # fmt: skip
        self._recorded, self._bound = recorded, bound
        self._beginning, self._keep, self._before_tick = beginning, keep, before_tick
        memory, order = bound.memory, bound.graph.order
        try:
            self._feed = Playback(bound, recorded.bus)
        except KeyError as name:
            raise ReplayError(
                f"{name.args[0]} is not in the recording, so its block cannot be fed from it"
            ) from None
        self.ran = tuple(path for path in bound.blocks if path not in self._feed.paths)
        self._bus = Translation(recorded.bus, memory.bus.layout)
        self._state = Translation(recorded.state, memory.state.layout)
        if beginning is not None:
            self._expect_state(beginning.tick)
        ran = dict.fromkeys(self.ran)
        # a recording without keyframes says nothing of state
        states = self._state.notes if recorded.keyframes else []
        self.notes = [note for note in (*self._bus.notes, *states) if _block(note) in ran]
        whole = self._bus.identical and not self._feed.paths
        names = [name for name in self._bus.names if _block(name) in ran]
        self.signals = RowComparison(memory.bus.layout, order, None if whole else names)
        self.states = RowComparison(memory.state.layout, order, self._state.names, "state")
        self._rows = np.zeros((PIECE, memory.bus.layout.size), np.uint8)
        self._expected = np.zeros((PIECE, recorded.bus.size), np.uint8)
        self._ticks = np.zeros(PIECE, np.int64)
        self._used = self.seen = 0
        self._cursor = RowCursor(recorded)
        self._keyframes = dict.fromkeys(recorded.keyframes)
        self._changes = list(recorded.changes)
        self._kept: list[tuple[NDArray[np.int64], NDArray[np.uint8]]] = []

    def _expect_state(self, tick: int) -> None:
        """Raise if the keyframe before a tick lacks some of this graph's state."""
        for note in self._state.notes:
            if not note.endswith(" is in the recording only"):
                raise ReplayError(
                    f"what the keyframe at tick {tick} holds does not fit this graph: state "
                    f"{note}; replay from the beginning"
                )

    def ready(self) -> None:
        """Restore the keyframe it begins with, and prepare the first tick."""
        first = 0  # at the beginning blocks are as they start
        if self._beginning is not None:
            first = self._beginning.tick
            self._change_parameters(first)  # before: runs under way had those of their ticks
            self._restore(self._beginning)
        self._prepare(first)

    def record(self, tick: int) -> None:
        """Keep the tick for comparison, and prepare the next one."""
        self.seen += 1
        row = self._cursor.at(tick)
        if row is not None:
            self._expected[self._used] = row
            self._rows[self._used] = self._bound.memory.bus.buffer
            self._ticks[self._used] = tick
            self._used += 1
            if self._used == PIECE:
                self._compare()
        elif self._keep and tick > self._recorded.ticks[-1]:
            self._compare()
            row = self._bound.memory.bus.buffer
            self._kept.append((np.array([tick], np.int64), row[None].copy()))
        if tick + 1 in self._keyframes:
            self._compare_state(tick + 1)
        self._prepare(tick + 1)

    def close(self) -> None:
        """Compare the rest."""
        self._compare()

    def kept(self) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return the replayed ticks and rows, none if they were not to be kept."""
        if not self._kept:
            return np.zeros(0, np.int64), np.zeros((0, self._rows.shape[1]), np.uint8)
        ticks, rows = zip(*self._kept, strict=True)
        return np.concatenate(ticks), np.concatenate(rows)

    def _change_parameters(self, tick: int) -> None:
        """Make the recorded changes up to a tick, each in its own."""
        clock, parameters = self._bound.clock, self._bound.parameters
        present = clock.tick
        while self._changes and self._changes[0].tick <= tick:
            change = self._changes.pop(0)
            block = self._bound.blocks.get(change.path.partition(".")[0])
            if block is not None and not isinstance(block, PlaybackBlock):
                clock.tick = change.tick
                adjustment = adjust(self._bound.blocks, {change.path: change.new})
                parameters.apply(adjustment, change.tick)
        clock.tick = present

    def _prepare(self, tick: int) -> None:
        self._change_parameters(tick)
        if self._feed.paths:
            row = self._cursor.at(tick)
            if row is not None:
                self._feed.show(row)
        if self._before_tick is not None:
            self._before_tick(self._bound, tick)

    def _restore(self, keyframe: Snapshot) -> None:
        """Restore bus and state of a keyframe, as far as this graph has the same."""
        memory = self._bound.memory
        bus = np.frombuffer(keyframe.bus, np.uint8)
        state = np.frombuffer(keyframe.state, np.uint8)
        for translation, region, data in (
            (self._bus, memory.bus, bus), (self._state, memory.state, state),
        ):  # fmt: skip
            translation.write(data, region.buffer)
        self._bound.clock.tick = keyframe.tick
        for block in self._bound.blocks.values():
            block.load_state()

    def _compare(self) -> None:
        if not self._used:
            return
        ticks, rows = self._ticks[: self._used], self._rows[: self._used]
        self.signals.add(ticks, self._bus.rows(self._expected[: self._used]), rows)
        if self._keep:
            self._kept.append((ticks.copy(), rows.copy()))
        self._used = 0

    def _compare_state(self, tick: int) -> None:
        was = np.frombuffer(self._recorded.keyframe(tick).state, np.uint8)[None]
        now = np.frombuffer(self._bound.snapshot().state, np.uint8)[None]
        self.states.add(np.array([tick]), self._state.rows(was), now)


def _block(name: str) -> str:
    """Return the block's path in ``block.port.field``, also at the start of a note."""
    return name.split(" ", 1)[0].rpartition(".")[0].rpartition(".")[0]
