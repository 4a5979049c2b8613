"""Line charts as SVG text, for pictures that need no plotting library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f", "#8c564b",
    "#17becf", "#bcbd22",
)  # fmt: skip
"""Ten colours that stay apart for most eyes; lines take them in turn."""
SHADES = {
    "squat": "#f4f1e6", "thrust": "#fdeadb", "flight": "#e6f0fa", "landing": "#e7f4e8",
    "recover": "#f3f3f3",
}  # fmt: skip
"""Colours of stretches by what they are; any other is as a flight."""


@dataclass(frozen=True)
class Line:
    """One line of a chart; NaN breaks it. ``level`` draws it thin and dashed, as a limit."""

    name: str
    x: Array
    y: Array
    level: bool = False


@dataclass
class Chart:
    """A chart with a title, lines, the unit of the x axis, and shaded stretches (from, to, what)."""

    title: str
    lines: list[Line]
    x_unit: str = "s"
    shaded: list[tuple[float, float, str]] = field(default_factory=list)

    def svg(self, left: float, top: float, width: float, height: float) -> str:
        """The chart in that rectangle [px]."""
        x, y = self._range("x"), self._range("y")
        inner_left, inner_top = left + 46.0, top + 28.0
        inner_width, inner_height = width - 54.0, height - 60.0

        def across(value: float) -> float:
            return inner_left + (value - x[0]) / (x[1] - x[0]) * inner_width

        def down(value: float) -> float:
            return inner_top + (y[1] - value) / (y[1] - y[0]) * inner_height

        out = [
            f'<text x="{inner_left:.1f}" y="{top + 13:.1f}" font-weight="bold">{escape(self.title)}</text>'
        ]
        for start, end, what in self.shaded:
            a, b = across(max(start, x[0])), across(min(end, x[1]))
            out.append(
                f'<rect x="{a:.1f}" y="{inner_top:.1f}" width="{max(0.0, b - a):.1f}" '
                f'height="{inner_height:.1f}" fill="{SHADES.get(what, SHADES["flight"])}">'
                f"<title>{escape(what)}</title></rect>"
            )
            if b - a > 5.0 * len(what):
                out.append(
                    f'<text x="{0.5 * (a + b):.1f}" y="{inner_top - 3:.1f}" font-size="8" '
                    f'fill="#888888" text-anchor="middle">{escape(what)}</text>'
                )
        for value in ticks(*y, 5):
            level = down(value)
            out.append(
                f'<line x1="{inner_left:.1f}" y1="{level:.1f}" x2="{inner_left + inner_width:.1f}" '
                f'y2="{level:.1f}" stroke="#dddddd"/>'
                f'<text x="{inner_left - 4:.1f}" y="{level + 3:.1f}" text-anchor="end">{value:g}</text>'
            )
        across_ticks = ticks(*x, 7)
        for value in across_ticks:
            unit = f" {self.x_unit}" if value == across_ticks[-1] else ""
            out.append(
                f'<text x="{across(value):.1f}" y="{inner_top + inner_height + 13:.1f}" '
                f'text-anchor="middle">{value:g}{escape(unit)}</text>'
            )
        legend = inner_left
        for number, line in enumerate(self.lines):
            colour = "#444444" if line.level else COLOURS[number % len(COLOURS)]
            style = (
                'stroke-width="0.8" stroke-dasharray="4 3"' if line.level else 'stroke-width="1.3"'
            )
            for points in pieces(line.x, line.y):
                path = " ".join(f"{across(a):.1f},{down(b):.1f}" for a, b in points)
                out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" {style}/>')
            if line.name:
                out.append(
                    f'<text x="{legend:.1f}" y="{inner_top + inner_height + 26:.1f}" '
                    f'fill="{colour}">{escape(line.name)}</text>'
                )
                legend += 5.8 * len(line.name) + 10.0
        return "\n".join(out)

    def _range(self, axis: str) -> tuple[float, float]:
        """The least and the largest finite value of all lines, with a little room in y."""
        values = np.concatenate([getattr(line, axis) for line in self.lines])
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        room = 0.0 if axis == "x" else 0.05 * (high - low)
        if high - low < 1e-9:
            room = 0.5
        return low - room, high + room


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round values from low to high, at most that many and at least one."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * f for f in (1.0, 2.0, 2.5, 5.0, 10.0) if power * f >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(k * step, 12) for k in range(first, last + 1)] or [0.5 * (low + high)]


def pieces(x: Array, y: Array) -> list[list[tuple[float, float]]]:
    """The stretches of a line between values that are not finite."""
    found: list[list[tuple[float, float]]] = [[]]
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if math.isfinite(a) and math.isfinite(b):
            found[-1].append((a, b))
        elif found[-1]:
            found.append([])
    return [piece for piece in found if len(piece) > 1]


def page(title: str, parts: Sequence[str], width: float, height: float) -> str:
    """A whole SVG file."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="10">\n'
        f"<title>{escape(title)}</title>\n"
        f'<rect width="{width:g}" height="{height:g}" fill="white"/>\n'
        f'<text x="12" y="22" font-size="15" font-weight="bold">{escape(title)}</text>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )
