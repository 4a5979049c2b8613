"""The controller of a recorded jump without its robot: every tick it gets the recorded sensors."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.compiling.compile_calls import compile_calls
from ....runtime.graph import load
from ....runtime.language.block import Block
from ....runtime.language.stages import CheckedGraph, ClockSpec
from ....runtime.loading.reading.files import FOLDER
from ....runtime.running.executor import Executor
from ....runtime.running.memory import BoundGraph
from ....runtime.running.pacing import WallTime
from ....runtime.running.sinks import MemoryLog
from ....runtime.running.ticker import Ticker

GRAPH = FOLDER / "jump.yaml"
OUTSIDE = ("robot", "push", "score")
"""Blocks that are no part of the controller: the simulated robot, and those that push and judge it.
"""


@dataclass(frozen=True)
class RecordedJump:
    """A jump in the standard trial: the graph, and the bus of every tick, (ticks, bytes)."""

    graph: CheckedGraph
    rows: NDArray[np.uint8]

    @property
    def ticks(self) -> int:
        """The number of recorded ticks."""
        return len(self.rows)


def record_jump(ticks: int | None = None) -> RecordedJump:
    """Run the jump of ``graphs/jump.yaml``, to its end or for a number of ticks.

    Raises:
        RunError: the run failed.
    """
    graph = load(GRAPH).checked
    result = Executor(graph, run_hash=False).run(ticks)
    result.raise_if_failed()
    assert result.log is not None
    return RecordedJump(graph, result.log.rows())


class RecordedController:
    """The blocks of the controller, which run the recorded ticks again, one after the other.

    Before every tick the recorded outputs of the blocks in ``OUTSIDE`` are copied to the bus; the
    time of that is not counted. A controller that computes what the recorded one did also has the
    same bus after every tick.

    Args:
        jump: the recorded jump.
        plain: whether kernels run as plain Python.
        fuse: whether blocks of kernels that follow each other are one call.
        timing: whether every block is timed, as in a usual run.
        checks: whether values that are not finite end the run, as in a usual run.
        record: whether every tick is kept in memory.
        instead: block types to use in the place of others, by the path of the block.

    Attributes:
        times: the microseconds of every tick that was run.
    """

    def __init__(
        self,
        jump: RecordedJump,
        *,
        plain: bool = False,
        fuse: bool = True,
        timing: bool = True,
        checks: bool = True,
        record: bool = True,
        instead: Mapping[str, type[Block]] | None = None,
    ) -> None:
        self._jump = jump
        kinds = dict(instead or {})
        blocks = tuple(
            replace(spec, block_type=kinds.get(spec.path, spec.block_type))
            for spec in jump.graph.blocks
        )
        order = tuple(path for path in jump.graph.order if path not in OUTSIDE)
        self.bound = BoundGraph(replace(jump.graph, blocks=blocks, order=order, ticks=None))
        refused = "" if plain else compile_calls(self.bound.kernel_calls)
        if refused:
            raise AssertionError(f"the kernels are not compiled: {refused}")
        self.ticker = Ticker(
            self.bound, ClockSpec(), WallTime(), timing=timing, finite_check=checks
        )
        if fuse and not plain:
            self.ticker.fuse()
        for path in order:
            self.bound.blocks[path].start()
        if record:
            log = MemoryLog()
            log.expect(jump.ticks)
            log.open(self.bound)
            self._log = log
            self.ticker.records.append(log.record)
        self._pieces = _outputs_of(self.bound, OUTSIDE)
        self._first = self.bound.snapshot()
        self.times: list[float] = []

    @property
    def tick(self) -> int:
        """The number of ticks run since the beginning of the jump."""
        return self.bound.clock.tick

    def again(self) -> None:
        """Go back to the beginning of the jump."""
        self.bound.restore(self._first)
        if "_log" in vars(self):
            self._log.open(self.bound)

    def show(self, tick: int) -> None:
        """Copy the recorded outputs of the outside blocks to the bus."""
        row, bus = self._jump.rows[tick], self.bound.memory.bus.buffer
        for first, last in self._pieces:
            bus[first:last] = row[first:last]

    def run(self, ticks: int, after: Callable[[int], object] | None = None) -> None:
        """Run the next ticks of the jump, as far as there are any; ``after`` is called after each
        and is not timed."""
        advance, now = self.ticker.advance, time.perf_counter_ns
        for tick in range(self.tick, min(self.tick + ticks, self._jump.ticks)):
            self.show(tick)
            start = now()
            advance(1)
            self.times.append((now() - start) * 1e-3)
            self.bound.clock.stop_reason = None
            if after is not None:
                after(tick)

    def check(self) -> None:
        """Raise ``AssertionError`` unless the bus is the recorded one, to the last bit."""
        recorded = self._jump.rows[self.tick - 1]
        layout = self.bound.memory.bus.layout
        for name in layout.slots:
            first, last = layout.byte_range(name)
            if self.bound.memory.bus.buffer[first:last].tobytes() != recorded[first:last].tobytes():
                raise AssertionError(
                    f"{name} differs from the recorded jump in tick {self.tick - 1}"
                )


class HandWrittenLoop(RecordedController):
    """The same bodies, called one after the other by a loop that does nothing else."""

    def __init__(self, jump: RecordedJump) -> None:
        super().__init__(jump, fuse=False, timing=False, checks=False, record=False)
        (program,) = self.ticker.programs
        self._bodies = program.calls

    def run(self, ticks: int, after: Callable[[int], object] | None = None) -> None:
        """Run the next ticks."""
        bodies, clock, now = self._bodies, self.bound.clock, time.perf_counter_ns
        for tick in range(clock.tick, min(clock.tick + ticks, self._jump.ticks)):
            self.show(tick)
            start = now()
            for body in bodies:
                body()
            clock.tick = tick + 1
            self.times.append((now() - start) * 1e-3)
            clock.stop_reason = None


def _outputs_of(bound: BoundGraph, paths: tuple[str, ...]) -> list[tuple[int, int]]:
    """Return the bytes of the bus that hold the outputs of those blocks, in as few pieces as
    possible."""
    layout: Any = bound.memory.bus.layout
    ranges = sorted(
        layout.byte_range(name)
        for name in layout.slots
        if name.rpartition(".")[0].rpartition(".")[0] in paths
    )
    pieces: list[tuple[int, int]] = []
    for first, last in ranges:
        if pieces and pieces[-1][1] == first:
            pieces[-1] = (pieces[-1][0], last)
        else:
            pieces.append((first, last))
    return pieces
