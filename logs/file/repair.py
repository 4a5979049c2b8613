"""Repairs a recording in place: what is not intact is taken out, and the file is closed.

Nothing of this needs room on the disk, except the sixteen bytes that close the file. What stands
behind damage is moved forward, message by message.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from ...runtime.language.errors import AloftError
from .messages import CLOSING, Damage, renumbered, scanned


class RepairError(AloftError):
    """Raised for a file that cannot be repaired."""


@dataclass(frozen=True)
class Repair:
    """What was found and done.

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
        """Whether there was nothing to repair."""
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
        end = found.end
        if found.damage:
            end = found.damage[0].begin
            behind = [message for message in found.messages if message.place >= end]
            for number, message in enumerate(behind, start=count - len(behind)):
                data = renumbered(file, message, number)
                file.seek(end)
                file.write(data)
                end += len(data)
        file.truncate(end)
        size = end + (_close(file, end) if found.sealed else 0)
    return Repair(path, count, found.size, size, closed=found.closed, damage=found.damage)


def _close(file: BinaryIO, end: int) -> int:
    """Write the closing message. Returns its size, or zero if the disk has no room for it."""
    file.seek(end)
    try:
        file.write(CLOSING)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise
        file.truncate(end)
        return 0
    return len(CLOSING)
