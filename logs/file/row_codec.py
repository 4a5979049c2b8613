"""Packs the rows of some ticks, every bit of them, into few bytes.

Rows of neighbouring ticks are alike, and so are many words of one row. A column is one word of eight
bytes in every row, taken as a whole number. Of the columns that change, the second differences over
time are kept: a signal that changes evenly has small ones. They are zigzag coded, so that small ones
have leading zeros, and ordered by byte, then by column, then by tick; equal signals so become equal
stretches of bytes. Then all is compressed with Zstandard. Words that do not change are kept once.

``aloft bench recorder`` compares it with Arrow's own compression, of which neither a stream of record
batches nor Parquet finds what columns have in common.
"""

from __future__ import annotations

from struct import Struct
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int64]

ORDER = 2
"""Order of the differences over time."""
LEVEL = 3
"""Level of Zstandard; higher ones save 1 % at three times the work."""
_HEAD = Struct("<4sIIqI")
"""A mark, the number of ticks, the bytes of a row, the first tick, and the CRC-32 of the rows."""
_MARK = b"rowp"
MOST_BYTES = 1 << 26
"""Bytes of the rows that are packed together, but that one row may have more."""
MOST_OF_ROW = 1 << 30
"""Bytes of a row that is read."""
_BUS = Struct("<Q")
"""Before a keyframe: the bytes of its bus."""
_SIZES = Struct("<II")
"""Behind the head: the number of columns that change, and the bytes before compression."""


def pack(first: int, rows: NDArray[np.uint8]) -> bytes:
    """Pack the ``rows`` (n, bytes) of the ``n`` ticks from ``first`` on."""
    import pyarrow as pa  # comes with Rerun

    count, size = rows.shape
    rows = np.ascontiguousarray(rows)
    words = rows if size % 8 == 0 else np.pad(rows, ((0, 0), (0, -size % 8)))
    whole = words.view(np.int64)
    changing = (whole != whole[:1]).any(axis=0)
    columns = np.compress(changing, whole, axis=1)
    for _ in range(ORDER):
        columns[1:] -= columns[:-1].copy()
    signs = columns >> 63
    columns <<= 1
    columns ^= signs
    start = np.concatenate([np.packbits(changing), whole[0, ~changing].view(np.uint8)])
    changes = columns.shape[1]
    flat = np.empty(len(start) + columns.nbytes, np.uint8)
    flat[: len(start)] = start
    planes = flat[len(start) :].reshape(8, changes, count)
    planes[:] = columns.view(np.uint8).reshape(count, changes, 8).transpose(2, 1, 0)
    packed: bytes = pa.Codec("zstd", compression_level=LEVEL).compress(flat, asbytes=True)
    head = _HEAD.pack(_MARK, count, size, first, crc32(rows.data))
    return head + _SIZES.pack(changes, len(flat)) + packed


def unpack(data: bytes) -> tuple[int, NDArray[np.uint8]]:
    """Unpack the first tick and the rows (n, bytes).

    Raises:
        ValueError: the bytes are not packed rows, or give other rows than were packed.
    """
    _, _, size, first, crc = _head(data)
    rows = _words(data, 0, size)
    rows = np.ascontiguousarray(rows[:, :size])
    if crc32(rows.data) != crc:
        raise ValueError("unpacked rows are not those that were packed")
    return first, rows


def unpack_bytes(data: bytes, begin: int, end: int) -> tuple[int, NDArray[np.uint8]]:
    """Unpack the first tick and the bytes from ``begin`` up to, without, ``end`` of each row, (n,
    bytes).

    Raises:
        ValueError: the bytes are not packed rows.
    """
    low = begin // 8
    words = _words(data, begin, end)
    return _head(data)[3], np.ascontiguousarray(words[:, begin - 8 * low : end - 8 * low])


def pack_keyframe(bus: bytes, state: bytes) -> tuple[bytes, int]:
    """Compress bus and state; return them and their size before."""
    import pyarrow as pa

    whole = _BUS.pack(len(bus)) + bus + state
    return pa.Codec("zstd", compression_level=LEVEL).compress(whole, asbytes=True), len(whole)


