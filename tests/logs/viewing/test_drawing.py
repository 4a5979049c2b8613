"""What is left out of a signal comes back bit for bit, and the line drawn through it is the same."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aloft.logs.file.format import spans
from aloft.logs.viewing.drawing import ChangedRows, ThinnedRows, on_lines


def filled(ticks: np.ndarray, written: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The value at each of ``ticks``: the last that was written at or before it."""
    return values[np.searchsorted(written, ticks, side="right") - 1]


ODD = np.array([0.0, -0.0, np.nan, -np.nan, 1.0, np.nextafter(1.0, 2.0)])


@settings(max_examples=60, deadline=None)
@given(
    batches=st.lists(
        st.lists(st.tuples(st.integers(1, 3), st.integers(0, 5), st.integers(0, 1)), min_size=1),
        min_size=1,
        max_size=4,
    )
)
def test_everything_comes_back(batches: list[list[tuple[int, int, int]]]) -> None:
    picker = ChangedRows()
    all_ticks, all_values, written, kept = [], [], [], []
    tick = 0
    for batch in batches:
        ticks = tick + np.cumsum([step for step, *_ in batch])
        tick = int(ticks[-1])
        values = ODD[[[first, second] for _, first, second in batch]]
        some_ticks, some = picker.pick(ticks, values)
        all_ticks.append(ticks), all_values.append(values)
        written.append(some_ticks), kept.append(some)
    whole = np.concatenate(all_values)
    ticks = np.concatenate(all_ticks)
    found = filled(ticks, np.concatenate(written), np.concatenate(kept))
    assert found.tobytes() == whole.tobytes()  # before the rest: as after a kill
    if (rest := picker.rest()) is not None:
        written.append(rest[0]), kept.append(rest[1])
    assert picker.rest() is None
    at = np.concatenate(written)
    assert (np.diff(at) > 0).all() and set(at) <= set(ticks)
    assert at[0] == ticks[0] and at[-1] == ticks[-1]
    for first, last in pairwise(at):  # between two that are there, nothing moves
        between = whole[(ticks >= first) & (ticks <= last)]
        assert len(between) == 2 or len({row.tobytes() for row in between}) == 1


def test_a_constant_is_two_values_and_a_step_four() -> None:
    picker = ChangedRows()
    values = np.zeros((10, 1))
    values[5:] = 1.0
    ticks, kept = picker.pick(np.arange(10), values)
    assert ticks.tolist() == [0, 4, 5] and kept[:, 0].tolist() == [0.0, 0.0, 1.0]
    ticks, _ = picker.pick(np.arange(10, 20), np.ones((10, 1)))
    assert len(ticks) == 0
    ticks, kept = picker.pick(np.arange(20, 21), np.zeros((1, 1)))
    assert ticks.tolist() == [19, 20] and kept[:, 0].tolist() == [1.0, 0.0]


def test_spans_are_the_stretches_without_a_gap() -> None:
    assert spans(np.array([3])).tolist() == [[3, 3]]
    assert spans(np.array([0, 1, 2, 5, 6, 9])).tolist() == [[0, 2], [5, 6], [9, 9]]


Array = NDArray[Any]
TICKS = np.arange(1000)


def drawn(ticks: Array, values: Array, at: Array) -> Array:
    """The line through ``values`` (m, k) as the viewer draws it."""
    line: Array = np.stack([np.interp(at, ticks, column) for column in values.T], axis=1)
    return line


@pytest.mark.parametrize("batch", [1000, 250, 33])
def test_no_value_is_farther_from_the_line_than_the_tolerance(batch: int) -> None:
    noise = np.random.default_rng(0).standard_normal((1000, 2)).cumsum(axis=0)
    values = np.column_stack([100.0 * np.sin(TICKS / 40.0), noise])
    picker = ThinnedRows(0.01)
    found = [
        picker.pick(TICKS[k : k + batch], values[k : k + batch]) for k in range(0, 1000, batch)
    ]
    rest = picker.rest()
    found += [rest] if rest is not None else []
    ticks, kept = (np.concatenate(parts) for parts in zip(*found, strict=True))
    assert (np.diff(ticks) > 0).all()
    np.testing.assert_array_equal(kept, values[ticks])
    assert np.abs(drawn(ticks, kept, TICKS) - values).max() <= 0.01 * np.ptp(values)
    if batch == 1000:
        assert len(ticks) < 300


def test_a_peak_of_one_tick_is_drawn_and_flight_is_flat() -> None:
    force = np.full((1000, 2), 25.0) + 0.001 * np.sin(TICKS / 7.0)[:, None]
    force[400:600] = 0.0
    force[600] = (340.0, 12.0)  # touchdown
    picker = ThinnedRows(1.0 / 400.0)
    ticks, kept = picker.pick(TICKS, force)
    line = drawn(ticks, kept, TICKS)
    assert {399, 400, 599, 600, 601} <= set(ticks.tolist())
    np.testing.assert_array_equal(line[400:600], 0.0)
    np.testing.assert_array_equal(line[600], (340.0, 12.0))
    assert len(ticks) < 20


def test_a_constant_signal_is_two_values() -> None:
    picker = ThinnedRows(0.01)
    ticks, _ = picker.pick(TICKS, np.ones((1000, 1)))
    rest = picker.rest()
    assert rest is not None
    assert [*ticks.tolist(), *rest[0].tolist()] == [0, 999]
    assert picker.rest() is None


def test_what_is_no_number_is_not_left_out() -> None:
    values = np.sin(TICKS / 40.0)[:, None]
    values[500:510] = np.nan
    values[700] = np.inf
    ticks, kept = ThinnedRows(0.01).pick(TICKS, values)
    assert {499, 500, 509, 510, 700} <= set(ticks.tolist())
    np.testing.assert_array_equal(kept, values[ticks])


def test_a_straight_line_needs_its_ends_only() -> None:
    needed = on_lines(
        np.array([0, 1, 5, 9, 10]), np.array([[0.0], [1.0], [5.0], [9.0], [10.0]]), 1e-9
    )
    assert needed.tolist() == [True, False, False, False, True]
