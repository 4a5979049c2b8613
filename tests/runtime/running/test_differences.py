"""Bytes compared: the first difference by tick and order of execution, counts, sizes, ULP."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.runtime.language.layout import Layout, PortLayout
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.differences import (
    RowComparison,
    Translation,
    common_names,
    ulp_distance,
    ulp_distances,
)

finite = st.floats(allow_nan=False, allow_infinity=False)


class Mixed(Signal):
    x = Field((2, 2), text="floats")
    n = Field(3, dtype="int64", text="whole numbers")
    on = Field(dtype="bool", text="a flag")


LAYOUT = Layout.of([PortLayout("late.y", Mixed, {}), PortLayout("early.y", Mixed, {})])
TICKS = np.arange(10, 15, dtype=np.int64)


def rows() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 2, (5, LAYOUT.size)).astype(np.uint8)


def put(data: np.ndarray, name: str, index: tuple[int, ...], value: float) -> np.ndarray:
    """The rows with one element set."""
    first, last = LAYOUT.byte_range(name)
    out = data.copy()
    view = LAYOUT.view(out, name).copy()
    view[index] = value
    out[:, first:last] = view.reshape(5, -1).view(np.uint8).reshape(5, -1)
    return out


@given(finite)
def test_neighbours_are_one_ulp_apart(x: float) -> None:
    above = math.nextafter(x, math.inf)
    if math.isfinite(above):
        assert ulp_distance(x, above) == ulp_distance(above, x) == 1


@given(finite, finite, finite)
def test_distances_add_up_along_the_line(a: float, b: float, c: float) -> None:
    low, middle, high = sorted((a, b, c))
    parts = [ulp_distance(low, middle), ulp_distance(middle, high)]
    assert sum(p for p in parts if p is not None) == ulp_distance(low, high)


def test_special_numbers() -> None:
    assert ulp_distance(-0.0, 0.0) == 0
    assert ulp_distance(5e-324, -5e-324) == 2
    assert ulp_distance(math.nan, 1.0) is None
    largest = np.finfo(np.float64).max
    assert ulp_distance(largest, math.inf) == 1
    assert ulp_distances(np.array([-math.inf]), np.array([math.inf]))[0] == 2 * 0x7FF0000000000000


def test_equal_rows() -> None:
    comparison = RowComparison(LAYOUT, ["early", "late"])
    comparison.add(TICKS, rows(), rows())
    assert comparison.first is None and comparison.elements == 0 and comparison.compared == 5


def test_the_first_difference_is_the_earliest_and_upstream() -> None:
    base = put(rows(), "late.y.x", (2, 1, 0), 1.0)
    base = put(base, "early.y.x", (2, 0, 1), 1.0)
    other = put(base, "late.y.x", (2, 1, 0), 1.0 + 2**-52)
    other = put(other, "early.y.x", (2, 0, 1), 1.0 - 2**-52)
    other = put(other, "early.y.x", (4, 0, 0), 7.0)
    other = put(other, "late.y.n", (3, 2), 12)
    comparison = RowComparison(LAYOUT, ["early", "late"])
    comparison.add(TICKS[:2], base[:2], other[:2])
    comparison.add(TICKS[2:], base[2:], other[2:])
    first = comparison.first
    assert first is not None and (first.tick, first.place) == (12, "early.y.x[0, 1]")
    assert (first.recorded, first.replayed, first.ulps) == (1.0, 1.0 - 2**-52, 2)
    assert str(first) == (
        "tick 12: block 'early': early.y.x[0, 1] was 1.0, is 0.9999999999999998, 2 ULP apart"
    )
    assert comparison.elements == 4
    (name, worst), *_ = comparison.largest()
    assert name == "late.y.n" and worst.largest_tick == 13 and worst.first.ulps is None
    assert comparison.fields["early.y.x"].ticks == 2


def test_nan_equals_itself_and_the_sign_of_zero_counts() -> None:
    base = put(rows(), "late.y.x", (0, 0, 0), math.nan)
    comparison = RowComparison(LAYOUT, ["early", "late"])
    comparison.add(TICKS, base, base.copy())
    assert comparison.first is None
    comparison.add(TICKS, base, put(base, "late.y.x", (0, 0, 0), 1.0))
    zero = put(base, "early.y.x", (1, 0, 0), 0.0)
    comparison.add(TICKS, zero, put(zero, "early.y.x", (1, 0, 0), -0.0))
    assert comparison.fields["late.y.x"].first.ulps is None
    assert comparison.fields["early.y.x"].first.ulps == 0
    assert comparison.elements == 2


def test_only_some_fields() -> None:
    base = rows()
    comparison = RowComparison(LAYOUT, ["early", "late"], names=["early.y.n"])
    comparison.add(TICKS, base, put(base, "late.y.x", (0, 0, 0), 5.0))
    assert comparison.first is None


def test_rows_of_another_layout_are_compared_where_both_have_a_field() -> None:
    class Newer(Signal):
        n = Field(3, dtype="int64", text="as it was")
        x = Field(4, text="of another shape")
        z = Field(text="new")

    newer = Layout.of([PortLayout("late.y", Newer, {})])
    same, notes = common_names(LAYOUT, newer)
    assert same == ["late.y.n"]
    assert "late.y.x was float64[2, 2] and is float64[4]" in notes
    assert "late.y.on is in the recording only" in notes and "late.y.z is new" in notes
    translation = Translation(LAYOUT, newer)
    data = put(rows(), "late.y.n", (3, 1), 99)
    out = translation.rows(data)
    np.testing.assert_array_equal(newer.view(out, "late.y.n"), LAYOUT.view(data, "late.y.n"))
    one = np.zeros(newer.size, np.uint8)
    translation.write(data[3], one)
    assert one.tobytes() == out[3].tobytes()
    same_layout = Translation(LAYOUT, LAYOUT)
    assert same_layout.rows(data) is data


@pytest.mark.parametrize("names", [None, ["late.y.n"]])
def test_write_some(names: list[str] | None) -> None:
    translation = Translation(LAYOUT, LAYOUT)
    out = np.zeros(LAYOUT.size, np.uint8)
    data = np.ones((1, LAYOUT.size), np.uint8)
    translation.write(data[0], out, names and dict.fromkeys(names))
    wrote = {
        n
        for n in LAYOUT.slots
        if LAYOUT.view(out, n).tobytes() != bytes(LAYOUT.view(out, n).nbytes)
    }
    assert wrote == set(names or LAYOUT.slots)
