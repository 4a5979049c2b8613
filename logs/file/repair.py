"""Mends a recording that was cut: the file is shortened to the last message that is all there.

An ``.rrd`` file is a head of twelve bytes and messages, each a kind and a length of eight bytes each
and so many bytes. A writer that is killed, or that finds the disk full, leaves the last message
incomplete, with which no reader can cope. What stands before it can be read.
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
    """A file cannot be mended."""


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
        """The bytes that were cut off."""
        return self.size_before - self.size


def repair(path: str | PathLike[str]) -> Repair:
    """Mend a file in place; a whole one stays as it is.

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
