"""Python's garbage collector, kept out of work that makes many objects and hardly any garbage."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()
_holders: list[bool] = []
"""One entry for each that holds the collector off; the first says whether it was on before."""


@contextmanager
def collector_off() -> Iterator[None]:
    """No garbage collection meanwhile; it is as before once the last of several threads has ended."""
    with _lock:
        _holders.append(gc.isenabled() if not _holders else _holders[0])
        gc.disable()
    try:
        yield
    finally:
        with _lock:
            before = _holders.pop()
            if before and not _holders:
                gc.enable()


@contextmanager
def collector_paused() -> Iterator[None]:
    """No garbage collection meanwhile, and none of what was made because of it.

    Each collection would look at all objects again: a third of the time in which a graph of 5,000 blocks loads.
    """
    enabled = gc.isenabled()
    with collector_off():
        try:
            yield
        finally:
            if enabled and not gc.get_freeze_count():
                # Moves all objects to the oldest generation without a look at them; enabling alone would begin with one.
                gc.freeze()
                gc.unfreeze()
