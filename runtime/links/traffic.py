"""Counts messages from another machine and puts that into words, for the errors with which a part gives up."""

from __future__ import annotations

import time

from ..placement.placed import PlacedGraph
from .message import HEADER

SOON = 0.5
"""Share of the lease within which a machine that is gone was heard: so its connection was closed, and not silent."""


class Traffic:
    """Counts what comes from one other machine. Threads of the network call ``add``.

    Args:
        placed: the graph.
        sender: the other machine.
        receiver: this one.

    Attributes:
        messages: how many came.
        size: the bytes of their contents.
    """

    def __init__(self, placed: PlacedGraph, sender: str, receiver: str) -> None:
        self.messages = self.size = 0
        self._first = self._last = 0.0
        self._lease = placed.graph.links.lease
        self._rate = placed.graph.base_rate
        self._needed = sum(
            (link.payload + HEADER) * link.rate_hz
            for link in placed.sent_by(sender)
            if link.receiver == receiver
        )

    def add(self, size: int) -> None:
        """Count a message of so many bytes."""
        self._last = time.monotonic()
        self._first = self._first or self._last
        self.messages += 1
        self.size += size

    def silence(self) -> float:
        """Return for how long nothing has come [s]; zero before the first message."""
        return time.monotonic() - self._last if self.messages else 0.0

    def why_gone(self) -> str:
        """Say what its disappearance looks like: a connection that was closed, or silence."""
        silent = self.silence()
        if silent < SOON * self._lease:
            return f"its process ended, or closed the connection, {silent:.2g} s after its last message"
        return (
            f"its process froze, or the network to it is cut or too slow: nothing came of it for {silent:.3g} s, and "
            f"links.lease is {self._lease:g} s"
        )

    def measured(self, round_trip: float) -> str:
        """Say what was measured; ``round_trip`` is the shortest one [s], negative: none yet."""
        if not self.messages:
            return "nothing has come of it"
        seconds = max(self._last - self._first, 1e-3)
        text = f"{self.messages} messages came in {seconds:.3g} s, {_bytes(self.size / seconds)}/s"
        if round_trip >= 0.0:
            text += f", with a round trip of {1e3 * round_trip:.3g} ms at best"
        per_tick = self._needed / self._rate
        return f"{text}; a tick needs {_bytes(per_tick)} of it, {_bytes(self._needed)}/s at {self._rate:g} Hz"


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000.0 or unit == "MB":
            return f"{size:.3g} {unit}"
        size /= 1000.0
    raise AssertionError
