"""Packs the rows of some ticks, every bit of them, into few bytes.

Rows of neighbouring ticks are alike. So each word of eight bytes is combined by exclusive or with
the same word of the tick before, the bytes are ordered by word, then by their place in the word,
then by tick, and the result is compressed with Zstandard.
"""

from __future__ import annotations

from struct import Struct
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

_HEAD = Struct("<4sIIqI")
"""A mark, the number of ticks, the bytes of a row, the first tick, and the CRC-32 of the rows."""
_MARK = b"rows"
LEVEL = 3
"""Of Zstandard; higher levels save 1 % at three times the work."""


def pack(first: int, rows: NDArray[np.uint8]) -> bytes:
    """The packed ``rows`` (n, bytes) of the ``n`` ticks from ``first`` on."""
    import pyarrow as pa

    count, size = rows.shape
    words = np.zeros((count, -(-size // 8) * 8), np.uint8)
    words[:, :size] = rows
    whole = words.view(np.uint64)
    changes = whole.copy()
    changes[1:] ^= whole[:-1]
    planes = changes.view(np.uint8).reshape(count, -1, 8).transpose(1, 2, 0)
    codec = pa.Codec("zstd", compression_level=LEVEL)
    packed: bytes = codec.compress(planes.tobytes(), asbytes=True)
    return _HEAD.pack(_MARK, count, size, first, crc32(rows.tobytes())) + packed


def unpack(data: bytes) -> tuple[int, NDArray[np.uint8]]:
    """The first tick and the rows (n, bytes).

    Raises:
        ValueError: the bytes are not packed rows, or give other rows than were packed.
    """
    import pyarrow as pa

    if len(data) < _HEAD.size or data[:4] != _MARK:
        raise ValueError("these bytes are no packed rows")
    _, count, size, first, crc = _HEAD.unpack_from(data)
    width = -(-size // 8)
    try:
        flat = pa.Codec("zstd").decompress(data[_HEAD.size :], count * width * 8, asbytes=True)
    except (OSError, pa.ArrowException, MemoryError) as error:
        raise ValueError(f"packed rows cannot be unpacked ({error})") from error
    planes = np.frombuffer(flat, np.uint8).reshape(width, 8, count)
    words = planes.transpose(2, 0, 1).copy().reshape(count, width * 8)
    whole = words.view(np.uint64)
    np.bitwise_xor.accumulate(whole, axis=0, out=whole)
    rows = np.ascontiguousarray(words[:, :size])
    if crc32(rows.tobytes()) != crc:
        raise ValueError("unpacked rows are not those that were packed")
    return first, rows
