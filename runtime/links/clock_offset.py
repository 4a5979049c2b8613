"""Estimates how far the monotonic clock of another machine is ahead, from beacons both ways.

The method is that of NTP. With t1 when a beacon left here, t2 when it arrived there, t3 when one left
there and t4 when that arrived here, the other clock is ahead by ((t2 - t1) + (t3 - t4)) / 2. The
error is at most half of the time on the way, (t4 - t1) - (t3 - t2), whatever share of it each
direction took. Of the last ``KEPT`` estimates the one with the shortest time on the way counts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

KEPT = 20
"""Estimates among which the best is chosen: as clocks drift, older ones are forgotten."""


class ClockOffset:
    """The clock of one other machine. All times are in nanoseconds.

    Attributes:
        offset: how far the other clock is ahead; zero before there is an estimate.
        uncertainty: the largest possible error of ``offset``; -1 before there is an estimate.
    """

    def __init__(self) -> None:
        self.offset = 0
        self.uncertainty = -1
        self._estimates: deque[tuple[int, int]] = deque(maxlen=KEPT)
        self._theirs = self._arrived = 0

    def stamp(self, now: int) -> list[int]:
        """What a beacon that leaves now carries: its time, and the latest beacon that has come."""
        return [now, self._theirs, self._arrived]

    def hear(self, stamp: Sequence[int], now: int) -> None:
        """Take the stamp of a beacon that has arrived now."""
        left_there, left_here, arrived_there = (int(value) for value in stamp)
        self._theirs, self._arrived = left_there, now
        if not left_here:
            return
        on_the_way = (now - left_here) - (left_there - arrived_there)
        if on_the_way < 0:
            return  # the clock of a machine that was started again
        ahead = ((arrived_there - left_here) + (left_there - now)) // 2
        self._estimates.append((on_the_way, ahead))
        shortest, self.offset = min(self._estimates)
        self.uncertainty = shortest // 2
