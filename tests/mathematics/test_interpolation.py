"""Interpolation against NumPy and SciPy, and exact on what is linear."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from aloft.mathematics.interpolation import interpolate, interpolate_grid, minimum_jerk, quintic


@settings(max_examples=20, deadline=None)
@given(st.floats(-3.0, 8.0))
def test_one_dimension(at: float) -> None:
    x, y = np.array([-1.0, 0.0, 0.5, 4.0]), np.array([2.0, -1.0, 3.0, 5.0])
    assert interpolate(x, y, at, True) == pytest.approx(np.interp(at, x, y), abs=1e-12)
    line = interpolate(x, 3.0 * x - 1.0, at, False)
    assert line == pytest.approx(3.0 * at - 1.0, abs=1e-10)


@settings(max_examples=20, deadline=None)
@given(st.tuples(st.floats(-2, 4), st.floats(-2, 4), st.floats(-2, 4)))
def test_three_dimensions(at: tuple[float, float, float]) -> None:
    axes = [np.array([0.0, 1.0, 3.0]), np.array([-1.0, 2.0]), np.array([0.0, 0.5, 1.0, 2.0])]
    table = np.random.default_rng(0).normal(size=(3, 2, 4))
    counts, scratch = np.array([3, 2, 4]), (np.zeros(3, np.int64), np.zeros(3))
    expected = RegularGridInterpolator(axes, table, bounds_error=False, fill_value=None)
    found = interpolate_grid(
        np.concatenate(axes), counts, table.ravel(), np.array(at), False, *scratch
    )
    assert found == pytest.approx(expected([at]).item(), abs=1e-9)
    inside = [min(max(v, a[0]), a[-1]) for v, a in zip(at, axes, strict=True)]
    found = interpolate_grid(
        np.concatenate(axes), counts, table.ravel(), np.array(at), True, *scratch
    )
    assert found == pytest.approx(expected([inside]).item(), abs=1e-9)


states = st.tuples(*[st.floats(-10, 10)] * 3)


@given(st.floats(0.05, 2.0), states, states)
def test_quintic_meets_both_ends(duration, start, end):
    path = quintic(duration, start, end)
    size = 1.0 + max(map(abs, (*start, *end)))
    for time, wanted in ((0.0, start), (duration, end)):
        found = (path.position(time), path.velocity(time), path.acceleration(time))
        scale = size * max(1.0, duration**-2)
        assert found == pytest.approx(wanted, abs=1e-9 * scale)


def test_quintic_derivatives_are_those_of_the_position():
    path, step = quintic(0.4, (0.1, -2.0, 3.0), (0.5, 1.0, 0.0)), 1e-5
    for time in (0.05, 0.2, 0.33):
        around = [path.position(time + k * step) for k in (-1, 0, 1)]
        assert path.velocity(time) == pytest.approx((around[2] - around[0]) / (2 * step), rel=1e-6)
        bend = (around[2] - 2 * around[1] + around[0]) / step**2
        assert path.acceleration(time) == pytest.approx(bend, rel=1e-3)


def test_minimum_jerk_at_known_shares():
    assert minimum_jerk(0.5) == (0.5, 1.875, 0.0)
    for share, value in ((-1.0, 0.0), (0.0, 0.0), (1.0, 1.0), (7.0, 1.0)):
        assert minimum_jerk(share) == (value, 0.0, 0.0)


@given(st.floats(0.0, 1.0))
def test_minimum_jerk_is_symmetric_and_rises(share):
    there, rate, _ = minimum_jerk(share)
    back, rate_back, _ = minimum_jerk(1.0 - share)
    assert there == pytest.approx(1.0 - back, abs=1e-12)
    assert rate == pytest.approx(rate_back, abs=1e-12)
    assert rate >= 0.0


def test_minimum_jerk_derivatives():
    for share in (0.1, 0.4, 0.8):
        near, far = minimum_jerk(share - 1e-5), minimum_jerk(share + 1e-5)
        _, rate, bend = minimum_jerk(share)
        assert rate == pytest.approx((far[0] - near[0]) / 2e-5, rel=1e-6)
        assert bend == pytest.approx((far[1] - near[1]) / 2e-5, rel=1e-6)
