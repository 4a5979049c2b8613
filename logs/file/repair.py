"""Repairs a recording in place: removes messages that are not intact, and closes the file.

Nothing of this needs room on the disk, except the sixteen bytes that close the file. What stands
behind damage is moved forward, message by message. A file that had an index has one afterwards; one
that was cut has none, and Rerun opens it all the same.
"""

from __future__ import annotations

import errno
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from ...runtime.language.errors import AloftError
from .index import Index
from .messages import (
    CLOSING,
    FILE_HEAD,
    HEAD,
    Damage,
    Scan,
    closing,
    index_of,
    renumbered,
    scanned,
)


class RepairError(AloftError):
    """Raised for a file that cannot be repaired."""


@dataclass(frozen=True)
class Repair:
    """The findings and the result of a repair.

    Attributes:
        path: the file.
        messages: the number of intact messages.
        size_before, size: of the file [bytes].
        closed: whether it had been closed by who wrote it.
        damage: what was not intact and has been taken out.
    """

    path: Path
    messages: int
    size_before: int
    size: int
    closed: bool
    damage: tuple[Damage, ...] = ()

    @property
    def removed(self) -> int:
        """The number of bytes that were removed."""
        return max(0, self.size_before - self.size)

    @property
    def was_whole(self) -> bool:
        """True if there was nothing to repair."""
        return self.closed and not self.damage


def repair(path: str | PathLike[str]) -> Repair:
    """Repair a file in place. A complete file is not changed.

    Raises:
        OSError: the file cannot be read or written.
        RecordingError: it is not a Rerun file.
        RepairError: it has no message that is intact.
    """
    path = Path(path)
    found = scanned(path)
    count = len(found.messages)
    if not count:
        raise RepairError(f"{path} holds no message that is intact; there is nothing to save")
    if found.closed and not found.damage:
        return Repair(path, count, found.size, found.size, closed=True)
    with path.open("r+b", buffering=0) as file:
        end, index = found.end, b""
        if found.damage:
            end, index = _close_gaps(file, found)
        file.truncate(end)
        size = end
        if found.sealed:
            size += _close(file, end, (closing(end, index, count) if index else CLOSING, CLOSING))
    return Repair(path, count, found.size, size, closed=found.closed, damage=found.damage)


def _close_gaps(file: BinaryIO, found: Scan) -> tuple[int, bytes]:
    """Move what is behind damage forward. Returns the end of the last message, and the file's index,
    which is empty if there was none."""
    index, places = Index(0), dict[int, int]()
    index.add(index_of(file, found), places)
    end = FILE_HEAD
    for number, message in enumerate(found.messages):
        if end >= found.damage[0].begin:
            data = renumbered(file, message, number)
            file.seek(end)
            file.write(data)
        places[message.place + HEAD.size] = end + HEAD.size
        end += message.size
    return end, index.whole()


def _close(file: BinaryIO, end: int, endings: Sequence[bytes]) -> int:
    """Write the first of these endings for which the disk has room. Returns its size, or zero."""
    for data in endings:
        file.seek(end)
        try:
            file.write(data)
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                raise
            file.truncate(end)
        else:
            return len(data)
    return 0
