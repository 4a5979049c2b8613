"""The messages of a link: raw fields behind a header that identifies them and has their checksum.

A message is a header of ``HEADER`` bytes and the payload: the bytes of the link's fields as they lie
in the bus, section by section. The header holds, in little endian,

==============  =====  ===========================================================================
``checksum``    u32    CRC-32 of all that follows
``size``        u32    the bytes of the payload
``schema``      8 B    the hash of names, types, shapes, units and frames of the fields
``run``         8 B    a number that the sender draws anew for each run, so that old messages
                       are recognised
``sequence``    u64    counts the messages of the link, from zero
``tick``        i64    the tick in which the source ran
``time``        i64    the sender's monotonic clock [ns] when the message was made
==============  =====  ===========================================================================
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from hashlib import blake2b
from struct import Struct
from typing import NamedTuple
from zlib import crc32

from ..language.layout import Layout
from ..placement.placed import MachineLink

_HEAD = Struct("<II8s8sQqq")
_FIELDS = Struct("<I8s8sQqq")
_CHECKSUM = Struct("<I")
HEADER = _HEAD.size
"""Bytes of the header."""


class Message(NamedTuple):
    """A message that was received whole."""

    sequence: int
    tick: int
    time: int
    payload: memoryview


class DamagedMessageError(ValueError):
    """A message was cut, changed on its way, or is of another link or run."""


def schema_of(link: MachineLink) -> bytes:
    """Return the schema hash of a link, 8 bytes."""
    lines = [field.describe() for field in link.fields]
    return blake2b(json.dumps(lines).encode(), digest_size=8).digest()


@dataclass(frozen=True)
class FieldSpan:
    """A stretch of bytes that lies without a gap in the bus and in the payload."""

    bus: int
    payload: int
    size: int


def spans_of(link: MachineLink, layout: Layout) -> tuple[FieldSpan, ...]:
    """Return the stretches of a link's fields in the bus; neighbouring fields are one stretch.

    The fields of a port that have one type are neighbours, so a port with fields of one type that
    are all read is one copy.
    """
    places = sorted(layout.byte_range(field.name) for field in link.fields)
    spans: list[FieldSpan] = []
    used = 0
    for first, last in places:
        if spans and spans[-1].bus + spans[-1].size == first:
            before = spans.pop()
            spans.append(FieldSpan(before.bus, before.payload, before.size + last - first))
        else:
            spans.append(FieldSpan(first, used, last - first))
        used += last - first
    return tuple(spans)


class MessageWriter:
    """Makes the messages of one link in one buffer that is made once."""

    def __init__(self, link: MachineLink, layout: Layout, bus: memoryview, run: bytes) -> None:
        self._message = bytearray(HEADER + link.payload)
        self._view = memoryview(self._message)
        payload = self._view[HEADER:]
        self._copies = tuple(
            (payload[span.payload :][: span.size], bus[span.bus :][: span.size])
            for span in spans_of(link, layout)
        )
        self._summed = self._view[_CHECKSUM.size :]
        self._schema, self._run = schema_of(link), run
        self._size = link.payload
        self.sequence = 0

    def write(self, tick: int, time: int) -> bytes:
        """Return the message with the present values of the bus."""
        for target, source in self._copies:
            target[:] = source
        summed = self._summed
        _FIELDS.pack_into(summed, 0, self._size, self._schema, self._run, self.sequence, tick, time)
        _CHECKSUM.pack_into(self._view, 0, crc32(summed))
        self.sequence += 1
        return bytes(self._message)


class MessageReader:
    """Checks the messages of one link and writes their payload into the bus."""

    def __init__(self, link: MachineLink, layout: Layout, bus: memoryview) -> None:
        self._spans = tuple(
            (bus[span.bus :][: span.size], span.payload, span.payload + span.size)
            for span in spans_of(link, layout)
        )
        self._schema = schema_of(link)
        self._length = HEADER + link.payload
        self._size = link.payload
        self.initial = self._payload()
        """The payload that the bus has before the first message."""
        self.run = bytes(8)
        """Run that messages must belong to; set by the handshake."""

    def read(self, data: bytes) -> Message:
        """Read the message in some bytes.

        Raises:
            DamagedMessageError: it is no message of this link and run, or not whole.
        """
        if len(data) != self._length:
            raise DamagedMessageError(f"it has {len(data)} bytes, expected {self._length}")
        view = memoryview(data)
        checksum, size, schema, run, sequence, tick, time = _HEAD.unpack_from(view)
        if size != self._size or checksum != crc32(view[_CHECKSUM.size :]):
            raise DamagedMessageError("its checksum is wrong")
        if schema != self._schema:
            raise DamagedMessageError(
                f"its schema is {schema.hex()}, expected {self._schema.hex()}"
            )
        if run != self.run:
            raise DamagedMessageError(f"it is of run {run.hex()}, expected {self.run.hex()}")
        return Message(sequence, tick, time, view[HEADER:])

    def _payload(self) -> memoryview:
        found = bytearray(self._size)
        for source, first, last in self._spans:
            found[first:last] = source
        return memoryview(bytes(found))

    def write_outputs(self, payload: memoryview) -> None:
        """Write a payload into the bus."""
        for target, first, last in self._spans:
            target[:] = payload[first:last]
