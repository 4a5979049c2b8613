"""Repairs a recording that was cut off: the file is shortened to its last complete message.

An ``.rrd`` file has a head of twelve bytes and then messages. A message has its kind and its
length, eight bytes each, and then that many bytes. A writer that is killed, or that finds the disk
full, leaves the last message incomplete. No reader can read such a file, but all messages before
the last one are intact.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from ...runtime.language.errors import AloftError

_MAGIC = b"RRF2"
_FILE_HEAD = 12
_MESSAGE = Struct("<QQ")
_END = 0
"""The kind of the message that closes a file; an index of the file follows it."""
_LAST_KIND = 3


class RepairError(AloftError):
    """Raised for a file that cannot be repaired."""


@dataclass(frozen=True)
class Repair:
    """What was found and done: the ``messages`` that are whole, where in the file they begin and
    ``end``, its size [bytes] before and after, and whether it had been ``closed`` by who wrote it.
    """

    path: Path
    messages: int
    size_before: int
    size: int
    closed: bool
    end: int
    begin: int = _FILE_HEAD

    @property
    def removed(self) -> int:
        """The number of bytes that were removed."""
        return self.size_before - self.size


def repair(path: str | PathLike[str]) -> Repair:
    """Repair a file in place. A complete file is not changed.

    Raises:
        OSError: the file cannot be read or written.
        RepairError: it is not a Rerun file, or has no message that is whole.
    """
    path = Path(path)
    with path.open("r+b") as file:
        found = _examine(path, file)
        if found.removed:
            file.truncate(found.size)
    return found


def _examine(path: Path, file: BinaryIO) -> Repair:
    total = path.stat().st_size
    if file.read(_FILE_HEAD)[: len(_MAGIC)] != _MAGIC:
        raise RepairError(f"{path} is not a Rerun file of this format, or its beginning is lost")
    messages, place = 0, _FILE_HEAD
    while place + _MESSAGE.size <= total:
        file.seek(place)
        kind, length = _MESSAGE.unpack(file.read(_MESSAGE.size))
        end = place + _MESSAGE.size + length
        if kind > _LAST_KIND or end > total:
            break
        if kind == _END:
            return Repair(path, messages, total, total, closed=True, end=place)
        messages, place = messages + 1, end
    if not messages:
        raise RepairError(f"{path} holds no message that is whole; there is nothing to save")
    return Repair(path, messages, total, place, closed=False, end=place)
