"""Decides when a tick may begin: at once, at a deadline of wall time, or with the robot's data."""

from __future__ import annotations

import time
from math import ceil
from typing import Protocol

from ..language.block import Block
from ..language.errors import AloftError
from ..language.stages import ClockSpec
from .memory import BoundGraph

SPIN = 200e-6
"""Seconds before a deadline at which sleeping ends and polling begins: longer than waking up
usually takes, and short enough to leave the processor to others most of the time."""


class TimeSource(Protocol):
    """Source of time; tests have one of their own."""

    def now(self) -> int:
        """Nanoseconds since some fixed instant."""

    def sleep(self, seconds: float) -> None:
        """Return after about ``seconds``."""


class WallTime:
    """The system's monotonic time."""

    now = staticmethod(time.perf_counter_ns)
    sleep = staticmethod(time.sleep)


class Pacer(Protocol):
    """Waits for ticks and counts those that came too late."""

    overruns: int
    """Ticks whose deadline had passed before they could begin."""
    skipped_periods: int
    """Periods that were left out to catch up."""
    in_a_row: int
    """The number of overruns since the last tick that was in time."""
    missed_deadline: int
    """The deadline [ns] of the latest overrun; zero where only the robot knows."""

    def wait(self, tick: int) -> int:
        """Wait until ``tick`` may begin. Returns by how many nanoseconds it is late, or zero."""

    def restart(self) -> None:
        """Let the next tick begin at once, after a pause: the time of the pause is not lost time."""


class Paced:
    """Lets ticks begin at absolute deadlines of wall time: it sleeps first, then polls the clock.

    A tick that cannot begin in time is an overrun: it begins at the next deadline, and all later
    ticks are delayed with it. So lost time is never made up by faster ticks, and the phase of the
    deadlines stays.
    """

    def __init__(self, rate: float, source: TimeSource) -> None:
        self.overruns = self.skipped_periods = self.in_a_row = self.missed_deadline = 0
        self._rate = rate
        self._source = source
        self._start: int | None = None
        self._first_tick = self._skipped_before = 0

    def wait(self, tick: int) -> int:
        """Sleep and spin to the tick's deadline."""
        now = self._source.now()
        if self._start is None:
            self._start, self._first_tick = now, tick
            self._skipped_before = self.skipped_periods
            return 0
        deadline = self._deadline(self._start, tick)
        late = now - deadline
        if late > 0:
            self.overruns += 1
            self.in_a_row += 1
            self.missed_deadline = deadline
            self.skipped_periods += ceil(late * 1e-9 * self._rate)
            deadline = self._deadline(self._start, tick)
        else:
            self.in_a_row = 0
            late = 0
        rest = (deadline - self._source.now()) * 1e-9 - SPIN
        if rest > 0.0:
            self._source.sleep(rest)
        while self._source.now() < deadline:
            pass
        return late

    def restart(self) -> None:
        """Count the deadlines from the next tick on."""
        self._start = None

    def _deadline(self, start: int, tick: int) -> int:
        # computed from the count of periods, so that rounding errors do not add up
        periods = tick - self._first_tick + self.skipped_periods - self._skipped_before
        return start + int(periods * 1e9 / self._rate)


class DrivesClock(Protocol):
    """The method of a block that can drive the clock, such as a robot or its simulator."""

    def wait(self) -> int:
        """Wait for the next cycle. Returns how many cycles were missed since the last call."""


class RobotDriven:
    """Begins ticks when the robot is ready: by the graph's only block with a ``wait`` method."""

    def __init__(self, block: Block, rate: float) -> None:
        self.overruns = self.skipped_periods = self.in_a_row = self.missed_deadline = 0
        self.block = block
        self._rate = rate

    def wait(self, tick: int) -> int:
        """Wait for the robot; every missed cycle counts as a period late."""
        driver: DrivesClock = self.block  # type: ignore[assignment]  # made so by driving_block
        missed = driver.wait()
        self.in_a_row = self.in_a_row + 1 if missed else 0
        self.overruns += bool(missed)
        self.skipped_periods += missed
        return int(missed * 1e9 / self._rate)

    def restart(self) -> None:
        """Do nothing: a run that a robot drives is not paused."""


def driving_block(bound: BoundGraph) -> Block:
    """Find the block that drives the clock. Raises ``AloftError`` unless there is exactly one."""
    found = [path for path, block in bound.blocks.items() if hasattr(block, "wait")]
    if len(found) != 1:
        raise AloftError(
            "clock 'robot' needs exactly one block with a wait() method; there is "
            + (", ".join(found) or "none")
        )
    return bound.blocks[found[0]]


def make_pacer(spec: ClockSpec, bound: BoundGraph, source: TimeSource) -> Pacer | None:
    """Make the pacer of a graph; none for a free-running one. Raises ``AloftError``."""
    if spec.kind == "paced":
        return Paced(bound.graph.base_rate, source)
    if spec.kind == "robot":
        return RobotDriven(driving_block(bound), bound.graph.base_rate)
    return None
