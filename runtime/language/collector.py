"""Python's garbage collector, kept out of work that makes many objects and hardly any garbage."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()
_holders: list[bool] = []
"""One entry for each that holds the collector off; the first says whether it was on before."""
_freezers: list[bool] = []
"""One entry for each that needs objects exempt from collections; the first says whether that was done here."""
_frozen_elsewhere = False
"""True once objects were found that somebody else has frozen."""


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
def objects_frozen() -> Iterator[None]:
    """Exempt all existing objects from requested collections meanwhile.

    Where the caller, or Python at its start, has frozen objects already, they stay frozen and no
    others are: ``gc.unfreeze`` knows only all.
    """
    with _lock:
        _freezers.append(_freezers[0] if _freezers else not _are_frozen())
        if len(_freezers) == 1 and _freezers[0]:
            gc.freeze()
    try:
        yield
    finally:
        with _lock:
            if _freezers.pop() and not _freezers:
                gc.unfreeze()


def _are_frozen() -> bool:
    """Return whether objects are frozen. Python finds out by a look at each of them, so those of others are
    found once: half a million take as long as a short run."""
    global _frozen_elsewhere
    if not _freezers:
        _frozen_elsewhere = _frozen_elsewhere or gc.get_freeze_count() > 0
    return bool(_freezers) or _frozen_elsewhere


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
            with _lock:
                if enabled and not _are_frozen():
                    # Moves all objects to the oldest generation without a look at them; enabling alone would begin with one.
                    gc.freeze()
                    gc.unfreeze()
