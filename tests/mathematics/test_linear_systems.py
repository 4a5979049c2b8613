"""Exact discretisation against SciPy and against known solutions.

Filters have the responses of their continuous models at the frequency they are prewarped for.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from aloft.mathematics.linear_systems import (
    advance,
    band_stop,
    controllable_form,
    discretise,
    first_order,
    matrix_exponential,
    second_order,
    settle,
)


@pytest.mark.parametrize("size", [1, 2, 5])
@pytest.mark.parametrize("scale", [0.01, 1.0, 20.0])
def test_the_exponential_is_scipys(size: int, scale: float) -> None:
    matrix = scale * np.random.default_rng(size).normal(size=(size, size))
    found = np.empty_like(matrix)
    matrix_exponential(matrix, np.empty_like(matrix), np.empty_like(matrix), found)
    expected = expm(matrix)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_a_double_integrator() -> None:
    a, b = discretise([[0, 1], [0, 0]], [[0], [1]], 0.1)
    np.testing.assert_allclose(a, [[1, 0.1], [0, 1]], atol=1e-16)
    np.testing.assert_allclose(b, [[0.005], [0.1]], atol=1e-16)


def test_discretisation_is_scipys() -> None:
    from scipy.signal import cont2discrete

    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    found = discretise(a.tolist(), b.tolist(), 0.2)
    expected = cont2discrete((a, b, np.eye(3), np.zeros((3, 2))), 0.2)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-12, atol=1e-14)


def test_the_controllable_form_has_the_same_response() -> None:
    from scipy.signal import tf2ss

    a, b, c, d = controllable_form([2.0, 3.0], [4.0, 1.0, 5.0])
    s = 0.3 + 0.7j
    response = (c @ np.linalg.solve(s * np.eye(2) - a, b))[0, 0] + d
    assert response == pytest.approx((2 * s + 3) / (4 * s**2 + s + 5))
    *_, direct = controllable_form([2.0, 3.0], [4.0, 1.0])
    assert direct == tf2ss([2, 3], [4, 1])[3][0, 0] == 0.5


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
