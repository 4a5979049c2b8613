"""Writes files as a whole or not at all, even if the process is killed meanwhile."""

from __future__ import annotations

import os
import time
from pathlib import Path

ABANDONED = 3600.0
"""After that many seconds nobody is still writing a part [s]."""


def write_whole(path: Path, data: bytes) -> Path:
    """Write a file, replacing what is there: readers see the old one or the new one, never half."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path


def remove_abandoned(folder: Path) -> None:
    """Remove the parts that a process left behind which was killed while it wrote one."""
    for part in folder.glob(".*.part"):
        try:
            if time.time() - part.stat().st_mtime > ABANDONED:
                part.unlink()
        except FileNotFoundError:
            continue  # it was not abandoned after all
