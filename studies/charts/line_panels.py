"""Lines with their intervals over one axis, in one panel or in several that share their axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...plotting import COLOURS, label_ends, look, new_figure, style, svg_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_COLUMNS = 4
MOST_BANDS = 3
"""Where there are more lines than this, intervals are whiskers side by side: bands would hide each
other."""


@dataclass(frozen=True)
class Point:
    """A value with its interval from ``low`` to ``high``."""

    x: float
    y: float
    low: float
    high: float


Panels = Mapping[str, Mapping[str, Sequence[Point]]]
"""Points by the name of the panel and the name of the line."""


def line_panels(
    title: str, x_label: str, y_label: str, panels: Panels, *, share: bool = False
) -> str:
    """The chart as SVG text. With ``share`` y is a share, and its axis goes from 0 to 100 %."""
    from matplotlib.ticker import PercentFormatter

    names = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    columns = min(len(panels), 3 if len(panels) == 5 else MOST_COLUMNS) or 1
    rows = math.ceil(len(panels) / columns) or 1
    width = 0.9 + 2.9 * columns + 0.085 * max((len(name) for name in names), default=0)
    with style():
        figure = new_figure(
            max(width, 0.6 + 0.105 * len(title)), 0.9 + (3.0 if rows == 1 else 2.4) * rows, title
        )
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for number, axes in enumerate(grid.flat):
            axes.set_visible(number < len(panels))
        for number, (axes, (panel, lines)) in enumerate(
            zip(grid.flat, panels.items(), strict=False)
        ):
            for line, points in lines.items():
                _draw_line(axes, names.index(line), points, len(names), f"panel-{number}")
            axes.set_title(panel, fontweight="bold")
            axes.tick_params(labelbottom=number + columns >= len(panels))
        figure.supxlabel(x_label, fontsize=9)
        figure.supylabel(y_label, fontsize=9)
        if share:
            grid[0, 0].set_ylim(-0.02, 1.02)
            grid[0, 0].yaxis.set_major_formatter(PercentFormatter(1.0, 0))
        if len(names) > 1 and len(panels) == 1:
            _label(grid[0, 0], next(iter(panels.values())), names)
        elif len(names) > 1:
            handles = [
                grid[0, 0].plot([], [], marker="o", markersize=4, **look(number))[0]
                for number in range(len(names))
            ]
            figure.legend(handles, names, loc="outside right upper")
        return svg_text(figure)


def _draw_line(axes: Axes, number: int, points: Sequence[Point], lines: int, panel: str) -> None:
    """One line with its dots and its intervals."""
    from matplotlib.transforms import ScaledTranslation

    ordered = sorted(points, key=lambda point: point.x)
    x, y = [point.x for point in ordered], [point.y for point in ordered]
    low, high = [point.low for point in ordered], [point.high for point in ordered]
    colour = look(number)["color"]
    if lines <= MOST_BANDS:
        axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0)
    else:
        figure = axes.get_figure(root=True)
        assert figure is not None
        aside = ScaledTranslation(
            1.8 * (number - 0.5 * (lines - 1)) / 72.0, 0.0, figure.dpi_scale_trans
        )
        axes.vlines(
            x, low, high, color=colour, alpha=0.45, linewidth=1.0, transform=axes.transData + aside
        )
    axes.plot(
        x, y, marker="o", markersize=4.5, markeredgecolor="white", markeredgewidth=0.7,
        gid=f"{panel}-line-{number}", **look(number),
    )  # fmt: skip


def _label(axes: Axes, lines: Mapping[str, Sequence[Point]], names: Sequence[str]) -> None:
    """The lines' names at their right ends."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    label_ends(
        axes,
        [
            (name, max(points, key=lambda point: point.x).y, COLOURS[names.index(name) % 8])
            for name, points in lines.items()
        ],
    )
