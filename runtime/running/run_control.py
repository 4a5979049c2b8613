"""Pauses a simulated run, takes it back to a snapshot that was kept, and lets it go on from there.

While the run goes on its whole memory is copied at a regular interval into a block of memory that
is made before the first tick and holds some dozens of copies; the newest replaces the oldest.
Commands come from other threads by the slot that changes of parameters use, so a run that nobody
pauses pays for the copies only, and computes the same bytes.

A snapshot has everything that the run depends on: signals, states, parameters and the run hash so far. A run
that goes on from one unchanged is the uninterrupted one to the byte. Snapshots of later ticks are forgotten when
the run goes back: there is one course of events, the one that the result and the run hash tell of.
"""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.errors import AloftError
from ..language.parameters import Parameters
from ..language.registry import block_name
from .failures import describe
from .memory import BoundGraph
from .pacing import Paced
from .sink import Note, Sink
from .sinks import RunHash
from .snapshot import Snapshot
from .ticker import Ticker

INTERVAL = 0.5
"""The graph's time between two snapshots [s]."""
MOST_SNAPSHOTS = 240
"""Snapshots that are kept at most, beside the one of the start."""
MOST_MEMORY = 1 << 26
"""Bytes of all snapshots at most; two are kept whatever they take."""
NOT_STARTED = "the run has not started yet"
POLL = 0.01
"""Seconds between two looks for a command while a run is paused."""
PERCENT = (1, 1000)
"""Limits of a playback rate [% of real time]."""


@dataclass(frozen=True)
class _Kept:
    """Data of one snapshot beside its bytes in row ``row`` of the memory."""

    tick: int
    row: int
    hashes: tuple[RunHash, ...]
    params: Mapping[str, Parameters]
    changes: int


