"""Memory that two processes share and that has no name.

On Linux it is a ``memfd``, elsewhere a file that is deleted at once. So a process that is killed
leaves nothing behind, and the other one keeps what had been written.
"""

from __future__ import annotations

import os
import tempfile


def nameless_memory(size: int, name: str) -> int:
    """A file descriptor of ``size`` bytes, all zero; ``name`` is what the system's tools show."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create(name)
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, size)
    return descriptor
