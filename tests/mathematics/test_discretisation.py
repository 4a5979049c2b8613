"""Exact discretisation against SciPy and against known solutions."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import cont2discrete, tf2ss

from aloft.mathematics.discretisation import (
    controllable_form,
    discretise,
    matrix_exponential,
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
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    found = discretise(a.tolist(), b.tolist(), 0.2)
    expected = cont2discrete((a, b, np.eye(3), np.zeros((3, 2))), 0.2)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-12, atol=1e-14)


def test_the_controllable_form_has_the_same_response() -> None:
    a, b, c, d = controllable_form([2.0, 3.0], [4.0, 1.0, 5.0])
    s = 0.3 + 0.7j
    response = (c @ np.linalg.solve(s * np.eye(2) - a, b))[0, 0] + d
    assert response == pytest.approx((2 * s + 3) / (4 * s**2 + s + 5))
    *_, direct = controllable_form([2.0, 3.0], [4.0, 1.0])
    assert direct == tf2ss([2, 3], [4, 1])[3][0, 0] == 0.5
