"""Messages of one sender, waiting for the tick that needs them."""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

T = TypeVar("T")
SLICE = 0.05
"""Seconds of waiting after which it is looked whether waiting still helps."""


class MailTimeoutError(Exception):
    """What was waited for has not come in time."""


class Mailbox(Generic[T]):
    """Keeps what arrives on threads of the network for one reader, by a growing number (a tick).

    What arrives early is kept, so a network may change the order. What arrives twice or late is
    counted and thrown away.

    Attributes:
        surplus: how many items came twice or after they had been needed.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self._queue: SimpleQueue[tuple[int, T] | None] = SimpleQueue()
        self._early: dict[int, T] = {}
        self.surplus = 0

    def put(self, number: int, item: T) -> None:
        """Leave an item; any thread may."""
        self._queue.put((number, item))

    def wake(self) -> None:
        """Make a reader that waits look at once whether waiting still helps."""
        self._queue.put(None)

    def take(self, number: int, patience: float) -> T:
        """The item with that number; waits for it.

        ``check`` is called whenever nothing has come for a while, and ends the wait by raising.

        Raises:
            MailTimeoutError: it has not come within ``patience`` seconds.
        """
        if number in self._early:
            return self._early.pop(number)
        end: float | None = None
        while True:
            try:
                found = self._queue.get(timeout=SLICE)
            except Empty:
                found = None
            if found is None:
                if self._queue.empty():
                    self._check()
                now = time.monotonic()
                end = now + patience - SLICE if end is None else end
                if now > end:
                    raise MailTimeoutError
                continue
            if found[0] == number:
                return found[1]
            if found[0] < number or found[0] in self._early:
                self.surplus += 1
            else:
                self._early[found[0]] = found[1]
