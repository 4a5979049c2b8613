"""What all our pictures share: colours, round numbers for axes, legends, a page; as SVG text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6d4c41", "#7f7f7f",
)  # fmt: skip
"""Okabe and Ito's colours, which stay apart for most eyes; lines take them in turn."""
DASHES = ("", "7 3", "2 3")
"""Every further round of colours is dashed otherwise."""
INK, FAINT, PALE = "#1f2933", "#66727f", "#dde2e7"
CHARACTER = 7.0
"""The width of a character of ordinary text [px]."""


def colour(number: int) -> str:
    """The colour of a line."""
    return COLOURS[number % len(COLOURS)]


def stroke(number: int) -> str:
    """How a line is drawn."""
    dash = DASHES[(number // len(COLOURS)) % len(DASHES)]
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'stroke="{colour(number)}" stroke-width="2" stroke-linejoin="round"{dashed}'


def text(
    x: float, y: float, words: str, *, anchor: str = "start", size: float = 12, fill: str = INK,
    bold: bool = False, turn: float = 0.0,
) -> str:  # fmt: skip
    """A line of text with its baseline at y, turned by ``turn`` degrees."""
    weight = ' font-weight="600"' if bold else ""
    turned = f' transform="rotate({turn:g} {x:.1f} {y:.1f})"' if turn else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}" '
        f'fill="{fill}"{weight}{turned}>{escape(words)}</text>'
    )


def line(x1: float, y1: float, x2: float, y2: float, look: str = f'stroke="{PALE}"') -> str:
    """A straight line."""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {look}/>'


def path(points: Sequence[tuple[float, float]], look: str, *, closed: bool = False) -> str:
    """Points joined by lines."""
    shape = "polygon" if closed else "polyline"
    joined = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<{shape} points="{joined}" {look}/>'


def dot(x: float, y: float, number: int, radius: float = 3.2) -> str:
    """A point of a line."""
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour(number)}" '
        'stroke="white" stroke-width="1"/>'
    )


def legend(names: Sequence[str], x: float, y: float) -> str:
    """The names of the lines under each other, from the first one's middle at y."""
    out = []
    for number, name in enumerate(names):
        level = y + 20 * number
        out += [
            line(x, level, x + 22, level, stroke(number)),
            dot(x + 11, level, number),
            text(x + 30, level + 4, name),
        ]
    return "\n".join(out)


def legend_width(names: Sequence[str]) -> float:
    """How wide a legend is [px]."""
    return 38 + CHARACTER * max((len(name) for name in names), default=0)


def round_values(low: float, high: float, most: int = 6) -> list[float]:
    """Round values from low to high, at most that many."""
    if high <= low:
        return [low]
    rough = (high - low) / max(1, most - 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * f for f in (1.0, 2.0, 2.5, 5.0, 10.0) if power * f >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 12) for k in range(first, last + 1)]


def page(title: str, width: float, height: float, parts: Sequence[str]) -> str:
    """A whole file with its title on top."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="Helvetica, Arial, DejaVu Sans, sans-serif">\n'
        f'<title>{escape(title)}</title>\n<rect width="100%" height="100%" fill="white"/>\n'
        + "\n".join([text(20, 28, title, size=16, bold=True), *parts])
        + "\n</svg>\n"
    )