class RunControl(Sink):
    """Pauses one run and goes back in it; give it to the run as a sink, the last that keeps ticks.

    Args:
        paused: whether the run begins paused, and waits at its end instead of stopping.
        interval: the graph's time between two snapshots [s].
        most: how many are kept at most, beside the one of the start.

    Attributes:
        refusal: why this run cannot be paused; empty where it can be.
        on_change: called by the control thread when the run pauses, goes back or goes on.
    """

    def __init__(
        self, *, paused: bool = False, interval: float = INTERVAL, most: int = MOST_SNAPSHOTS
    ) -> None:
        self.refusal = NOT_STARTED
        self.on_change: Callable[[], None] = lambda: None
        self._waits_at_end = self._begins_paused = paused
        self._interval, self._most = interval, most
        self._kept: list[_Kept] = []
        self._next: int | None = None
        self._end: int | None = None
        self._until: int | None = None
        self._finished = self._closed = False
        self._reason: str | None = None
        self._no_more = ""
        self._percent = 100

    def open(self, bound: BoundGraph) -> None:
        """Find out whether the run can be paused.

        Raises:
            AloftError: it cannot be, and was to begin paused.
        """
        self._bound = bound
        self.refusal = refusal_of(bound) or NOT_STARTED
        if self.refusal != NOT_STARTED and self._begins_paused:
            raise AloftError(self.refusal)

    def watch_ticker(self, ticker: Ticker) -> None:
        """Take what runs the ticks, and make the memory for the snapshots."""
        self._ticker = ticker
        if self.refusal != NOT_STARTED:
            return
        ticker.control = self
        memory = self._bound.memory
        size = memory.bus.buffer.size + memory.state.buffer.size
        most = max(2, min(self._most, MOST_MEMORY // max(1, size)))
        self._rows: NDArray[np.uint8] = np.empty((most + 1, size), np.uint8)
        self._free = list(range(most, -1, -1))
        self._every = max(1, round(self._interval * self._bound.graph.base_rate))
        self._note_change(None)
        self._bound.parameters.listeners.append(self._note_change)

    def _note_change(self, _: object) -> None:
        """Take the parameters anew; snapshots share them, as they seldom change."""
        blocks = self._bound.blocks
        self._params: Mapping[str, Parameters] = {path: blocks[path].params for path in blocks}

    @property
    def paused(self) -> bool:
        """True if the run stands still because a user has paused it."""
        return not self.refusal and self._ticker.paused

    # What the control thread calls.

    def begin(self, ticks: int | None, interrupted: Callable[[], bool]) -> None:
        """Keep the snapshot of the start, once all blocks have started.

        Args:
            ticks: how many ticks there are to run; ``None``: until something ends the run.
            interrupted: whether a signal has ended the run.
        """
        clock = self._bound.clock
        self._end = None if ticks is None else clock.tick + ticks
        self._interrupted = interrupted
        self._ticker.paused = self._begins_paused
        self._keep(clock.tick)
        self.refusal = ""

    def record(self, tick: int) -> None:
        """Keep a snapshot if it is time for one."""
        if tick + 1 == self._next:
            self._keep(tick + 1)

    def close(self) -> None:
        """Take no more commands."""
        self._closed = True

    def may_go_on(self) -> bool:
        """Hold the run as long as it is paused. Returns whether there are ticks to run."""
        clock, ticker = self._bound.clock, self._ticker
        while True:
            if self._finished or self._interrupted():
                return False
            if clock.tick == self._until:
                self._until, ticker.paused = None, True
            if self._is_over and self._waits_at_end:
                ticker.paused = True
            if not ticker.paused:
                return not self._is_over
            self._hold()

    @property
    def ticks(self) -> int | None:
        """Number of ticks to run next; ``None``: until something ends the run."""
        ends = [end for end in (self._end, self._until) if end is not None]
        return min(ends) - self._bound.clock.tick if ends else None

    @property
    def _is_over(self) -> bool:
        clock = self._bound.clock
        return clock.stop_reason is not None or clock.tick == self._end

    def _hold(self) -> None:
        """Answer commands until the run goes on, or something ends it."""
        bound, ticker = self._bound, self._ticker
        clock, parameters = bound.clock, bound.parameters
        self._reason = clock.stop_reason
        self._keep(clock.tick)
        ticker.tell(Note(clock.tick, "life", "paused"))
        self.on_change()
        while ticker.paused and not self._interrupted():
            if clock.stop_reason is not self._reason:  # somebody ends the run
                self._finished = True
                break
            if parameters.requests:
                parameters.answer(clock.tick)
                ticker.refresh_chains()
                self.on_change()
            else:
                time.sleep(POLL)
        ticker.paused = False
        self.on_change()
        if self._finished or self._interrupted():
            return
        if ticker.pacer is not None:
            ticker.pacer.restart()
        for sink in ticker.sinks:
            sink.resume(clock.tick)
        ticker.tell(Note(clock.tick, "life", "goes on"))

    def _keep(self, tick: int) -> None:
        """Copy the whole memory before ``tick``."""
        self._next = tick - tick % self._every + self._every
        if self._no_more or (self._kept and self._kept[-1].tick == tick):
            return
        bound = self._bound
        try:
            for block in bound.blocks.values():
                block.save_state()
        except Exception as error:  # noqa: BLE001  # the run goes on without snapshots
            self._no_more, self._next = f"saving a state failed: {describe(error)}", None
            return
        row = self._free.pop() if self._free else self._kept.pop(1).row  # the start stays
        bus, state = bound.memory.bus.buffer, bound.memory.state.buffer
        self._rows[row, : bus.size] = bus
        self._rows[row, bus.size :] = state
        hashes = tuple(s.kept() for s in self._ticker.sinks if isinstance(s, RunHash))
        changes = len(bound.parameters.changes)
        self._kept.append(_Kept(tick, row, hashes, self._params, changes))

    # What other threads call.

    def pause(self) -> None:
        """Pause before the next tick; a run that is paused stays so. Raises ``AloftError``."""
        self._submit(self._pause)

    def go_on(self, ticks: int | None = None) -> None:
        """Let the run go on; where it waits at its end, let it end.

        Args:
            ticks: after how many ticks it pauses again; ``None``: not of itself.

        Raises:
            AloftError: the run cannot be paused or is not, or ``ticks`` is below 1.
        """
        if ticks is not None and ticks < 1:
            raise AloftError(f"a run goes on for at least 1 tick, not {ticks}")
        self._submit(lambda: self._go_on(ticks))

    def play(self, percent: int) -> None:
        """Set the playback rate of a run in paced time.

        Args:
            percent: of real time, 1 to 1000.

        Raises:
            AloftError: the run cannot be paused, runs as fast as it can, or ``percent`` is out of range.
        """
        least, most = PERCENT
        if not least <= percent <= most:
            raise AloftError(f"a playback rate is {least} to {most} % of real time, not {percent}")
        if not self.refusal and not isinstance(self._ticker.pacer, Paced):
            raise AloftError(
                "this run goes as fast as it can; start it with --set clock.kind=paced for a playback rate"
            )
        self._submit(lambda: self._play(percent))

    def go_back(self, tick: int) -> int:
        """Go back to the last snapshot at or before ``tick``, and stay paused there.

        Parameters have the values of that tick again.

        Returns:
            The tick before which the run stands now.

        Raises:
            AloftError: the run cannot be paused, or no such snapshot is kept.
        """
        self._submit(lambda: self._go_back(tick))
        return self._bound.clock.tick

    def about(self) -> dict[str, Any]:
        """Return the state of the run, as plain data.

        Returns:
            ``paused``; ``tick``, which runs next; ``kept``, the ticks of all snapshots; ``room``, how
            many there can be; ``interval`` between two in ticks; ``over``, why the run is at its end;
            ``problem``, why no more are kept; ``percent``, the playback rate.

        Raises:
            AloftError: the run cannot be paused, or has not started.
        """
        if self.refusal:
            raise AloftError(self.refusal)
        clock = self._bound.clock
        over = "the duration is over" if self._is_over else ""
        return {
            "paused": self.paused,
            "tick": clock.tick,
            "kept": [kept.tick for kept in tuple(self._kept)],
            "room": len(self._rows),
            "interval": self._every,
            "over": clock.stop_reason or over,
            "problem": self._no_more,
            "percent": self._percent,
        }

    def _submit(self, work: Callable[[], None]) -> None:
        if self.refusal or self._closed:
            raise AloftError(self.refusal or "the run has ended")
        self._bound.parameters.command(work)

    def _pause(self) -> None:
        self._ticker.paused = True

    def _play(self, percent: int) -> None:
        pacer = self._ticker.pacer
        assert isinstance(pacer, Paced)
        pacer.play(percent / 100.0)
        self._percent = percent

    def _go_on(self, ticks: int | None) -> None:
        if not self._ticker.paused:
            raise AloftError("the run is not paused")
        self._finished = self._is_over
        tick = self._bound.clock.tick
        self._until = None if ticks is None or self._finished else tick + ticks
        self._ticker.paused = False

    def _go_back(self, tick: int) -> None:
        bound, ticker = self._bound, self._ticker
        place = bisect_right([kept.tick for kept in self._kept], tick)
        if not place:
            raise AloftError(self._nothing_kept(tick))
        kept = self._kept[place - 1]
        ticker.tell(
            Note(
                bound.clock.tick, "life", f"goes back to {ticker.instant(kept.tick)}",
                data={"back_to": kept.tick},
            )
        )  # fmt: skip
        self._free += [later.row for later in self._kept[place:]]
        del self._kept[place:]
        data, bus = self._rows[kept.row].tobytes(), bound.memory.bus.buffer.size
        bound.clock.tick = kept.tick
        bound.parameters.go_back(kept.params, kept.changes)
        self._params = kept.params
        bound.restore(Snapshot(kept.tick, data[:bus], data[bus:]))
        self._next = kept.tick - kept.tick % self._every + self._every
        self._until, self._reason, self._finished = None, None, False
        ticker.paused = True
        hashes = iter(kept.hashes)
        for sink in ticker.sinks:
            if isinstance(sink, RunHash):
                sink.go_on_from(next(hashes))
            else:
                sink.rewind(kept.tick)

    def _nothing_kept(self, tick: int) -> str:
        why = f" ({self._no_more})" if self._no_more else ""
        first = (
            f"; the earliest is of {self._ticker.instant(self._kept[0].tick)}" if self._kept else ""
        )
        return f"no snapshot of tick {tick} or before is kept{first}{why}"


def refusal_of(bound: BoundGraph) -> str:
    """Return the reason why a run cannot be paused; empty where it can be."""
    if bound.machine:
        return (
            f"this run cannot be paused: it is the part on {bound.machine} of a graph on several "
            "machines; run the graph in one process"
        )
    for spec in bound.graph.blocks:
        if spec.block_type.outside == "real":
            return (
                f"this run cannot be paused: {spec.path} ({block_name(spec.block_type)}) meets the real "
                "world, which does not wait; only a simulation can be paused"
            )
    if bound.clock.kind == "robot":
        return (
            "this run cannot be paused: its clock is the robot's; only a run with clock.kind 'free' or "
            "'paced' can be"
        )
    return ""
