"""The curve through the values that are written is the curve through all, but for what one can see."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aloft.logs.file.thinned_rows import ThinnedRows, on_lines

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
