from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics.support_margin import support_margin

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ALL = np.ones(4, dtype=bool)


@pytest.mark.parametrize(
    ("x", "y", "margin"),
    [(0.5, 0.5, 0.5), (0.9, 0.5, 0.1), (1.2, 0.5, -0.2), (0.5, -0.3, -0.3), (0.25, 0.4, 0.25)],
)
def test_square(x: float, y: float, margin: float) -> None:
    assert support_margin(SQUARE, ALL, x, y) == pytest.approx(margin)
    assert support_margin(SQUARE[[2, 0, 3, 1]], ALL, x, y) == pytest.approx(margin)


def test_only_loaded_points_support() -> None:
    triangle = np.array([True, True, False, True])
    assert support_margin(SQUARE, triangle, 0.9, 0.9) == pytest.approx(-0.8 / np.sqrt(2))


def test_a_line_a_point_and_nothing_do_not_support() -> None:
    line = np.array([True, True, False, False])
    assert support_margin(SQUARE, line, 0.5, 0.3) == pytest.approx(-0.3)
    assert support_margin(SQUARE, line, 0.5, 0.0) == 0.0
    assert support_margin(SQUARE, np.array([True, False, False, False]), 3.0, 4.0) == -5.0
    assert support_margin(SQUARE, np.zeros(4, dtype=bool), 0.0, 0.0) == -1.0
