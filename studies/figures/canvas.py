"""Curves over time as a picture: panels under each other, phases shaded, drawn with Pillow.

Pillow and not matplotlib: Rerun's SDK installs it anyway, the frames of ``strip`` need it too, and
its own font makes the picture the same on every machine. Everything is drawn at twice the size and
reduced, which smooths it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..charts.svg import FAINT, INK, PALE, round_values

if TYPE_CHECKING:
    from PIL.Image import Image

Array = NDArray[np.float64]

ENLARGED = 2
WIDTH, HEIGHT = 560, 150
LEFT, RIGHT, ABOVE, BELOW, TOP = 74, 22, 34, 20, 20
LINE = 20
DASH, GAP = 9.0, 6.0
FLIGHT, PUSH = "#e3edf7", "#f6c89f"


@dataclass(frozen=True)
class Curve:
    """A line of a panel; where ``y`` is not finite it is interrupted."""

    name: str
    x: Array
    y: Array
    colour: str
    dashed: bool = False


@dataclass(frozen=True)
class Shade:
    """A stretch of x with another background."""

    start: float
    end: float
    colour: str = FLIGHT


@dataclass(frozen=True)
class Panel:
    """Curves over one stretch of x. ``title`` says what y is, with its unit."""

    title: str
    curves: Sequence[Curve]
    x_range: tuple[float, float]
    shades: Sequence[Shade] = ()


@dataclass(frozen=True)
class Column:
    """Panels under each other; ``x_label`` stands under the last."""

    header: str
    panels: Sequence[Panel]
    x_label: str


def draw_columns(title: str, notes: Sequence[str], columns: Sequence[Column]) -> Image:
    """The whole picture: a title, lines of notes, columns of panels."""
    rows = max(len(column.panels) for column in columns)
    head = TOP + 30 + LINE * len(notes) + 8
    header = 26 if any(column.header for column in columns) else 0
    width = len(columns) * (LEFT + WIDTH + RIGHT)
    height = head + header + rows * (ABOVE + HEIGHT + BELOW) + 30
    pen = Pen(width, height)
    pen.text(20, TOP, title, 19)
    for number, note in enumerate(notes):
        pen.text(20, TOP + 30 + LINE * number, note, 13, FAINT)
    for number, column in enumerate(columns):
        left = number * (LEFT + WIDTH + RIGHT) + LEFT
        pen.text(left, head, column.header, 16)
        top = head + header
        for panel in column.panels:
            _draw_panel(pen, panel, left, top + ABOVE)
            top += ABOVE + HEIGHT + BELOW
        pen.text(left + WIDTH / 2, top + 2, column.x_label, 13, INK, "ma")
    return pen.finished()


def _draw_panel(pen: Pen, panel: Panel, left: float, top: float) -> None:
    x_low, x_high = panel.x_range
    y_low, y_high = reach([curve.y for curve in panel.curves])

    def place(x: float, y: float) -> tuple[float, float]:
        across = (x - x_low) / (x_high - x_low)
        return left + across * WIDTH, top + (y_high - y) / (y_high - y_low) * HEIGHT

    for shade in panel.shades:
        start, end = max(shade.start, x_low), min(shade.end, x_high)
        if start < end:
            pen.box(place(start, y_high), place(end, y_low), shade.colour)
    for value in round_values(y_low, y_high, 5):
        _, y = place(x_low, value)
        pen.line([(left, y), (left + WIDTH, y)], FAINT if value == 0.0 else PALE, 1)
        pen.text(left - 8, y, f"{value:g}", 12, FAINT, "rm")
    for value in round_values(x_low, x_high, 8):
        x, y = place(value, y_low)
        pen.line([(x, y), (x, y + 4)], FAINT, 1)
        pen.text(x, y + 5, f"{value:g}", 12, FAINT, "ma")
    pen.frame((left, top), (left + WIDTH, top + HEIGHT), FAINT)
    for curve in panel.curves:
        for stretch in stretches(curve, panel.x_range):
            points = [place(x, y) for x, y in stretch]
            for part in dashes(points) if curve.dashed else [points]:
                pen.line(part, curve.colour, 2)
    pen.text(left, top - 8, panel.title, 13, INK, "ls")
    x = left + WIDTH
    for curve in reversed([c for c in panel.curves if c.name]):
        x -= pen.width(curve.name, 12)
        pen.text(x, top - 8, curve.name, 12, INK, "ls")
        sample = [(x - 30, top - 12), (x - 6, top - 12)]
        for part in dashes(sample) if curve.dashed else [sample]:
            pen.line(part, curve.colour, 2.5)
        x -= 44


def reach(values: Sequence[Array]) -> tuple[float, float]:
    """From the least to the largest finite value, with some room; never nothing."""
    finite = [y[np.isfinite(y)] for y in values]
    found = np.concatenate(finite) if finite else np.zeros(0)
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    room = 0.08 * (high - low) if high - low > 1e-9 else 0.5
    return low - room, high + room


def stretches(curve: Curve, x_range: tuple[float, float]) -> list[list[tuple[float, float]]]:
    """The pieces of a curve within the range that have no gap."""
    pieces: list[list[tuple[float, float]]] = [[]]
    for x, y in zip(curve.x.tolist(), curve.y.tolist(), strict=True):
        if isfinite(y) and x_range[0] <= x <= x_range[1]:
            pieces[-1].append((x, y))
        elif pieces[-1]:
            pieces.append([])
    return [piece for piece in pieces if len(piece) > 1]


def dashes(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """The pieces of a line that a dashed one shows."""
    pieces: list[list[tuple[float, float]]] = []
    drawn, left, current = True, DASH, [points[0]]
    for (x, y), (end_x, end_y) in itertools.pairwise(points):
        length = hypot(end_x - x, end_y - y)
        while length > left:
            share = left / length
            x, y, length = x + share * (end_x - x), y + share * (end_y - y), length - left
            if drawn:
                pieces.append([*current, (x, y)])
            drawn = not drawn
            left, current = DASH if drawn else GAP, [(x, y)]
        left -= length
        if drawn:
            current.append((end_x, end_y))
    return [*pieces, current] if drawn and len(current) > 1 else pieces


class Pen:
    """Draws on a white picture of that size [px]."""

    def __init__(self, width: int, height: int) -> None:
        from PIL import Image, ImageDraw

        self._size = (width, height)
        self._image = Image.new("RGB", (width * ENLARGED, height * ENLARGED), "white")
        self._draw = ImageDraw.Draw(self._image)

    def text(
        self, x: float, y: float, words: str, size: int, colour: str = INK, anchor: str = "la"
    ) -> None:
        """A line of text; ``anchor`` as Pillow has it."""
        place = (x * ENLARGED, y * ENLARGED)
        self._draw.text(place, words, fill=colour, font=font(size * ENLARGED), anchor=anchor)

    def width(self, words: str, size: int) -> float:
        """How wide a text is [px]."""
        return float(font(size * ENLARGED).getlength(words)) / ENLARGED

    def line(self, points: Sequence[tuple[float, float]], colour: str, width: float) -> None:
        """Points joined by lines."""
        enlarged = [(x * ENLARGED, y * ENLARGED) for x, y in points]
        self._draw.line(enlarged, fill=colour, width=round(width * ENLARGED), joint="curve")

    def box(self, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
        """A filled rectangle."""
        self._draw.rectangle([*self._scaled(start), *self._scaled(end)], fill=colour)

    def frame(self, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
        """An empty rectangle."""
        self._draw.rectangle([*self._scaled(start), *self._scaled(end)], outline=colour, width=2)

    def finished(self) -> Image:
        """The picture at its size."""
        from PIL import Image

        return self._image.resize(self._size, Image.Resampling.LANCZOS)

    def _scaled(self, point: tuple[float, float]) -> tuple[float, float]:
        return point[0] * ENLARGED, point[1] * ENLARGED


def font(size: int) -> Any:
    """Pillow's own font, which is the same everywhere."""
    from PIL import ImageFont

    return ImageFont.load_default(size)
