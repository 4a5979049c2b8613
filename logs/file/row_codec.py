"""Packs the rows of some ticks, every bit of them, into few bytes.

Rows of neighbouring ticks are alike, and so are many words of one row. So the words of eight bytes
that change are predicted, and what is left is kept: as whole numbers, zigzag
coded so that small ones have many leading zeros, ordered by byte, then by column, then by tick, with
columns side by side that have as many bits left. Then it is compressed with Zstandard. Words that
do not change are kept once.

A column is one word of eight bytes in every row. It is taken as a whole number that grows with the
float in it (``ordered``), so the difference of two floats that are nearly equal is a small number.
A column is predicted from its own last values, by differences of order 1 to 3 over time, or from
another column: the difference between both, of order 0 to 2 over time. Much on a bus is nearly or
exactly equal to something else, or to its negative: a measured and a true angle, a command and what
the safety monitor passes on, the upper and the lower half of a mass matrix. Which predictions are
good is estimated in a few short stretches. A poor choice costs bytes; what is read back is exact
with any.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from struct import Struct
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int64]

MOST_ORDER = 3
STRETCHES, STRETCH = 6, 8
"""How many stretches are looked at, and the ticks of each."""
LEAST_GAIN = 1.0
"""Bits a value that another column must save, or else a column is predicted from itself."""


@dataclass(frozen=True)
class ColumnPrediction:
    """How each of ``n`` columns is predicted.

    Attributes:
        order: of the differences over time, (n,), 0 to 3.
        source: the column from which it is predicted, (n,); its own number if from none.
        negative: whether the source's negative is meant, (n,).
        bits: about how many bits a value are left, in halves, (n,): alike columns lie together.
    """

    order: NDArray[np.uint8]
    source: NDArray[np.int32]
    negative: NDArray[np.bool_]
    bits: NDArray[np.uint8]


def ordered(words: NDArray[np.int64]) -> Words:
    """The bits of floats as whole numbers that grow with the floats; its own inverse.

    The number of -x is minus one minus that of x.
    """
    result: Words = words ^ ((words >> 63) & np.int64(0x7FFFFFFFFFFFFFFF))
    return result


def predict(columns: Words) -> ColumnPrediction:
    """A good prediction of ``columns`` (n, ticks), which are ``ordered``."""
    count, ticks = columns.shape
    starts = np.unique(np.linspace(0, max(0, ticks - STRETCH), STRETCHES).astype(np.int64))
    places = np.minimum(starts[:, None] + np.arange(STRETCH), ticks - 1)
    sample = columns[:, places]
    costs = np.stack([_bits(sample, order) for order in range(1, MOST_ORDER + 1)])
    order, best = costs.argmin(axis=0) + 1, costs.min(axis=0)
    source, negative = np.arange(count, dtype=np.int32), np.zeros(count, np.bool_)
    if count > 1:
        _attach(list(_pairs(sample)), sample, order, best, source, negative)
    bits = np.minimum(np.round(2.0 * best), 255.0)
    return ColumnPrediction(order.astype(np.uint8), source, negative, bits.astype(np.uint8))


def _bits(sample: Words, order: int) -> NDArray[np.float64]:
    """The mean number of bits, (n,), of differences of an order of ``sample`` (n, stretches, ticks).

    As many values are looked at for any order.
    """
    left = sample[:, :, MOST_ORDER - order :]
    for _ in range(order):
        left = left[:, :, 1:] - left[:, :, :-1]
    mean: NDArray[np.float64] = np.frexp(np.abs(left.astype(np.float64)))[1].mean(axis=(1, 2))
    return mean


def _pairs(
    sample: Words,
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]]:
    """Pairs of columns that may be alike, and whether one is like the other's negative.

    Columns of nearly equal values, or of nearly equal changes, lie side by side when sorted by them.
    """
    with np.errstate(all="ignore"):
        values = ordered(sample).view(np.float64)
        half = len(values[0]) // 2
        keys = (
            values[:, half, 3],
            values[:, -1, 5],
            values[:, half, 4] - values[:, half, 3],
            values[:, -1, 7] - values[:, -1, 2],
        )
        for key in keys:
            by_size = np.argsort(np.abs(key), kind="stable")
            one, other = by_size[1:], by_size[:-1]
            yield one, other, np.signbit(key[one]) != np.signbit(key[other])


def _attach(
    pairs: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]],
    sample: Words,
    order: NDArray[np.int64],
    best: NDArray[np.float64],
    source: NDArray[np.int32],
    negative: NDArray[np.bool_],
) -> None:
    """Give columns a source where that saves most; changes the last four. There are no circles."""
    one, other, opposite = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    near = sample[other]
    left = sample[one] - np.where(opposite[:, None, None], ~near, near)
    costs = np.stack([_bits(left, k) for k in range(MOST_ORDER)])
    orders, cost = costs.argmin(axis=0), costs.min(axis=0)
    gain = np.maximum(best[one], best[other]) - cost
    tree = list(range(len(order)))

    def root(column: int) -> int:
        while tree[column] != column:
            tree[column] = column = tree[tree[column]]
        return column

    for k in np.argsort(-gain, kind="stable").tolist():
        if gain[k] < LEAST_GAIN:
            return
        a, b = int(one[k]), int(other[k])
        if best[a] < best[b]:
            a, b = b, a  # the dearer one is predicted from the cheaper one
        if source[a] != a and source[b] == b and best[b] - cost[k] >= LEAST_GAIN:
            a, b = b, a
        if source[a] == a and best[a] - cost[k] >= LEAST_GAIN and root(a) != root(b):
            tree[root(a)] = root(b)
            source[a], negative[a] = b, opposite[k]
            order[a], best[a] = orders[k], cost[k]


_HEAD = Struct("<4sIIqI")
"""A mark, the number of ticks, the bytes of a row, the first tick, and the CRC-32 of the rows."""
_MARK = b"rowp"
_SIZES = Struct("<II")
"""Behind the head: the number of columns that change, and the bytes before compression."""
_NEGATIVE = 16
"""Added to the order of a column that is predicted from the negative of another."""
LEVEL = 3
"""Of Zstandard; higher levels save 1 % at three times the work."""


def pack(first: int, rows: NDArray[np.uint8]) -> bytes:
    """The packed ``rows`` (n, bytes) of the ``n`` ticks from ``first`` on."""
    import pyarrow as pa

    count, size = rows.shape
    words = np.zeros((count, -(-size // 8) * 8), np.uint8)
    words[:, :size] = rows
    whole = words.view(np.int64)
    changing = (whole != whole[:1]).any(axis=0)
    columns = ordered(np.ascontiguousarray(whole[:, changing].T))
    how = predict(columns)
    left = _left(columns, how)
    planes = left[np.argsort(how.bits, kind="stable")].view(np.uint8)
    parts = (
        np.packbits(changing).tobytes(),
        whole[0, ~changing].tobytes(),
        (how.order + _NEGATIVE * how.negative.astype(np.uint8)).tobytes(),
        how.bits.tobytes(),
        how.source.tobytes(),
        planes.reshape(len(columns), count, 8).transpose(2, 0, 1).tobytes(),
    )
    flat = b"".join(parts)
    packed: bytes = pa.Codec("zstd", compression_level=LEVEL).compress(flat, asbytes=True)
    head = _HEAD.pack(_MARK, count, size, first, crc32(rows.tobytes()))
    return head + _SIZES.pack(len(columns), len(flat)) + packed


def _left(columns: Words, how: ColumnPrediction) -> Words:
    """What of ``columns`` (n, ticks) is left by their prediction, zigzag coded."""
    left = columns.copy()
    others = np.flatnonzero(how.source != np.arange(len(columns)))
    near = columns[how.source[others]]
    left[others] -= np.where(how.negative[others, None], ~near, near)
    for order in range(1, MOST_ORDER + 1):
        those = np.flatnonzero(how.order >= order)
        left[those, 1:] = np.diff(left[those], axis=1)
    zigzag: Words = (left << 1) ^ (left >> 63)
    return zigzag


def unpack(data: bytes) -> tuple[int, NDArray[np.uint8]]:
    """The first tick and the rows (n, bytes).

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
    """The first tick and the bytes from ``begin`` up to, without, ``end`` of each row, (n, bytes).

    Raises:
        ValueError: the bytes are not packed rows.
    """
    low = begin // 8
    words = _words(data, begin, end)
    return _head(data)[3], np.ascontiguousarray(words[:, begin - 8 * low : end - 8 * low])


