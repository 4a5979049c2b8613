"""Filters have the responses of their continuous models at the frequency they are prewarped for."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.mathematics.second_order_filter import (
    advance,
    band_stop,
    first_order,
    second_order,
    settle,
)

T = 0.002


def response(c: np.ndarray, frequency: float) -> complex:
    z = np.exp(-2j * np.pi * frequency * T)
    return complex((c[0] + c[1] * z + c[2] * z * z) / (1 + c[3] * z + c[4] * z * z))


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 240.0), st.booleans())
def test_gains_at_the_cutoff_and_far_from_it(cutoff: float, high: bool) -> None:
    c = np.zeros(5)
    for order in (1, 2):
        if order == 1:
            first_order(cutoff, T, high, c)
        else:
            second_order(cutoff, math.sqrt(0.5), T, high, c)
        assert abs(response(c, cutoff)) == pytest.approx(math.sqrt(0.5))
        assert abs(response(c, 0.0)) == pytest.approx(0.0 if high else 1.0, abs=1e-6)
        assert abs(response(c, 250.0)) == pytest.approx(1.0 if high else 0.0, abs=1e-6)
        assert max(abs(np.roots([1.0, c[3], c[4]]))) < 1.0


@settings(max_examples=20, deadline=None)
@given(st.floats(1.0, 200.0), st.floats(0.5, 50.0))
def test_a_band_stop_takes_out_its_centre_only(centre: float, width: float) -> None:
    c = np.zeros(5)
    band_stop(centre, width, T, c)
    assert abs(response(c, centre)) < 1e-9
    assert abs(response(c, 0.0)) == pytest.approx(1.0)
    assert abs(response(c, 250.0)) == pytest.approx(1.0)


def test_a_settled_filter_stays_where_it_is() -> None:
    c, memory, out = np.zeros(5), np.zeros((2, 2)), np.zeros(2)
    second_order(30.0, 0.5, T, False, c)
    u = np.array([3.0, -7.0])
    settle(c, u, memory)
    for _ in range(10):
        advance(c, u, memory, out)
        np.testing.assert_allclose(out, u, rtol=1e-12)
