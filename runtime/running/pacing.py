"""Decides when a tick may begin: at once, at a deadline of wall time, or with the robot's data.

A tick is late if it begins more than a share of the period after its deadline, whatever delayed it:
work of the tick before, or the system, which woke the control thread late.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import ceil
from typing import Protocol

from ..language.block import Block
from ..language.errors import AloftError
from ..language.stages import ClockSpec
from .lateness import LatenessCounter
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
    """Waits for ticks and counts those that began too late."""

    lateness: LatenessCounter
    """The lateness of ticks; the late ones are the overruns."""
    skipped_periods: int
    """Periods that were left out to catch up."""
    in_a_row: int
    """The number of late ticks since the last one that was in time."""
    missed_deadline: int
    """The deadline [ns] of the last tick, if it passed before the tick's turn came; zero if it did
    not, and where only the robot knows."""

    def wait(self, tick: int) -> int:
        """Wait until ``tick`` may begin.

        Returns how many nanoseconds after its deadline it begins if that is too late, or zero.
        """

    def restart(self) -> None:
        """Let the next tick begin at once, after a pause: the time of the pause is not lost time."""


class Paced:
    """Lets ticks begin at absolute deadlines of wall time: it sleeps first, then polls the clock.

    A tick whose turn comes after its deadline begins at the next deadline, and all later ticks are
    delayed with it. So lost time is never made up by faster ticks, and the phase of the deadlines
    stays.

    Args:
        rate: ticks per second.
        source: the clock.
        late_after: the share of a period after which a tick is late.
    """

    def __init__(self, rate: float, source: TimeSource, late_after: float) -> None:
        self.skipped_periods = self.in_a_row = self.missed_deadline = 0
        self.lateness = LatenessCounter(round(late_after * 1e9 / rate))
        self._rate = self._full_rate = rate
        self._source = source
        self._start: int | None = None
        self._first_tick = self._skipped_before = 0

    def wait(self, tick: int) -> int:
        """Sleep and spin to the tick's deadline."""
        read = self._source.now
        now = read()
        if self._start is None:
            self._start, self._first_tick = now, tick
            self._skipped_before = self.skipped_periods
            return 0
        due = deadline = self._deadline(self._start, tick)
        self.missed_deadline = 0
        if now > due:
            self.missed_deadline = due
            self.skipped_periods += ceil((now - due) * 1e-9 * self._rate)
            deadline = self._deadline(self._start, tick)
        rest = (deadline - now) * 1e-9 - SPIN
        if rest > 0.0:
            self._source.sleep(rest)
            now = read()
        while now < deadline:
            now = read()
        # the clock that ended the wait: it says when the tick begins, and whether that is late
        if self.lateness.add(now - due):
            self.in_a_row += 1
            return now - due
        self.in_a_row = 0
        return 0

    def restart(self) -> None:
        """Count the deadlines from the next tick on."""
        self._start = None

    def play(self, share: float) -> None:
        """Let a simulation's time pass at a share of real time (1: real time) from the next tick on."""
        self._rate = share * self._full_rate
        self.restart()

    def _deadline(self, start: int, tick: int) -> int:
        # computed from the count of periods, so that rounding errors do not add up
        periods = tick - self._first_tick + self.skipped_periods - self._skipped_before
        return start + int(periods * 1e9 / self._rate)


class DrivesClock(Protocol):
    """The method of a block that can drive the clock, such as a robot or its simulator.

    If it has a method ``ready_at``, that returns when the data of the cycle that ``wait`` waited for
    were there, by ``time.perf_counter_ns``, or zero if it does not know; else only whole cycles count
    as late.
    """

    def wait(self) -> int:
        """Wait for the next cycle. Returns how many cycles were missed since the last call."""


class RobotDriven:
    """Begins ticks when the robot is ready: by the graph's only block with a ``wait`` method.

    Args:
        block: the block.
        rate: ticks per second.
        source: the clock.
        late_after: the share of a period after which a tick is late.
    """

    def __init__(self, block: Block, rate: float, source: TimeSource, late_after: float) -> None:
        self.skipped_periods = self.in_a_row = self.missed_deadline = 0
        self.lateness = LatenessCounter(round(late_after * 1e9 / rate))
        self.block = block
        self._rate = rate
        self._source = source
        self._ready_at: Callable[[], int] | None = getattr(block, "ready_at", None)

    def wait(self, tick: int) -> int:
        """Wait for the robot; every missed cycle counts as a period late."""
        driver: DrivesClock = self.block  # type: ignore[assignment]  # made so by driving_block
        missed = driver.wait()
        lateness = int(missed * 1e9 / self._rate)
        ready = self._ready_at() if self._ready_at is not None else 0
        if ready:
            lateness += max(0, self._source.now() - ready)
        self.skipped_periods += missed
        if self.lateness.add(lateness):
            self.in_a_row += 1
            return lateness
        self.in_a_row = 0
        return 0

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
        return Paced(bound.graph.base_rate, source, spec.late_after)
    if spec.kind == "robot":
        return RobotDriven(driving_block(bound), bound.graph.base_rate, source, spec.late_after)
    return None