def _head(data: bytes) -> tuple[bytes, int, int, int, int]:
    """Mark, number of ticks, bytes of a row, first tick, CRC-32. Raises ``ValueError``."""
    if len(data) < _HEAD.size + _SIZES.size or data[:4] != _MARK:
        raise ValueError("these bytes are no packed rows")
    mark, count, size, first, crc = _HEAD.unpack_from(data)
    return mark, count, size, first, crc


def _decompressed(packed: bytes, size: int) -> bytes:
    import pyarrow as pa

    try:
        flat: bytes = pa.Codec("zstd").decompress(packed, size, asbytes=True)
    except (OSError, pa.ArrowException, MemoryError) as error:
        raise ValueError(f"packed rows cannot be unpacked ({error})") from error
    return flat


def _words(data: bytes, begin: int, end: int) -> NDArray[np.uint8]:
    """The words of each row that have the bytes from ``begin`` to ``end``, as bytes, (n, bytes)."""
    _, count, size, _, _ = _head(data)
    changes, length = _SIZES.unpack_from(data, _HEAD.size)
    flat = _decompressed(data[_HEAD.size + _SIZES.size :], length)
    width = -(-size // 8)
    sizes = (
        -(-width // 8),
        8 * (width - changes),
        changes,
        changes,
        4 * changes,
        8 * changes * count,
    )
    if changes > width or sum(sizes) != length:
        raise ValueError("packed rows have not the size that they say")
    places = np.cumsum((0, *sizes)).tolist()
    mask, constant, kind, bits, source, planes = (
        np.frombuffer(flat, np.uint8, size, place)
        for size, place in zip(sizes, places, strict=False)
    )
    changing = np.unpackbits(mask, count=width).astype(np.bool_)
    if int(changing.sum()) != changes:
        raise ValueError("packed rows have not as many columns as they say")
    how = ColumnPrediction(kind % _NEGATIVE, source.view(np.int32), kind >= _NEGATIVE, bits)
    low, high = begin // 8, -(-end // 8)
    number = np.cumsum(changing) - 1  # of a column that changes, among those that do
    wanted = np.zeros(changes, np.bool_)
    wanted[number[low:high][changing[low:high]]] = True
    found = np.empty((high - low, count), np.int64)
    here = changing[low:high]
    steady = (np.cumsum(~changing) - 1)[low:high][~here]
    found[~here] = constant.view(np.int64)[steady, None]
    found[here] = ordered(_columns(planes.reshape(8, changes, count), how, wanted))
    return np.ascontiguousarray(found.T).view(np.uint8)


def _columns(planes: NDArray[np.uint8], how: ColumnPrediction, wanted: NDArray[np.bool_]) -> Words:
    """Those columns that are ``wanted`` (n,), (some, ticks), from the bytes of all (8, n, ticks)."""
    count = len(how.order)
    if (how.source >= count).any() or (how.source < 0).any() or (how.order > MOST_ORDER).any():
        raise ValueError("packed rows have a prediction that there is not")
    alone = how.source == np.arange(count)
    needed, more = wanted.copy(), wanted
    while more.any():  # what these columns are predicted from
        sources = np.zeros(count, np.bool_)
        sources[how.source[more]] = True
        more = sources & ~needed
        needed |= more
    as_packed = np.argsort(how.bits, kind="stable")
    kept = needed[as_packed]
    those = as_packed[kept]
    left = np.empty((len(those), planes.shape[2], 8), np.uint8)
    for k in range(8):
        left[:, :, k] = planes[k] if kept.all() else planes[k, kept]
    zigzag = left.view(np.uint64)[:, :, 0]
    signs = (zigzag & np.uint64(1)).view(np.int64)
    np.negative(signs, out=signs)
    zigzag >>= np.uint64(1)
    columns = zigzag.view(np.int64)
    columns ^= signs
    for order in range(MOST_ORDER, 0, -1):
        some = np.flatnonzero(how.order[those] >= order)
        columns[some] = np.cumsum(columns[some], axis=1)
    here = np.zeros(count, np.int64)
    here[those] = np.arange(len(those))
    done, waiting = alone.copy(), those[~alone[those]]
    while len(waiting):
        ready = done[how.source[waiting]]
        if not ready.any():
            raise ValueError("packed rows have columns that are predicted from one another")
        now = waiting[ready]
        near = columns[here[how.source[now]]]
        columns[here[now]] += np.where(how.negative[now, None], ~near, near)
        done[now] = True
        waiting = waiting[~ready]
    result: Words = columns[here[np.flatnonzero(wanted)]]
    return result
