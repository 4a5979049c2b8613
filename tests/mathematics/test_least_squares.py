"""Against NumPy's own solvers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.mathematics.least_squares import solve_damped, solve_positive, solve_rows

square = arrays(np.float64, (5, 5), elements=st.floats(-1.0, 1.0))


@given(square)
def test_solve_positive(a):
    matrix = a @ a.T + 0.1 * np.eye(5)
    solution = np.arange(1.0, 6.0)
    vector = matrix @ solution
    solve_positive(matrix.copy(), vector)
    assert np.abs(vector - solution).max() < 1e-9


@given(square)
def test_every_row_is_a_right_hand_side(a):
    matrix = a @ a.T + 0.1 * np.eye(5)
    solutions = np.arange(1.0, 11.0).reshape(2, 5)
    rows = solutions @ matrix
    solve_rows(matrix.copy(), rows)
    assert np.abs(rows - solutions).max() < 1e-9


@given(square, st.floats(0.01, 1.0))
def test_solve_damped_is_least_squares_with_the_damping_as_more_rows(a, damping):
    wanted = np.arange(5.0)
    expected = np.linalg.lstsq(
        np.vstack([a, damping * np.eye(5)]), np.r_[wanted, np.zeros(5)], rcond=None
    )[0]
    vector = a.T @ wanted
    solve_damped(np.ascontiguousarray(a), damping, np.empty((5, 5)), vector)
    assert vector == pytest.approx(expected, abs=1e-8, rel=1e-8)


def test_without_rank_the_answer_is_finite_and_small():
    a = np.zeros((5, 5))
    a[0, 0] = 1.0
    vector = a.T @ np.ones(5)
    solve_damped(a, 1e-4, np.empty((5, 5)), vector)
    assert vector == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.0], abs=1e-7)
