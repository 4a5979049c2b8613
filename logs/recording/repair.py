"""Repairs a recording: writes all that is intact of it into a new file, which then takes its name.

So the file is like one that a run has written: with curves and index, for Rerun's tools too. Nothing is changed where
there is no room for the new file; what is intact can be read without a repair.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from ...runtime.language.errors import AloftError
from ..file.reader import read, scan
from ..file.records import Content, Damage
from .output_file import reserve_output
from .writer import RecordingWriter


class RepairError(AloftError):
    """Raised for a file that cannot be repaired."""


@dataclass(frozen=True)
class Repair:
    """The findings and the result of a repair.

    Attributes:
        path: the file.
        records: the number of intact records that it had.
        size_before, size: of the file [bytes].
        closed: whether it had been closed by who wrote it.
        damage: what was not intact and has been taken out.
    """

    path: Path
    records: int
    size_before: int
    size: int
    closed: bool
    damage: tuple[Damage, ...] = ()

    @property
    def was_whole(self) -> bool:
        """True if there was nothing to repair."""
        return self.closed and not self.damage


def repair(path: str | PathLike[str]) -> Repair:
    """Repair a file. A complete file is not changed.

    Raises:
        OSError: the file cannot be read, or there is no room for the new one.
        RecordingError: it is not a Rerun file.
        RepairError: its header is not intact.
        ImportError: Rerun is not installed.
    """
    path = Path(path)
    found = scan(path)
    count = len(found.records)
    if found.closed and not found.damage:
        return Repair(path, count, found.size, found.size, closed=True)
    if not found.of(Content.START):
        raise RepairError(f"{path} holds no header that is intact; there is nothing to save")
    run = read(path, damaged=True)
    output = reserve_output(path)
    try:
        writer = RecordingWriter(path, run.header, output=output)
        for ticks, rows in run.pieces():
            writer.write_rows(ticks, rows)
        for tick in run.keyframes:
            writer.write_keyframe(run.snapshot(tick))
        writer.write_notes(run.notes)
        if run.outcome is not None:
            writer.write_outcome(dict(run.outcome))
    except BaseException:
        output.discard()
        output.close()
        raise
    writer.close()
    size = path.stat().st_size
    return Repair(path, count, found.size, size, closed=found.closed, damage=found.damage)
