"""A figure of columns of panels: a title, lines of notes, panels under each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ...plotting import FAINT, Panel, draw_panels, image, new_figure, style

if TYPE_CHECKING:
    from PIL.Image import Image

COLUMN_WIDTH, PANEL_HEIGHT = 5.0, 1.35
"""The sizes of a column and of a panel with its title [inch]."""
NOTE_HEIGHT = 0.2


@dataclass(frozen=True)
class Column:
    """Panels under each other with a header; what x is stands under the last one."""

    header: str
    panels: Sequence[Panel]


def draw_columns(title: str, notes: Sequence[str], columns: Sequence[Column]) -> Image:
    """The figure as a picture, the columns side by side.

    ``notes`` are lines of text between the title and the panels.
    """
    rows = max(len(column.panels) for column in columns)
    head = 0.45 + NOTE_HEIGHT * len(notes)
    height = head + 0.5 + rows * PANEL_HEIGHT
    with style():
        figure = new_figure(len(columns) * COLUMN_WIDTH, height)
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.set(rect=(0.0, 0.0, 1.0, 1.0 - head / height))
        inch = 1.0 / height
        figure.text(0.012, 1.0 - 0.1 * inch, title, va="top", fontsize=12, fontweight="bold")
        for number, note in enumerate(notes):
            below = 0.4 + NOTE_HEIGHT * number
            figure.text(0.012, 1.0 - below * inch, note, va="top", fontsize=8, color=FAINT)
        grid = figure.subplots(rows, len(columns), squeeze=False)
        pairs = []
        for place, column in enumerate(columns):
            for row, panel in enumerate(column.panels):
                last = row == len(column.panels) - 1
                axes = grid[row, place]
                pairs.append((axes, panel if last else replace(panel, x_label="")))
                axes.tick_params(labelbottom=last)
        draw_panels(pairs)
        for place, column in enumerate(columns):
            if column.header:
                # two lines above the title of the first panel
                grid[0, place].annotate(
                    column.header, (0.0, 1.0), (0.0, 20.0), xycoords="axes fraction",
                    textcoords="offset points", fontsize=10, fontweight="bold",
                )  # fmt: skip
        return image(figure)
