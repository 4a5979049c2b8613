"""Numbers carry how far rounding may take them; see ``lab/rounding_bounds.py``."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.lab.rounding_bounds import EPS, FUNCTIONS, NUMPY, AtThreshold, Bounded, with_bounds

X = np.array([0.5, -1.25, 2.0])
"""Multiples of 1/8, whose sums and products are exact."""
Y = np.array([0.1, 0.7, -0.3])


def test_one_operation_on_exact_numbers_is_exact() -> None:
    x, y = with_bounds([X, Y])
    for found in (x + y, x * y, x / y, abs(x) - y, NUMPY.sqrt(abs(y)), x % 0.75, NUMPY.cross(x, x)):
        assert not found.bound.any()
    assert (x / y).value.tolist() == (X / Y).tolist()


def test_a_sum_is_within_n_eps_of_its_magnitudes_unless_it_is_exact() -> None:
    x, y = with_bounds([X, Y])
    assert y.sum().bound == pytest.approx(3 * EPS * 1.1)
    assert (x @ y).bound == pytest.approx(3 * EPS * (0.05 + 0.875 + 0.6))
    assert x.sum().bound == 0.0
    assert (x @ x).bound == 0.0
    assert NUMPY.prod(y).bound > 0.0


def test_an_elementary_function_is_within_two_units_and_carries_its_arguments_bound() -> None:
    (x,) = with_bounds([X])
    sine = NUMPY.sin(x)
    assert sine.bound == pytest.approx(2.0 * np.spacing(np.abs(np.sin(X))))
    again = NUMPY.tanh(sine + 1.0)
    assert np.all(again.bound > 2.0 * np.spacing(again.value))
    assert np.all(again.bound < 6.0 * EPS)
    angle = NUMPY.arctan2(Bounded(np.array(0.0), np.array(1e-3)), Bounded(np.array(2.0)))
    assert angle.bound == pytest.approx(5e-4)


def test_bounds_are_written_where_numbers_are() -> None:
    (y,) = with_bounds([np.zeros(3)])
    y[1:] = NUMPY.sin(Bounded(X[1:]))
    y[::-1][2] = 1.0
    assert (y.bound > 0.0).tolist() == [False, True, True]
    assert y.value[0] == 1.0
    y[np.array([True, True, False])] *= 2.0
    assert y.value.tolist() == [2.0, 2.0 * np.sin(X[1]), np.sin(X[2])]


@pytest.mark.parametrize(
    "decide",
    [
        lambda x: x > x.value + 1e-17,
        lambda x: FUNCTIONS["int"](x * 0.0 + 3.0 + x - x.value),
        lambda x: NUMPY.floor(x - x.value),
        lambda x: 1.0 / (x - x.value),
        lambda x: (x - x.value) % 0.75,
        lambda x: NUMPY.argmax(NUMPY.array([x, x.value])),
        lambda x: NUMPY.arctan2(x - x.value, -1.0),
        lambda x: NUMPY.sign(x - x.value),
    ],
)
def test_where_rounding_decides_it_is_said(decide) -> None:
    with pytest.raises(AtThreshold):
        decide(NUMPY.sin(Bounded(0.5)))


def test_exact_numbers_decide() -> None:
    (x,) = with_bounds([X])
    assert (x > 0.5).tolist() == [False, False, True]
    assert (x == X).all()
    assert NUMPY.argmax(NUMPY.array([x[0], 0.5])) == 0
    assert FUNCTIONS["int"](x[1]) == -1
    assert (x[0] // 0.25).value == 2.0
