"""Interpolation against NumPy and SciPy, and exact on what is linear."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from aloft.mathematics.lookup import interpolate, interpolate_grid


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
