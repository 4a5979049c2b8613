"""Fields of protobuf messages, as far as a Rerun file has them: numbers and bytes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

_NUMBER, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5
"""The types of fields that occur."""


def fields(body: bytes) -> Iterator[tuple[int, Any]]:
    """Yield number and value of every field of a message.

    Raises:
        IndexError: it is no message.
    """
    place = 0
    while place < len(body):
        key, place = _number(body, place)
        kind = key & 7
        if kind == _NUMBER:
            value, place = _number(body, place)
            yield key >> 3, value
        elif kind == _BYTES:
            size, place = _number(body, place)
            if size > len(body) - place:
                raise IndexError("a field is longer than its message")
            yield key >> 3, body[place : place + size]
            place += size
        elif kind in (_EIGHT_BYTES, _FOUR_BYTES):
            place += 8 if kind == _EIGHT_BYTES else 4
        else:
            raise IndexError("no protobuf")


def field(number: int, value: int | bytes) -> bytes:
    """Encode a field of a message."""
    if isinstance(value, int):
        return _encoded(number << 3 | _NUMBER) + _encoded(value)
    return _encoded(number << 3 | _BYTES) + _encoded(len(value)) + value


def _number(body: bytes, place: int) -> tuple[int, int]:
    """Read a whole number of variable length; return it and the place behind it."""
    value = 0
    for shift in range(0, 64, 7):
        byte = body[place]
        place += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, place
    raise IndexError("a number is longer than 64 bits")


def _encoded(value: int) -> bytes:
    """Encode a whole number in its variable length."""
    data = bytearray()
    while value > 127:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes((*data, value))
