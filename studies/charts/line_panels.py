"""Lines with bands over one axis, in one panel or several that share their axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from . import svg

WIDTH, HEIGHT = 330.0, 220.0
LEFT, TOP, GAP_X, GAP_Y = 66.0, 66.0, 34.0, 56.0
MOST_COLUMNS = 4
MOST_BANDS = 3
"""Intervals of more lines than this are whiskers side by side."""


@dataclass(frozen=True)
class Point:
    """A value with its interval."""

    x: float
    y: float
    low: float
    high: float


Panels = Mapping[str, Mapping[str, Sequence[Point]]]


def line_panels(
    title: str, x_label: str, y_label: str, panels: Panels, *, share: bool = False
) -> str:
    """Panels of lines by name. With ``share`` y is a share: from 0 to 1, in percent."""
    names = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    points = [p for lines in panels.values() for line in lines.values() for p in line]
    x_low, x_high = _reach([p.x for p in points])
    y_low, y_high = (
        (0.0, 1.0) if share else _reach([v for p in points for v in (p.low, p.high)], 0.06)
    )
    columns = min(len(panels), MOST_COLUMNS if len(panels) != 5 else 3) or 1
    rows = math.ceil(len(panels) / columns)
    out: list[str] = []
    for number, (name, lines) in enumerate(panels.items()):
        left = LEFT + (number % columns) * (WIDTH + GAP_X)
        top = TOP + (number // columns) * (HEIGHT + GAP_Y)

        def place(x: float, y: float, left: float = left, top: float = top) -> tuple[float, float]:
            across = (x - x_low) / (x_high - x_low)
            return left + across * WIDTH, top + (y_high - y) / (y_high - y_low) * HEIGHT

        for value in svg.round_values(y_low, y_high, 6):
            _, y = place(x_low, value)
            out.append(svg.line(left, y, left + WIDTH, y))
            if number % columns == 0:
                words = f"{value:.0%}" if share else f"{value:g}"
                out.append(svg.text(left - 8, y + 4, words, anchor="end", size=11, fill=svg.FAINT))
        for value in svg.round_values(x_low, x_high, 7):
            x, _ = place(value, y_low)
            out.append(svg.line(x, top + HEIGHT, x, top + HEIGHT + 4, f'stroke="{svg.FAINT}"'))
            out.append(
                svg.text(x, top + HEIGHT + 17, f"{value:g}", anchor="middle", size=11,
                         fill=svg.FAINT)
            )  # fmt: skip
        out.append(svg.line(left, top + HEIGHT, left + WIDTH, top + HEIGHT,
                            f'stroke="{svg.FAINT}"'))  # fmt: skip
        if name:
            out.append(svg.text(left + 4, top - 8, name, bold=True))
        for line, values in lines.items():
            index, ordered = names.index(line), sorted(values, key=lambda p: p.x)
            if len(names) <= MOST_BANDS:
                band = [place(p.x, p.high) for p in ordered]
                band += [place(p.x, p.low) for p in reversed(ordered)]
                look = f'fill="{svg.colour(index)}" fill-opacity="0.13" stroke="none"'
                out.append(svg.path(band, look, closed=True))
            else:  # so many bands would hide each other
                look = f'stroke="{svg.colour(index)}" stroke-width="1.2" stroke-opacity="0.45"'
                aside = 2.4 * (index - (len(names) - 1) / 2)
                for p in ordered:
                    (x, low), (_, high) = place(p.x, p.low), place(p.x, p.high)
                    out.append(svg.line(x + aside, low, x + aside, high, look))
        for line, values in lines.items():
            index, ordered = names.index(line), sorted(values, key=lambda p: p.x)
            placed = [place(p.x, p.y) for p in ordered]
            out.append(svg.path(placed, f'fill="none" {svg.stroke(index)}'))
            out += [svg.dot(x, y, index) for x, y in placed]
    right = LEFT + columns * (WIDTH + GAP_X)
    bottom = TOP + rows * (HEIGHT + GAP_Y)
    middle_y = (TOP + bottom - GAP_Y) / 2
    out.append(svg.text(20, middle_y, y_label, anchor="middle", turn=-90))
    out.append(svg.text((LEFT + right - GAP_X) / 2, bottom - 12, x_label, anchor="middle"))
    width = right
    if len(names) > 1:
        out.append(svg.legend(names, right, TOP + 8))
        width += svg.legend_width(names) + 16
    height = max(bottom + 4, TOP + 30 + 20 * len(names))
    return svg.page(title, max(width, 50 + 9 * len(title)), height, out)


def _reach(values: Sequence[float], room: float = 0.0) -> tuple[float, float]:
    """From the least to the largest value, with some room; never nothing."""
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    if high - low < 1e-12:
        return low - 0.5, high + 0.5
    return low - room * (high - low), high + room * (high - low)
