"""Products in plain loops are those of NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.mathematics.linear_algebra import (
    add_product,
    factorise,
    inverse,
    multiply_matrices,
    multiply_vector,
    pairwise_sum,
    product,
    solve_damped,
    solve_each_transposed,
    solve_each_upper,
    solve_positive,
    solve_rows,
    solve_rows_transposed,
    solve_transposed,
    solve_upper,
    weighted_sum,
)


def test_products_are_numpys() -> None:
    rng = np.random.default_rng(0)
    a, b, x = rng.normal(size=(3, 4)), rng.normal(size=(4, 2)), rng.normal(size=4)
    out = np.ones(3)
    add_product(a, x, out)
    np.testing.assert_allclose(out, 1.0 + a @ x, rtol=1e-14)
    multiply_vector(a, x, out)
    np.testing.assert_allclose(out, a @ x, rtol=1e-14)
    product = np.empty((3, 2))
    multiply_matrices(a, b, product)
    np.testing.assert_allclose(product, a @ b, rtol=1e-14)


def test_a_weighted_sum_has_the_bits_of_numpys_along_the_first_axis() -> None:
    rng = np.random.default_rng(0)
    for n, m in ((1, 3), (7, 50), (60, 4), (300, 11)):
        weights, rows, out = rng.normal(size=n), rng.normal(size=(n, m)), np.ones(m)
        weights[rng.random(n) < 0.3] = 0.0
        weighted_sum(weights, rows, out)
        used = np.flatnonzero(weights)
        assert (out == (weights[used, None] * rows[used]).sum(axis=0)).all()


def test_a_pairwise_sum_has_the_bits_of_numpys_along_memory() -> None:
    rng = np.random.default_rng(1)
    for count in range(129):
        values = rng.normal(size=count) * 10.0 ** rng.integers(-3, 3, size=count)
        assert pairwise_sum(values) == values.sum()


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


@pytest.mark.parametrize("count", [0, 1, 6])
def test_systems_with_one_factor_have_the_bits_of_each_alone(count):
    factor = positive(n=7)
    assert factorise(factor, 0.0)
    right = np.random.default_rng(2).standard_normal((count, 7))
    for together, alone in (
        (solve_each_transposed, solve_transposed),
        (solve_each_upper, solve_upper),
    ):
        found, expected = right.copy(), right.copy()
        together(factor, found)
        for row in expected:
            alone(factor, row)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("spoil", [-1.0, np.nan, np.inf])
def test_a_matrix_without_a_factor_is_reported(spoil):
    matrix = positive()
    matrix[2, 2] = spoil
    assert not factorise(matrix, 0.0)


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


RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("a", "b"),
    [((3, 3), (3,)), ((3,), (3, 4)), ((5,), (5,)), ((2, 3), (3, 4)), ((7, 3, 3), (3,)),
     ((7, 3, 3), (7, 3, 3)), ((7, 2, 3), (7, 3, 1)), ((3, 3), (7, 3, 2))],
)  # fmt: skip
def test_products_of_arrays_are_numpys(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    left, right = RNG.normal(size=a), RNG.normal(size=b)
    found = product(left, right)
    assert found.shape == (left @ right).shape
    np.testing.assert_allclose(found, left @ right, rtol=1e-13, atol=1e-14)


def test_a_product_rounds_after_every_operation_in_the_order_of_the_elements() -> None:
    a, b = RNG.normal(size=(4, 6)), RNG.normal(size=(6, 5))
    expected = np.empty((4, 5))
    multiply_matrices(a, b, expected)
    np.testing.assert_array_equal(product(a, b), expected)


def test_the_inverse_is_numpys() -> None:
    for n in (1, 2, 5, 20):
        matrix = RNG.normal(size=(n, n))
        np.testing.assert_allclose(inverse(matrix), np.linalg.inv(matrix), rtol=1e-9, atol=1e-11)


def test_the_inverse_exchanges_rows_where_a_pivot_is_zero() -> None:
    matrix = np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -4.0]])
    before = matrix.copy()
    expected = [[0.0, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -0.25]]
    np.testing.assert_array_equal(inverse(matrix), expected)
    np.testing.assert_array_equal(matrix, before)


def test_a_singular_matrix_has_no_inverse() -> None:
    with pytest.raises(ValueError, match="the matrix is singular, so it has no inverse"):
        inverse(np.array([[1.0, 2.0], [2.0, 4.0]]))
