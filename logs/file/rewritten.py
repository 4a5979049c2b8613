"""Files that another program has written: read by Rerun's own reader, chunk by chunk.

Rerun's tools (``rerun rrd optimize``, ``filter``, ``merge``, ``split``, ``migrate``) write a recording again, with other
chunks and without aloft's seals. What must be there is checked by its content: every piece of rows has a checksum and
the number of its first tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Chunks:
    """The chunks of a file's first recording: entity and Arrow record batch; ``closed``: it was written to its end."""

    all: tuple[tuple[str, Any], ...]
    closed: bool


def read_chunks(path: Path) -> Chunks:
    """Read a file with Rerun.

    Raises:
        ValueError: Rerun cannot read it.
    """
    try:
        from rerun.chunk import RrdReader
    except ImportError:  # Rerun 0.40
        from rerun.experimental import RrdReader
    try:
        reader = RrdReader(path)
        found = tuple((_name(chunk), chunk.to_record_batch()) for chunk in reader.stream())
    except (RuntimeError, ValueError, OSError) as error:
        raise ValueError(" ".join(str(error).split())) from error
    try:
        reader.store()
    except (RuntimeError, ValueError, OSError):
        return Chunks(found, closed=False)  # the index at its end is missing
    return Chunks(found, closed=True)


def _name(chunk: Any) -> str:
    # Rerun escapes what is no letter, as in the names of blocks that loading inserts
    return str(chunk.entity_path).replace("\\", "")
