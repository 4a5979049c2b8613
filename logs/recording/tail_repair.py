"""Appends the tail of a recording that was cut off to the recording."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..file.reader import read
from ..file.repair import repair
from ..file.tail import tail_of
from .writer import RecordingWriter


def take_in_tail(path: str | PathLike[str]) -> int:
    """Append the ticks that only the tail has to a repaired recording, and remove the tail.

    Returns:
        How many ticks those are.

    Raises:
        OSError: a file cannot be read or written; nothing is lost.
        RecordingError: the recording cannot be read.
    """
    path = Path(path)
    tail = tail_of(path)
    if not tail.exists():
        return 0
    run = read(path)
    if run.outcome is not None:
        return 0  # the tail is another run's
    count = len(run.ticks) - len(run.written_ticks())
    if count:
        piece = path.with_name(f"{path.name}.piece")
        try:
            writer = RecordingWriter(piece, run.header)
            writer.write_rows(run.ticks[-count:], run.rows[-count:])
            writer.close()
            found = repair(piece)
            data = piece.read_bytes()[found.begin : found.end]
        finally:
            piece.unlink(missing_ok=True)
        with path.open("ab") as file:
            file.write(data)
    tail.unlink()
    return count
