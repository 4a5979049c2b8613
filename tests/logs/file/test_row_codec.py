"""Rows packed and read back, bit for bit, and damaged packs."""

import numpy as np
import pytest
from numpy.typing import NDArray

from aloft.logs.file.row_codec import pack, unpack, unpack_bytes

ODD = np.array([0.0, -0.0, np.nan, -np.nan, np.inf, -np.inf, 5e-324, -1.7e308, 1.0])


def rows_of(*columns: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Rows (n, bytes) with these columns (n,)."""
    return np.ascontiguousarray(np.stack(columns, axis=1)).view(np.uint8)


def smooth(ticks: int = 256, shift: float = 0.0) -> NDArray[np.float64]:
    wave: NDArray[np.float64] = np.sin(np.arange(ticks) * 0.01 + shift)
    return wave


@pytest.mark.parametrize("shape", [(1, 8), (1, 3), (2, 17), (5, 0), (3, 1), (513, 70), (8, 24)])
@pytest.mark.parametrize("seed", [0, 1])
def test_any_bytes_come_back(shape: tuple[int, int], seed: int) -> None:
    rows = np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)
    first, found = unpack(pack(7, rows))
    assert first == 7
    np.testing.assert_array_equal(found, rows)


def test_odd_numbers_keep_every_bit() -> None:
    rng = np.random.default_rng(3)
    columns = [rng.choice(ODD, 300) for _ in range(20)]
    columns += [-columns[0], columns[1], np.where(np.isnan(columns[2]), 0.0, columns[2])]
    rows = rows_of(*columns)
    np.testing.assert_array_equal(unpack(pack(0, rows))[1], rows)


def test_a_part_of_each_row_is_read_alone() -> None:
    rng = np.random.default_rng(5)
    base = [smooth(shift=float(k)) + 1e-9 * rng.standard_normal(256) for k in range(6)]
    rows = rows_of(*base, *(-column for column in base), *base, np.full(256, 2.5))
    packed = pack(4000, rows)
    for begin, end in ((0, 8), (3, 21), (48, 96), (90, 150), (144, 152), (0, rows.shape[1])):
        first, part = unpack_bytes(packed, begin, end)
        assert first == 4000
        np.testing.assert_array_equal(part, rows[:, begin:end])


def test_what_is_constant_or_alike_takes_nearly_nothing() -> None:
    noise = np.random.default_rng(1).standard_normal(512)
    one = len(pack(0, rows_of(noise)))
    likes = [noise, -noise, noise.copy(), noise * (1.0 + 1e-15), np.full(512, 3.0)]
    assert len(pack(0, rows_of(*likes))) < 1.2 * one


def test_smooth_signals_take_less_than_noise() -> None:
    noise = np.random.default_rng(1).standard_normal(512)
    assert len(pack(0, rows_of(smooth(512)))) < 0.75 * len(pack(0, rows_of(noise)))


def test_damage_is_a_clear_error() -> None:
    """Whatever byte has changed: it is told as an error, or the rows are right all the same."""
    rng = np.random.default_rng(9)
    base = smooth(64)
    rows = rows_of(base, base + 1e-9, rng.standard_normal(64), -base)
    whole = bytearray(pack(12, rows))
    told = 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        try:
            first, found = unpack(bytes(damaged))
        except ValueError:
            told += 1
        else:
            np.testing.assert_array_equal(found, rows)
            assert first == 12 or 12 <= place < 20, "only the number of the tick may differ"
    assert told > 0.95 * len(whole)
    for cut in (0, 3, 20, 30, len(whole) - 1):
        with pytest.raises(ValueError, match="packed rows"):
            unpack(bytes(whole[:cut]))


@pytest.mark.parametrize(
    ("count", "size", "text"),
    [
        (512, 1 << 20, "ever packed together"),
        (1, 1 << 31, "ever packed together"),
        (8, 64, "not the size"),
    ],
)
def test_rows_that_say_to_be_larger_than_they_can_be(count: int, size: int, text: str) -> None:
    """Nothing is unpacked before its size is known to be possible: 0.85 MB became 6 GB."""
    data = bytearray(pack(0, np.zeros((4, 64), np.uint8)))
    data[4:12] = np.array([count, size], "<u4").tobytes()
    if text == "not the size":
        data[24:32] = np.array([3, 1 << 30], "<u4").tobytes()  # columns that change, bytes
    with pytest.raises(ValueError, match=text):
        unpack(bytes(data))
