"""The messages of a recording's file: framed, sealed with a checksum, and found again in any damage.

An ``.rrd`` file has a head of twelve bytes and then messages. A message has its kind and its
length, eight bytes each, and then that many bytes, which are a protobuf message. A message of kind
zero closes the file: it holds an index for Rerun's tools, with a footer behind it (``index``), or
nothing.

Every message that aloft writes ends with a seal: one more protobuf field, which Rerun skips. It has
the number of the message, what the message holds (``Content``), the first and the last tick that it
speaks of, and the CRC-32 of the whole message. The seal of the first message covers the file's head
too. So every byte before the footer is under a checksum, and nothing is given to Rerun or Arrow
unless its checksum is right: neither of them survives every damaged message.

A file that another program has written again, such as ``rerun rrd filter``, has no seals; Rerun reads
it, see ``rewritten``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO
from zlib import crc32

from ...runtime.language.errors import AloftError
from . import protobuf
from .index import FOOTER_END, FOOTER_SIZE, footer
from .rewritten import read_chunks

FILE_HEAD = 12
MAGIC = b"RRF2"
HEAD = Struct("<QQ")
END = 0
"""The kind of the message that closes a file."""
CLOSING = HEAD.pack(END, 0)
"""Message that closes a file without an index."""
ARROW = 2
"""The kind of a message that holds an Arrow table."""
_LAST_KIND = 3
MOST_RATIO = 255
"""Bytes that LZ4 can make of one."""
_KEY = b"\x82\xf4\x03\x2c"
"""The protobuf field 8000, 44 bytes long."""
_MARK = _KEY + b"aloft-seal\x01"
_SEAL = Struct("<QBqqII")
_CHECKED = _SEAL.size - 4
SEAL_SIZE = len(_MARK) + _SEAL.size
_SEARCHED = 1 << 20
_CLOSING_SIZES = {len(CLOSING): CLOSING, FOOTER_SIZE: FOOTER_END}
"""Possible ends of a closed file: the bytes behind the last seal, by their number."""


class Content(IntEnum):
    """The contents of a message."""

    PICTURE = 0
    """Data that only the viewer shows."""
    START = 1
    """The header."""
    ROWS = 2
    KEYFRAME = 3
    NOTES = 4
    OUTCOME = 5
    UNKNOWN = 6
    """Any of these, in a file without seals."""
    INDEX = 7
    """Index of all other messages, for Rerun's tools."""
    HELD = 8
    """Large fields of slow blocks, in the ticks in which these ran."""


@dataclass(frozen=True)
class FileMessage:
    """One message: where it begins, its size with its head, its kind, and what its seal says."""

    place: int
    size: int
    kind: int
    content: Content = Content.UNKNOWN
    number: int = -1
    first: int = 0
    last: int = -1

    @property
    def end(self) -> int:
        """The place of the next message."""
        return self.place + self.size


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
        if self.end <= self.begin:
            where = f"messages are missing at byte {self.begin}"
        if self.after is not None and self.before is not None and self.before <= self.after + 1:
            return f"{where}; no tick is lost"
        low = "the first tick" if self.after is None else f"tick {self.after + 1}"
        high = "the last tick" if self.before is None else f"tick {self.before - 1}"
        return f"{where}; of the ticks, those from {low} to {high} may be lost"


@dataclass(frozen=True)
class Scan:
    """The messages of a file and its damages.

    Attributes:
        path: the file.
        size: its size [bytes].
        messages: all that are intact, in order.
        damage: what is not.
        sealed: whether it has checksums.
        closed: whether it was closed by who wrote it.
        end: where the last intact message ends.
        chunks: entity and table of each message of a file without seals, as Rerun has read them.
    """

    path: Path
    size: int
    messages: tuple[FileMessage, ...]
    damage: tuple[Damage, ...]
    sealed: bool
    closed: bool
    end: int
    chunks: tuple[tuple[str, Any], ...] = field(default=(), repr=False, compare=False)

    def of(self, content: Content) -> list[FileMessage]:
        """Return the messages with that content; in a file without seals all messages with tables."""
        wanted = (content, Content.UNKNOWN)
        return [m for m in self.messages if m.kind == ARROW and m.content in wanted]


