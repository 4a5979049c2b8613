"""A graph's memory as bytes, and memory that two processes share: what a recorder needs of a run.

A process that only keeps bytes imports nothing that loads or runs graphs, which takes half of its start.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass


@dataclass(frozen=True)
class Snapshot:
    """State of a graph at one instant: bus, declared state and tick."""

    tick: int
    bus: bytes
    state: bytes


def nameless_memory(size: int, name: str) -> int:
    """Make memory of ``size`` zero bytes that two processes can share, and return its file
    descriptor.

    On Linux it is a ``memfd``, elsewhere a file that is deleted at once. So a process that is killed
    leaves nothing behind, and the other one keeps what had been written. ``name`` is what the
    system's tools show.
    """
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create(name)
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, size)
    return descriptor
