"""Curves as pictures: what is drawn where."""

from itertools import pairwise
from math import hypot

import numpy as np
import pytest

from aloft.studies.figures.canvas import (
    DASH,
    FLIGHT,
    Column,
    Curve,
    Panel,
    Shade,
    dashes,
    draw_columns,
    reach,
    stretches,
)

X = np.linspace(0.0, 1.0, 101)


def picture(*shades: Shade, colour: str = "#ff0000") -> np.ndarray:
    panel = Panel("height [cm]", [Curve("a", X, X**2, colour)], (0.0, 1.0), shades)
    return np.asarray(draw_columns("title", ["a note"], [Column("", [panel], "time [s]")]))


def share_of(found: np.ndarray, colour: tuple[int, int, int]) -> float:
    return float((np.abs(found.astype(int) - colour).max(axis=2) < 12).mean())


def test_a_curve_and_its_shade_are_there() -> None:
    rgb = tuple(int(FLIGHT[k : k + 2], 16) for k in (1, 3, 5))
    plain, half, whole = (
        picture(*shades) for shades in ([], [Shade(0.25, 0.75)], [Shade(-1.0, 9.0)])
    )
    assert share_of(plain, rgb) < 0.001  # type: ignore[arg-type]
    ratio = share_of(half, rgb) / share_of(whole, rgb)  # type: ignore[arg-type]
    assert ratio == pytest.approx(0.5, abs=0.05)
    assert share_of(plain, (255, 0, 0)) > 10 * share_of(picture(colour="#000000"), (255, 0, 0))


def test_a_picture_is_the_same_every_time() -> None:
    assert np.array_equal(picture(Shade(0.2, 0.4)), picture(Shade(0.2, 0.4)))


def test_dashes_are_of_one_length_and_on_the_line() -> None:
    line = [(float(x), 2.0 * float(x)) for x in np.linspace(0.0, 40.0, 7)]
    parts = dashes(line)
    lengths = [sum(hypot(c - a, d - b) for (a, b), (c, d) in pairwise(part)) for part in parts]
    assert lengths[:-1] == pytest.approx([DASH] * (len(parts) - 1))
    assert all(abs(y - 2.0 * x) < 1e-9 for part in parts for x, y in part)


def test_a_curve_is_interrupted_where_it_is_not_finite_or_outside() -> None:
    y = np.where((X > 0.4) & (X < 0.5), np.nan, X)
    pieces = stretches(Curve("a", X, y, "red"), (0.1, 0.9))
    assert [(round(p[0][0], 2), round(p[-1][0], 2)) for p in pieces] == [(0.1, 0.4), (0.5, 0.9)]


def test_an_axis_is_never_empty() -> None:
    assert reach([]) == (-0.08, 1.08)
    low, high = reach([np.array([2.0, np.nan, 2.0])])
    assert low < 2.0 < high
