"""Instants in ticks: those that are meant to be on a tick are, after hours, too."""

import numpy as np
import pytest

from aloft.mathematics.ticks import all_in_ticks, first_tick, in_ticks, since_begin


@pytest.mark.parametrize("rate", [3.0, 333.0, 700.0, 1000.0, 8000.0])
def test_instants_on_ticks_are_whole(rate: float) -> None:
    ticks = np.arange(0, 300_000_000, 9_999_991)
    for k in ticks.tolist():
        assert in_ticks(k / rate, 1.0 / rate) == k == first_tick(k / rate, 1.0 / rate)
    assert np.array_equal(all_in_ticks(ticks / rate, 1.0 / rate), ticks)


def test_others_keep_their_place() -> None:
    assert in_ticks(0.00125, 0.001) == pytest.approx(1.25)
    assert first_tick(0.00125, 0.001) == 2
    times = 1.7e9 + np.array([0.0, 0.1])
    assert all_in_ticks(times - times[0], 0.01)[1] != 10.0  # a rounding of the time of day
    assert all_in_ticks(times - times[0], 0.01, 1e-6)[1] == 10.0


def test_periods_that_are_not_whole_begin_on_ticks_that_they_meet() -> None:
    begun = [since_begin(float(k), 0.0, 1000.0 / 3.0) for k in range(0, 3_000_000_000, 1_000_000)]
    assert max(begun) < 1e-6
