"""Which feet carry load, and their mean place."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics.stance_feet import find_stance_feet, mean_position

OWNERS = np.array([0, 0, 1, 2])


@pytest.mark.parametrize(
    ("contact", "expected"),
    [
        ([True, False, False, True], [True, False, True]),
        ([False, False, True, False], [False, True, False]),
        ([False] * 4, [True] * 3),  # none: the robot flies, and all count
    ],
)
def test_a_foot_stands_on_any_of_its_points(contact, expected):
    stands = np.zeros(3, bool)
    assert find_stance_feet(np.array(contact), OWNERS, stands) == sum(expected)
    assert stands.tolist() == expected


def test_the_mean_is_that_of_the_chosen_ones():
    points, out = np.random.default_rng(1).normal(size=(3, 3)), np.ones(3)
    mean_position(points, np.array([True, False, True]), 2, out)
    assert out == pytest.approx(0.5 * (points[0] + points[2]))