def unpack_keyframe(data: bytes, size: int) -> tuple[bytes, bytes]:
    """Return the bus and the state of a keyframe of ``size`` bytes. Raises ``ValueError``."""
    if not _BUS.size <= size <= 2 * MOST_OF_ROW + _BUS.size:
        raise ValueError(f"a keyframe cannot have {size} bytes")
    whole = _decompressed(data, size)
    behind = _BUS.size + _BUS.unpack_from(whole)[0]
    if behind > size:
        raise ValueError("a keyframe has not the bus that it says")
    return whole[_BUS.size : behind], whole[behind:]


def _head(data: bytes) -> tuple[bytes, int, int, int, int]:
    """Read mark, number of ticks, bytes of a row, first tick, CRC-32. Raises ``ValueError``."""
    if len(data) < _HEAD.size + _SIZES.size or data[:4] != _MARK:
        raise ValueError("these bytes are no packed rows")
    mark, count, size, first, crc = _HEAD.unpack_from(data)
    if size > MOST_OF_ROW or count * size > max(MOST_BYTES, size):
        raise ValueError(
            f"{count} packed rows of {size} bytes are more than the {max(MOST_BYTES, size)} bytes "
            "that are ever packed together"
        )
    return mark, count, size, first, crc


def _decompressed(packed: bytes, size: int) -> bytes:
    import pyarrow as pa

    try:
        flat: bytes = pa.Codec("zstd").decompress(packed, size, asbytes=True)
    except (OSError, pa.ArrowException, MemoryError) as error:
        raise ValueError(f"packed rows cannot be unpacked ({error})") from error
    return flat


def _words(data: bytes, begin: int, end: int) -> NDArray[np.uint8]:
    """Unpack the words of each row that have the bytes from ``begin`` to ``end``, as bytes, (n,
    bytes)."""
    _, count, size, _, _ = _head(data)
    changes, length = _SIZES.unpack_from(data, _HEAD.size)
    width = -(-size // 8)
    sizes = (-(-width // 8), 8 * (width - changes), 8 * changes * count)
    if changes > width or sum(sizes) != length:
        raise ValueError("packed rows have not the size that they say")
    flat = _decompressed(data[_HEAD.size + _SIZES.size :], length)
    places = np.cumsum((0, *sizes)).tolist()
    mask, constant, planes = (
        np.frombuffer(flat, np.uint8, size, place)
        for size, place in zip(sizes, places, strict=False)
    )
    changing = np.unpackbits(mask, count=width).astype(np.bool_)
    if int(changing.sum()) != changes:
        raise ValueError("packed rows have not as many columns as they say")
    low, high = begin // 8, -(-end // 8)
    here = changing[low:high]
    moving = (np.cumsum(changing) - 1)[low:high][here]  # among the columns that change
    steady = (np.cumsum(~changing) - 1)[low:high][~here]
    of_planes = planes.reshape(8, changes, count)
    columns = _columns(
        of_planes if len(moving) == changes else of_planes[:, moving]
    )  # all without a copy
    if here.all():
        return np.ascontiguousarray(columns).view(np.uint8)
    found = np.empty((count, high - low), np.int64)
    found[:, ~here] = constant.view(np.int64)[steady]
    found[:, here] = columns
    return found.view(np.uint8)


def _columns(planes: NDArray[np.uint8]) -> Words:
    """Join the columns (ticks, n) from their bytes (8, n, ticks)."""
    zigzag = np.ascontiguousarray(planes.transpose(2, 1, 0)).view(np.uint64)[:, :, 0]
    signs = -(zigzag & np.uint64(1)).view(np.int64)
    columns: Words = (zigzag >> np.uint64(1)).view(np.int64) ^ signs
    for _ in range(ORDER):
        columns = np.cumsum(columns, axis=0)
    return columns
