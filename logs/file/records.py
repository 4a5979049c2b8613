"""The records of a recording: aloft's own data inside of a Rerun file, each found by its mark and verified.

Rerun writes the file, chunk by chunk. A record is the bytes of one component of a chunk: a mark, a head, a payload.
The bytes are masked, so that nothing repeats in them; what does not repeat stays as it is in a file that Rerun
compresses with LZ4. The writer verifies of each record that it stands in the file byte by byte. So a reader finds records
without any knowledge of how Rerun frames its chunks, and gives no byte to Rerun or Arrow before it is verified:
neither of them survives every damaged file.

The head has the record's number and the CRC-32 of its payload, and of the bytes around the record before: those since
the record before that. So every byte of the file is under a checksum. What follows the last records is under the
checksum of these, which are filled in when the file is complete; there are two of them, so that damage to one is not
taken for a file that was cut off.

A file that another program has written again, such as ``rerun rrd optimize``, has the same records; Rerun's own
reader finds them, see ``rewritten``.
"""

from __future__ import annotations

import io
import os
import zlib
from dataclasses import dataclass, replace
from enum import IntEnum
from hashlib import shake_128
from pathlib import Path
from struct import Struct
from typing import BinaryIO

import numpy as np

from ...runtime.language.errors import AloftError

MAGIC = b"RRF2"
"""The first bytes of any file of Rerun's that is read."""
MOST_OF_TEXT = 1 << 28
"""Bytes of a text before compression, at most."""
_RANDOM = shake_128(b"aloft recording 7").digest((1 << 16) + 40)
_GUARD, MARK, _BEHIND, _MASK = _RANDOM[:12], _RANDOM[12:28], _RANDOM[28:40], _RANDOM[40:]
"""Rerun's compression may take the first or last bytes of a record for a repetition of what is around it."""
_KEYS = np.frombuffer(_MASK * 2, np.uint8)
_HEAD = Struct("<BHIqqQQQIQQI")
_CHECK = Struct("<I")
_SALT = len(MARK)
_MASKED = _SALT + 1
_PAYLOAD = _MASKED + _HEAD.size + _CHECK.size
_SEARCHED, _BLOCK = 1 << 13, 1 << 20
"""Bytes that are read at once, at first and at most."""
MOST_SALTS = 64
"""Ways to mask a record: of some thousand records one has a repetition, and takes the second."""


class Content(IntEnum):
    """The contents of a record."""

    START = 1
    """The header, as text."""
    FILES = 2
    """The contents of the files that the graph has read, as text."""
    ROWS = 3
    """Packed rows of the base of the bus; see ``row_codec``."""
    HELD = 4
    """Packed rows of a held group, whose number is ``group``; see ``held_fields``."""
    KEYFRAME = 5
    NOTES = 6
    """Notes, as text: a list."""
    OUTCOME = 7
    END = 8
    """One of the two last, by ``group``."""


_CONTENTS = frozenset(Content)


@dataclass(frozen=True)
class Record:
    """One record: what its head says, and where it is.

    Attributes:
        content, group: what it holds.
        number: of the record in its file, from zero on.
        first, last: the first and the last tick that it speaks of; of an end the bytes from its chunk to its mark,
            and those behind it.
        begin: bytes of the file that were written before.
        front: bytes of the file from the end of what was written before the record before, to its mark.
        gap: bytes from the end of the record before to the end of what was written before this one.
        gap_crc: the CRC-32 of both.
        size: bytes of the payload.
        whole: its bytes before compression.
        crc: the CRC-32 of the payload; of an end that of the bytes around it.
        salt: how it is masked.
        place: where its mark begins.
    """

    content: Content
    number: int = 0
    group: int = 0
    first: int = 0
    last: int = -1
    begin: int = 0
    front: int = 0
    gap: int = 0
    gap_crc: int = 0
    size: int = 0
    whole: int = 0
    crc: int = 0
    salt: int = 0
    place: int = 0

    @property
    def end(self) -> int:
        """End of the payload."""
        return self.place + _PAYLOAD + self.size

    def head(self) -> bytes:
        """Return mark and head."""
        plain = _HEAD.pack(
            self.content, self.group, self.number, self.first, self.last, self.begin, self.front, self.gap,
            self.gap_crc, self.size, self.whole, self.crc,
        )  # fmt: skip
        plain += _CHECK.pack(zlib.crc32(plain))
        return MARK + bytes([self.salt]) + _masked(plain, self.salt)


def _masked(data: bytes | memoryview, salt: int, begin: int = 0) -> bytes:
    """Mask bytes, or unmask them."""
    begin = (begin + 521 * salt) % len(_MASK)
    values = np.frombuffer(data, np.uint8)
    keys = _KEYS[begin : begin + len(_MASK)]
    if len(values) > len(keys):
        keys = np.resize(keys, len(values))
    masked: bytes = (values ^ keys[: len(values)]).tobytes()
    return masked


