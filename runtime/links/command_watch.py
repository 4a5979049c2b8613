"""Watches the links that bring commands to actuators: silence on one of them ends in damping.

It counts when messages arrive, by the clock of this machine alone, so it holds whatever ``late`` is
and whatever the estimate of the other clock is. What it finds is used twice: a driver hands it to
the process that watches it (``hal/bear/watchdog.py``), which damps the drives although this process
may hang, be stopped or be killed; and a part that runs free ends its run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

from ..placement.placed import MachineLink, PlacedGraph, command_sources, silence_limit


class WatchedLink(Protocol):
    """The receiving end of a link, as the watch needs it."""

    link: MachineLink
    received_at: int


class CommandWatch:
    """Measures for how long no commands have come.

    It begins to count at the first query, which is when the actuators are on.

    Args:
        placed: the graph.
        machine: the machine with the actuators.
        receivers: the receiving ends of all its links.
        clock: the monotonic time [ns].
    """

    def __init__(
        self,
        placed: PlacedGraph,
        machine: str,
        receivers: Sequence[WatchedLink],
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        limit = silence_limit(placed.graph, machine)
        sources = () if limit is None else command_sources(placed.graph, machine)
        self.limit = limit or 0.0
        self._watched = tuple(box for box in receivers if box.link.source in sources)
        self._clock = clock
        self._since = 0

    @property
    def links(self) -> tuple[str, ...]:
        """The names of the links that are watched."""
        return tuple(box.link.name for box in self._watched)

    def heard(self) -> int:
        """Return the time [ns] of the most silent link's last new message; zero if none is
        watched."""
        if not self._watched:
            return 0
        if not self._since:
            self._since = self._clock()
        oldest = self._clock()
        for box in self._watched:
            oldest = min(oldest, max(box.received_at, self._since))
        return oldest

    def complaint(self) -> str:
        """Return a complaint about the link that has been silent for too long; empty if none
        has."""
        if not self._watched:
            return ""
        silence = (self._clock() - self.heard()) * 1e-9
        if silence <= self.limit:
            return ""
        worst = min(self._watched, key=lambda box: box.received_at)
        return (
            f"link {worst.link.name} brings commands and was silent for {silence * 1e3:.1f} ms, at "
            f"most {self.limit * 1e3:g} ms are allowed (links.watchdog)"
        )
