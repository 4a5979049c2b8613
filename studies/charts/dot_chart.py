"""One line a cell: a dot with its interval, and the goal where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from . import svg

STEP, TOP, WIDTH = 26.0, 62.0, 460.0


@dataclass(frozen=True)
class Dot:
    """A value with its interval; ``note`` stands at the right, ``goal`` is a mark."""

    name: str
    value: float
    low: float
    high: float
    note: str = ""
    goal: float | None = None
    met: bool | None = None


def dot_chart(title: str, x_label: str, dots: Sequence[Dot], *, share: bool = False) -> str:
    """Dots under each other. With ``share`` the axis is from 0 to 100 %."""
    low, high = 0.0, 1.0
    if not share:
        low = min((d.low for d in dots), default=0.0)
        high = max((d.high for d in dots), default=1.0)
        room = 0.05 * (high - low) or 0.5
        low, high = (0.0 if 0 <= low < 0.3 * high else low - room), high + room
    left = 34 + svg.CHARACTER * max((len(d.name) for d in dots), default=0)
    bottom = TOP + STEP * len(dots)

    def across(value: float) -> float:
        return left + (value - low) / (high - low) * WIDTH

    out: list[str] = []
    for value in svg.round_values(low, high, 6):
        words = f"{value:.0%}" if share else f"{value:g}"
        out.append(svg.line(across(value), TOP - 6, across(value), bottom))
        out.append(
            svg.text(across(value), bottom + 17, words, anchor="middle", size=11, fill=svg.FAINT)
        )
    for number, each in enumerate(dots):
        y = TOP + STEP * (number + 0.5)
        ink = {True: 2, False: 1, None: 0}[each.met]
        out.append(svg.text(left - 12, y + 4, each.name, anchor="end"))
        look = f'stroke="{svg.colour(ink)}" stroke-width="3" stroke-opacity="0.45" '
        look += 'stroke-linecap="round"'
        out.append(svg.line(across(each.low), y, across(each.high), y, look))
        if each.goal is not None:
            x = across(each.goal)
            out.append(svg.line(x, y - 9, x, y + 9, f'stroke="{svg.INK}" stroke-width="1.5"'))
        out.append(svg.dot(across(each.value), y, ink, 4.5))
        out.append(svg.text(left + WIDTH + 14, y + 4, each.note, size=11, fill=svg.FAINT))
    out.append(svg.text(left + WIDTH / 2, bottom + 36, x_label, anchor="middle"))
    width = left + WIDTH + 34 + 6 * max((len(d.note) for d in dots), default=0)
    return svg.page(title, max(width, 50 + 9 * len(title)), bottom + 50, out)