def composed(record: Record, payload: bytes) -> tuple[Record, bytes, bytes]:
    """Return the record of a payload, its bytes, and those with guards around them for Rerun."""
    hidden = _masked(payload, record.salt, _HEAD.size + _CHECK.size)
    crc = zlib.crc32(hidden) if payload else record.crc
    record = replace(record, size=len(payload), crc=crc)
    data = record.head() + hidden
    return record, data, _GUARD + data + _BEHIND


def packed_text(text: str) -> tuple[bytes, int]:
    """Compress a text; return it and its bytes before."""
    data = text.encode()
    return zlib.compress(data, 6), len(data)


@dataclass(frozen=True)
class Damage:
    """Bytes from ``begin`` to ``end`` that are not what was written.

    ``after`` and ``before`` are the last recorded tick before them and the first behind them.
    """

    begin: int
    end: int
    after: int | None = None
    before: int | None = None

    def __str__(self) -> str:
        where = f"bytes {self.begin} to {self.end - 1}"
        if self.after is not None and self.before is not None and self.before <= self.after + 1:
            return f"{where}; no tick is lost"
        low = "the first tick" if self.after is None else f"tick {self.after + 1}"
        high = "the last tick" if self.before is None else f"tick {self.before - 1}"
        return f"{where}; of the ticks, those from {low} to {high} may be lost"


@dataclass(frozen=True)
class Scan:
    """The records of a file and its damages.

    Attributes:
        path: the file.
        size: its size [bytes].
        records: all that are intact, in order.
        damage: what is not.
        closed: whether it was closed by who wrote it.
        rewritten: the records, if Rerun has written the file again, and they were read by it.
        maker: number of the format and version of aloft, where another one wrote the file.
    """

    path: Path
    size: int
    records: tuple[Record, ...] = ()
    damage: tuple[Damage, ...] = ()
    closed: bool = False
    rewritten: bytes | None = None
    maker: tuple[object, str] | None = None

    def of(self, *contents: Content) -> list[Record]:
        """Return the records with that content."""
        return [record for record in self.records if record.content in contents]

    def payload(self, record: Record) -> bytes:
        """Read a record, and verify it once more. Raises ``RecordingError``."""
        written = self.path.open("rb") if self.rewritten is None else io.BytesIO(self.rewritten)
        with written as file:
            file.seek(record.place + _PAYLOAD)
            hidden = file.read(record.size)
        if len(hidden) < record.size or zlib.crc32(hidden) != record.crc:
            raise self.unreadable(record, "it has changed while it was read")
        return _masked(hidden, record.salt, _HEAD.size + _CHECK.size)

    def text(self, record: Record) -> str:
        """Read a record that is a text. Raises ``RecordingError``."""
        data = self.payload(record)
        if record.whole > MOST_OF_TEXT:
            raise self.unreadable(record, f"a text has {record.whole} bytes, more than are read")
        unpacker = zlib.decompressobj()
        try:
            found = unpacker.decompress(data, record.whole + 1)
            if len(found) != record.whole:
                raise ValueError("a text has not the size that its record says")
            return found.decode()
        except (ValueError, zlib.error) as error:
            raise self.unreadable(record, str(error)) from error

    def unreadable(self, record: Record, why: object) -> RecordingError:
        """Make the error for a record that cannot be taken apart."""
        return RecordingError(f"{self.path} cannot be read at byte {record.place} ({why}); the file is damaged there")  # fmt: skip


class RecordingError(AloftError):
    """Raised for a file that is no recording or that is damaged. The message says what to do."""


class NoRunError(RecordingError):
    """Raised for a file of Rerun's that is no recording of a run, such as the motion of a plan."""


class DamagedError(RecordingError):
    """Raised for a recording with bytes that are not what was written; names the lost ticks."""


def find_records(path: Path) -> tuple[Scan, bool]:
    """Look through a whole file, and verify every checksum; a block at a time is in memory.

    Returns what is in it, and whether its records are not where they were written, or there are none: then another
    program has written the file.

    Raises:
        OSError: it cannot be read.
        RecordingError: it is not a Rerun file.
    """
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
        found, moved = _Scanner(path, file).scan()
    if head != MAGIC and not found.records:
        raise RecordingError(f"{path} is not a recording: it does not begin like a file of Rerun's")
    return found, moved or not found.records


def expect_intact(found: Scan) -> None:
    """Raise ``DamagedError`` if something in the file is not what was written."""
    if found.damage:
        places = "; ".join(map(str, found.damage[:3]))
        more = f"; and {len(found.damage) - 3} more" if len(found.damage) > 3 else ""
        raise DamagedError(
            f"{found.path} is damaged: {places}{more}. 'aloft log repair {found.path}' keeps all "
            "the rest"
        )