def sealed(head: bytes, body: bytes, seal: FileMessage, begun: int = 0) -> bytes:
    """Seal a message: ``head`` and ``body`` as Rerun made them, ``begun`` the CRC-32 of the file's
    head for the first message of a file and else zero."""
    kind, length = HEAD.unpack(head)
    fields = (seal.number, int(seal.content), seal.first, seal.last, 0)
    whole = HEAD.pack(kind, length + SEAL_SIZE) + body + _MARK + _SEAL.pack(*fields, 0)[:_CHECKED]
    return whole + crc32(whole, begun).to_bytes(4, "little")


def closing(place: int, index: bytes, number: int) -> bytes:
    """Make the message that closes, at ``place``, a file with this number of messages."""
    message = sealed(
        HEAD.pack(END, len(index)), index, FileMessage(0, 0, END, Content.INDEX, number)
    )
    return message + footer(place + HEAD.size, message[HEAD.size :])


def split(data: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield places, heads and bodies of the messages of a Rerun file in memory; the closing one is
    last."""
    place = FILE_HEAD
    kind = ARROW
    while kind != END and place + HEAD.size <= len(data):
        kind, length = HEAD.unpack_from(data, place)
        body = place + HEAD.size
        yield place, data[place:body], data[body : body + length]
        place = body + length


def scan(path: Path) -> Scan:
    """Look through a whole file, and verify every checksum; a message at a time is in memory.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a Rerun file of this format.
    """
    with path.open("rb") as file:
        return _Scanner(path, file).scan()


class _Scanner:
    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path, self._file = path, file
        self._size = path.stat().st_size
        self._head = file.read(FILE_HEAD)
        file.seek(0)
        self._sealed = _MARK in file.read(_SEARCHED)

    def scan(self) -> Scan:
        if self._head[:4] != MAGIC and not self._sealed:
            raise ValueError(f"{self._path} is not a Rerun file of this format")
        if not self._sealed:
            found = read_chunks(self._path)
            numbers = tuple(FileMessage(k, 0, ARROW) for k in range(len(found.all)))
            return Scan(
                self._path, self._size, numbers, (), False, found.closed, self._size, found.all
            )
        messages: list[FileMessage] = []
        damage: list[Damage] = []
        place, closed = FILE_HEAD, False
        expected = 0
        while place < self._size:
            message = self._at(place, first=not messages and not damage)
            if message is None:
                beyond = self._next_after(place)
                if beyond is None:
                    closed = self._closes(place, expected)
                    if not closed and self._is_damage(place):
                        damage.append(Damage(place, self._size))
                    break
                damage.append(Damage(place, beyond))
                place = beyond
                expected = -1
                continue
            if message.number != expected >= 0:
                damage.append(Damage(place, place))
            expected = message.number + 1
            messages.append(message)
            place = message.end
        end = messages[-1].end if messages else FILE_HEAD
        named = tuple(_named(each, messages) for each in damage)
        return Scan(self._path, self._size, tuple(messages), named, True, closed, end)

    def _at(self, place: int, *, first: bool) -> FileMessage | None:
        """Read the intact message at ``place``."""
        if place + HEAD.size > self._size:
            return None
        self._file.seek(place)
        head = self._file.read(HEAD.size)
        kind, length = HEAD.unpack(head)
        if not END < kind <= _LAST_KIND or place + HEAD.size + length > self._size:
            return None
        if length < SEAL_SIZE:
            return None
        body = self._file.read(length)
        known = crc32(self._head) if first else 0
        return _checked(place, head, body, known)

    def _closes(self, place: int, number: int) -> bool:
        """Tell whether the file is closed at ``place``, behind so many messages, and ends there."""
        self._file.seek(place)
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return False
        kind, length = HEAD.unpack(head)
        if kind != END:
            return False
        if head == CLOSING:
            return place + len(CLOSING) == self._size
        if place + HEAD.size + length + FOOTER_SIZE != self._size or length < SEAL_SIZE:
            return False
        body, end = self._file.read(length), self._file.read()
        message = _checked(place, head, body, 0)
        if message is None or message.number != number >= 0:
            return False
        return end == footer(place + HEAD.size, body)

    def _is_damage(self, place: int) -> bool:
        """Tell whether the bytes at ``place``, behind which nothing is intact, are no message cut
        short."""
        if any(self._ends_closed(place, size) for size in _CLOSING_SIZES):
            return True
        self._file.seek(place)
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return False
        kind, length = HEAD.unpack(head)
        end = place + HEAD.size + length
        if kind == END and length:
            end += FOOTER_SIZE
        return bool(kind > _LAST_KIND or end <= self._size)

    def _ends_closed(self, place: int, size: int) -> bool:
        """Tell whether the last ``size`` bytes, those after a seal behind ``place``, close the
        file.

        A closing message without an index is sixteen zeros, which stand inside of messages too, as
        in many seals. It closes the file only where it follows a seal.
        """
        if self._size - place < SEAL_SIZE + size:
            return False
        self._file.seek(self._size - SEAL_SIZE - size)
        tail = self._file.read()
        return tail.startswith(_MARK) and tail.endswith(_CLOSING_SIZES[size])

    def _next_after(self, place: int) -> int | None:
        """Find the next intact message: behind a seal that stands behind ``place``."""
        at = place
        while at < self._size:
            self._file.seek(at)
            piece = self._file.read(_SEARCHED + SEAL_SIZE)
            mark = piece.find(_MARK)
            if mark < 0:
                at += _SEARCHED
                continue
            beyond = at + mark + SEAL_SIZE
            if self._at(beyond, first=False) is not None:
                return beyond
            at += mark + 1
        return None


def _checked(place: int, head: bytes, body: bytes, known: int) -> FileMessage | None:
    """Return the message, if its seal is right."""
    if body[-SEAL_SIZE : -_SEAL.size] != _MARK:
        return None
    number, content, first, last, _, crc = _SEAL.unpack_from(body, len(body) - _SEAL.size)
    if crc32(body[:-4], crc32(head, known)) != crc:
        return None
    kind = HEAD.unpack(head)[0]
    return FileMessage(place, HEAD.size + len(body), kind, Content(content), number, first, last)


def _named(damage: Damage, found: list[FileMessage]) -> Damage:
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


def body_of(file: BinaryIO, message: FileMessage) -> bytes:
    """Read the body of a message and verify it once more.

    Raises:
        ValueError: it has changed since the file was looked through.
    """
    file.seek(message.place)
    head, body = file.read(HEAD.size), file.read(message.size - HEAD.size)
    if message.number >= 0:
        known = 0
        if message.number == 0:
            file.seek(0)
            known = crc32(file.read(FILE_HEAD))
        if _checked(message.place, head, body, known) is None:
            raise ValueError(f"the message at byte {message.place} has changed while it was read")
    return body


def renumbered(file: BinaryIO, message: FileMessage, number: int) -> bytes:
    """Return a sealed message with another number. Raises ``ValueError`` as ``body_of`` does."""
    file.seek(0)
    known = crc32(file.read(FILE_HEAD)) if number == 0 else 0
    body = body_of(file, message)[:-SEAL_SIZE]
    head = HEAD.pack(message.kind, len(body))
    return sealed(head, body, replace(message, number=number), known)


def index_of(file: BinaryIO, found: Scan) -> bytes:
    """Read the index of a closed file, without its seal; empty if it has none."""
    file.seek(found.end)
    head = file.read(HEAD.size)
    if not (found.sealed and found.closed) or head == CLOSING:
        return b""
    return file.read(HEAD.unpack(head)[1] - SEAL_SIZE)


def table_of(body: bytes) -> tuple[str, Any]:
    """Read entity and Arrow record batch that a message of kind ``ARROW`` holds.

    Raises:
        ValueError: it is not what Rerun writes.
    """
    import pyarrow as pa  # comes with Rerun

    try:
        parts = dict(protobuf.fields(body))
        data: Any = parts[5]
        if parts.get(2) == 2:
            if not 0 <= parts[3] <= MOST_RATIO * (len(data) + 1):
                raise ValueError(f"{len(data)} bytes cannot unpack to {parts[3]}")
            data = pa.decompress(data, parts[3], codec="lz4_raw")
        with pa.ipc.open_stream(data) as reader:
            batch = reader.read_next_batch()
        batch.validate(full=True)
    except (KeyError, IndexError, TypeError, OSError, StopIteration, pa.ArrowException) as error:
        raise ValueError(f"a message holds no table ({error})") from error
    entity = (batch.schema.metadata or {}).get(b"rerun:entity_path", b"").decode()
    # Rerun escapes what is no letter, as in the names of blocks that loading inserts
    return entity.replace("\\", ""), batch


def is_static(batch: Any) -> bool:
    """Tell whether a table has no timelines."""
    return not any((f.metadata or {}).get(b"rerun:kind") == b"index" for f in batch.schema)


class RecordingError(AloftError):
    """Raised for a file that is no recording or that is damaged. The message says what to do."""


class NoRunError(RecordingError):
    """Raised for a file of Rerun's that is no recording of a run, such as the motion of a plan."""


class DamagedError(RecordingError):
    """Raised for a recording with bytes that are not what was written; names the lost ticks."""


def scanned(path: Path) -> Scan:
    """Look through a file and verify its checksums.

    Raises:
        OSError: it cannot be read.
        RecordingError: it is not a Rerun file.
    """
    try:
        return scan(path)
    except ValueError as error:
        why = "it does not begin like a file of Rerun's"
        if path.read_bytes()[:4] == MAGIC:
            why = f"Rerun cannot read it, perhaps because it was cut off early ({error})"
        raise RecordingError(f"{path} is not a recording: {why}") from None


def expect_intact(found: Scan) -> None:
    """Raise ``DamagedError`` if something in the file is not what was written."""
    if found.damage:
        places = "; ".join(map(str, found.damage[:3]))
        more = f"; and {len(found.damage) - 3} more" if len(found.damage) > 3 else ""
        raise DamagedError(
            f"{found.path} is damaged: {places}{more}. 'aloft log repair {found.path}' keeps all "
            "the rest"
        )


def tables(
    found: Scan, content: Content, entity: str, *, static: bool = False
) -> Iterator[tuple[str, Any]]:
    """Yield entity and Arrow record batch of all tables of an entity, or of those below
    ``entity/**``.

    Raises:
        RecordingError: a message holds something else than Rerun writes.
    """
    for _, name, batch in located(found, content):
        inside = entity.endswith("/**") and name.startswith(entity[:-2])
        if (inside or name == entity) and is_static(batch) == static:
            yield name, batch


def located(found: Scan, content: Content) -> Iterator[tuple[FileMessage, str, Any]]:
    """Yield message, entity and record batch of all messages with that content."""
    if not found.sealed:
        for message in found.of(content):
            yield message, *found.chunks[message.place]
        return
    with found.path.open("rb") as file:
        for message in found.of(content):
            try:
                name, batch = table_of(body_of(file, message))
            except ValueError as error:
                raise unreadable(found, message, error) from error
            yield message, name, batch


def unreadable(found: Scan, message: FileMessage, error: Exception) -> RecordingError:
    """Make the error for a message that cannot be taken apart."""
    return RecordingError(
        f"{found.path} cannot be read at byte {message.place} ({error}); the file is damaged there"
    )


def tables_at(found: Scan, message: FileMessage) -> tuple[str, Any]:
    """Read entity and record batch of one message. Raises ``RecordingError``."""
    assert message.kind == ARROW
    if not found.sealed:
        return found.chunks[message.place]
    with found.path.open("rb") as file:
        try:
            return table_of(body_of(file, message))
        except ValueError as error:
            raise unreadable(found, message, error) from error


def all_tables(path: Path, entity: str, *, static: bool = False) -> Iterator[tuple[str, Any]]:
    """Yield entity and record batch of all tables of an entity of any Rerun file; see ``tables``."""
    found = scanned(path)
    for message in found.messages:
        if message.kind == ARROW:
            name, batch = tables_at(found, message)
            inside = entity.endswith("/**") and name.startswith(entity[:-2])
            if (inside or name == entity) and is_static(batch) == static:
                yield name, batch
