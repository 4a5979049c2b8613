"""Columns of panels as a picture."""

import numpy as np

from aloft.lab.figures.curves import COLUMN_WIDTH, Column, draw_columns
from aloft.plotting import DPI, Curve, Panel

X = np.linspace(0.0, 1.0, 101)


def picture(*columns: str, colour: str = "#ff0000") -> np.ndarray:
    panel = Panel("height [cm]", [Curve("a", X, X**2, colour)])
    found = [Column(header, [panel, panel]) for header in columns]
    return np.asarray(draw_columns("title", ["a note"], found))


def test_every_column_has_its_curves() -> None:
    found = picture("(a)", "(b)").astype(int)
    assert found.shape[1] == 2 * COLUMN_WIDTH * DPI
    red = (found[:, :, 0] > 200) & (found[:, :, 1] < 60) & (found[:, :, 2] < 60)
    middle = found.shape[1] // 2
    assert red[:, :middle].sum() > 300 and red[:, middle:].sum() > 300
    rows = np.flatnonzero(red[:, :middle].any(axis=1))
    assert np.diff(rows).max() > 20, "there are two panels, one below the other"


def test_a_picture_is_the_same_every_time() -> None:
    assert np.array_equal(picture("h"), picture("h"))
    assert not np.array_equal(picture("h"), picture("h", colour="#00ff00"))