def records_in(data: bytes) -> list[Record]:
    """Find the intact records in bytes in memory, in order."""
    scanner = _Scanner(Path(), io.BytesIO(data), len(data))
    found, place = [], 0
    while (record := scanner.next_at(place)) is not None:
        found.append(record)
        place = record.end
    return found


class _Scanner:
    def __init__(self, path: Path, file: BinaryIO, size: int | None = None) -> None:
        self._path, self._file = path, file
        self._size = os.fstat(file.fileno()).st_size if size is None else size

    def scan(self) -> tuple[Scan, bool]:
        """Return what is in the file, and whether records are not where they were written: then another program has
        written the file again."""
        records: list[Record] = []
        damage: list[Damage] = []
        moved = False
        floor, before = 0, Record(Content.START, -1, place=-_PAYLOAD)
        while (record := self.next_at(before.end)) is not None:
            if not self._fits(before, record, floor):
                damage.append(Damage(before.end, record.place))
            if record.number == before.number + 1:
                moved |= max(0, before.end) + record.gap != record.begin
            records.append(record)
            floor, before = before.end, record
        closed, wrong = self._end(records)
        if wrong:
            damage.append(Damage(before.end, self._size))
        named = tuple(_named(each, records) for each in damage)
        return Scan(self._path, self._size, tuple(records), named, closed), moved

    def next_at(self, place: int) -> Record | None:
        """Find the next intact record at or behind ``place``."""
        size = _SEARCHED
        while place < self._size:
            self._file.seek(place)
            block = self._file.read(size)
            at = block.find(MARK)
            if at < 0:
                place += max(1, len(block) - len(MARK) + 1)
                size = min(2 * size, _BLOCK)
                continue
            record = self._checked(place + at)
            if record is not None:
                return record
            place += at + 1
        return None

    def _checked(self, place: int) -> Record | None:
        """Return the record whose mark is at ``place``, if it is intact."""
        self._file.seek(place)
        head = self._file.read(_PAYLOAD)
        if len(head) < _PAYLOAD:
            return None
        plain = _masked(head[_MASKED:], head[_SALT])
        (crc,) = _CHECK.unpack_from(plain, _HEAD.size)
        if zlib.crc32(plain[: _HEAD.size]) != crc:
            return None
        content, group, number, *rest = _HEAD.unpack_from(plain)
        if content not in _CONTENTS:
            return None
        values: tuple[int, ...] = (number, group, *rest, head[_SALT], place)
        record = Record(Content(content), *values)
        if record.end > self._size:
            return None
        if record.size and self._crc(place + _PAYLOAD, record.end) != record.crc:
            return None
        return record

    def _fits(self, before: Record, record: Record, floor: int) -> bool:
        """Tell whether a record is the next one, and nothing has changed in between, or between the one ``before``
        and ``floor``, where that one's front begins at the earliest."""
        end = before.end + record.gap
        if record.number != before.number + 1 or end > record.place:
            return False
        if before.number < 0:
            return self._crc(0, record.gap) == record.gap_crc
        front = before.place - record.front
        if front < floor:
            return False
        return self._crc(before.end, end, self._crc(front, before.place)) == record.gap_crc

    def _end(self, records: list[Record]) -> tuple[bool, bool]:
        """Tell whether the file is closed, and whether there is damage in its end."""
        ends = [record for record in records[-2:] if record.content is Content.END]
        if any(end.end + end.last > self._size for end in ends):
            return False, False  # cut off behind them
        right = [end for end in ends if self._is_end(end)]
        if [end.group for end in right] == [0, 1]:
            return True, False
        return False, bool(ends)

    def _is_end(self, end: Record) -> bool:
        begin = end.place - end.first
        if begin < 0 or end.end + end.last != self._size:
            return False
        return self._crc(end.end, self._size, self._crc(begin, end.place)) == end.crc

    def _crc(self, begin: int, end: int, known: int = 0) -> int:
        self._file.seek(begin)
        while begin < end:
            block = self._file.read(min(_BLOCK, end - begin))
            if not block:
                break
            known = zlib.crc32(block, known)
            begin += len(block)
        return known


def _named(damage: Damage, found: list[Record]) -> Damage:
    """Return the damage with the ticks around it."""
    afters, befores = [], []
    for kind in (Content.ROWS, Content.HELD):
        parts = [m for m in found if m.content is kind]
        if parts or kind is Content.ROWS:
            afters.append(max((m.last for m in parts if m.place < damage.begin), default=None))
            befores.append(min((m.first for m in parts if m.place >= damage.end), default=None))
    after = None if None in afters else min(tick for tick in afters if tick is not None)
    before = None if None in befores else max(tick for tick in befores if tick is not None)
    return replace(damage, after=after, before=before)
