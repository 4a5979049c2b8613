"""Stopping a long piece of work by a signal, so that what is done can be kept and reported."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def stopped_by_signals() -> Iterator[list[signal.Signals]]:
    """Leave the block at the first SIGINT or SIGTERM; the list then holds that signal.

    Within the block it is a ``KeyboardInterrupt``, so what is under way can clean up.
    """
    received: list[signal.Signals] = []

    def stop(number: int, _: object) -> None:
        received.append(signal.Signals(number))
        raise KeyboardInterrupt

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    except KeyboardInterrupt:
        if not received:
            raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
