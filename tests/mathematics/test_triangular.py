"""Factor and triangular systems against NumPy."""

import numpy as np
import pytest

from aloft.mathematics.triangular import (
    factorise,
    solve_rows_transposed,
    solve_transposed,
    solve_upper,
)


def positive(seed=0, n=5):
    rows = np.random.default_rng(seed).standard_normal((n + 3, n))
    return rows.T @ rows


def test_the_factor_and_its_systems():
    matrix = positive()
    factor = matrix.copy()
    assert factorise(factor, 0.0)
    upper = np.triu(factor)
    np.testing.assert_allclose(upper.T @ upper, matrix, rtol=1e-12)
    right = np.arange(1.0, 6.0)
    x = right.copy()
    solve_upper(factor, x)
    np.testing.assert_allclose(upper @ x, right, rtol=1e-12)
    x = right.copy()
    solve_transposed(factor, x)
    np.testing.assert_allclose(upper.T @ x, right, rtol=1e-12)
    rows = np.random.default_rng(1).standard_normal((5, 4))
    x = rows.copy()
    solve_rows_transposed(factor, 3, x)
    np.testing.assert_allclose(upper.T @ x[:, :3], rows[:, :3], rtol=1e-11, atol=1e-12)
    assert (x[:, 3] == rows[:, 3]).all()


@pytest.mark.parametrize("spoil", [-1.0, np.nan, np.inf])
def test_a_matrix_without_a_factor_is_reported(spoil):
    matrix = positive()
    matrix[2, 2] = spoil
    assert not factorise(matrix, 0.0)
