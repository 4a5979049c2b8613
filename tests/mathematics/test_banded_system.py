"""The smallest correction is that of NumPy's dense algebra, and says where there is none."""

import numpy as np
import pytest

from aloft.mathematics.banded_system import (
    TOGETHER,
    hold_violated,
    keep_bounds,
    smallest_correction,
)

BLOCKS, WIDTH, HEIGHT = 9, 5, 3


def chain(rng: np.random.Generator) -> np.ndarray:
    """Rows that touch the variables of their block and of the next one."""
    matrix = np.zeros((BLOCKS * HEIGHT, (BLOCKS + 1) * WIDTH))
    for k in range(BLOCKS):
        rows = slice(k * HEIGHT, (k + 1) * HEIGHT)
        matrix[rows, k * WIDTH : (k + 2) * WIDTH] = rng.standard_normal((HEIGHT, 2 * WIDTH))
    return matrix


def correct(matrix, wanted, weights, chosen, band=2 * TOGETHER, then=None):
    rows, columns = np.nonzero(matrix.T)[::-1]
    starts = np.searchsorted(columns, np.arange(matrix.shape[1] + 1))
    place = np.where(chosen, np.cumsum(chosen) - 1, -1)
    count, height = np.array([chosen.sum()]), len(matrix)
    vector, out, found = np.zeros(height), np.zeros(matrix.shape[1]), np.zeros(1, dtype=np.bool_)
    values, factorised = matrix.T[columns, rows], np.zeros(1, dtype=np.bool_)
    memory = np.zeros((height, band)), *np.zeros((2, height), dtype=np.int64)
    for one in [wanted] if then is None else [wanted, then]:
        vector[: count[0]] = one[chosen]
        smallest_correction(
            starts, rows, values, 1.0 / weights, place, count, 0.0, *memory, vector, out,
            factorised, found,
        )  # fmt: skip
        factorised[0] = True
    return out, bool(found[0])


def test_a_second_correction_takes_the_same_factors() -> None:
    rng = np.random.default_rng(8)
    matrix, weights = chain(rng), rng.uniform(0.5, 20.0, (BLOCKS + 1) * WIDTH)
    first, second = rng.standard_normal((2, len(matrix)))
    every = np.ones(len(matrix), dtype=bool)
    out, found = correct(matrix, first, weights, every, then=second)
    assert found
    np.testing.assert_array_equal(out, correct(matrix, second, weights, every)[0])


@pytest.mark.parametrize("left_out", [[], [0, 4, 5, 17]])
def test_the_smallest_correction_fulfils_the_chosen_rows(left_out) -> None:
    rng = np.random.default_rng(5)
    matrix, weights = chain(rng), rng.uniform(0.5, 20.0, (BLOCKS + 1) * WIDTH)
    wanted, chosen = rng.standard_normal(len(matrix)), np.ones(len(matrix), dtype=bool)
    chosen[left_out] = False
    out, found = correct(matrix, wanted, weights, chosen)
    own = matrix[chosen]
    normal = own / weights @ own.T
    assert found
    assert out == pytest.approx(own.T @ np.linalg.solve(normal, wanted[chosen]) / weights)
    assert own @ out == pytest.approx(wanted[chosen])


def test_rows_that_repeat_each_other_or_leave_the_band_have_no_correction() -> None:
    rng = np.random.default_rng(6)
    matrix = chain(rng)
    every, weights = np.ones(len(matrix), dtype=bool), np.ones(matrix.shape[1])
    assert not correct(matrix, np.ones(len(matrix)), weights, every, band=HEIGHT)[1]
    matrix[1] = matrix[0]
    assert not correct(matrix, np.ones(len(matrix)), weights, every)[1]


def test_a_row_without_a_variable_that_may_change_holds_nothing() -> None:
    rng = np.random.default_rng(7)
    matrix, wanted = chain(rng), rng.standard_normal(BLOCKS * HEIGHT)
    every, weights = np.ones(len(matrix), dtype=bool), np.ones(matrix.shape[1])
    matrix[4] = 0.0
    out, found = correct(matrix, wanted, weights, every)
    others = np.arange(len(matrix)) != 4
    assert found
    assert (matrix @ out)[others] == pytest.approx(wanted[others])


def test_more_equations_than_variables_have_no_correction() -> None:
    matrix = np.random.default_rng(9).standard_normal((4, 3))
    assert not correct(matrix, np.ones(4), np.ones(3), np.ones(4, dtype=bool), band=8)[1]


def test_variables_that_left_their_bounds_stay_on_them() -> None:
    variables, weights, left = np.array([0.4, -2.0, 3.0]), np.ones(3), np.zeros(1, dtype=np.bool_)
    keep_bounds(variables, np.full(3, -1.0), np.ones(3), weights, left)
    assert variables.tolist() == [0.4, -1.0, 1.0]
    assert weights.tolist() == [1.0, 0.0, 0.0]
    assert left[0]
    keep_bounds(variables, np.full(3, -1.0), np.ones(3), weights, left)
    assert not left[0]


@pytest.mark.parametrize("worst", [0.5, np.nan])
def test_violated_rows_are_held_from_then_on(worst: float) -> None:
    held, place, vector = np.array([False, True, False, False]), np.zeros(4, np.int64), np.zeros(4)
    count, violation, touched = np.zeros(1, np.int64), np.zeros(1), np.zeros(1, dtype=np.bool_)
    lower, upper = np.full(4, -1.0), np.ones(4)
    for values, new in (([1.5, 0.2, 0.0, -1.2], True), ([0.9, 0.2, worst, -1.0], False)):
        hold_violated(
            np.array(values), lower, upper, 0.1, held, place, count, vector, violation, touched
        )
        assert place.tolist() == [0, 1, -1, 2]
        assert touched[0] == new
    assert vector[: count[0]] == pytest.approx([0.1, 0.8, 0.0])
    np.testing.assert_equal(violation[0], worst if np.isnan(worst) else 0.0)
