"""A chart with one row for each cell: a dot with its interval, and the goal where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...plotting import COLOURS, FAINT, INK, new_figure, style, svg_text

MET, MISSED, PLAIN = COLOURS[2], COLOURS[1], COLOURS[0]
"""The colours of a dot whose goal is met, whose goal is missed, and that has no goal."""


@dataclass(frozen=True)
class Dot:
    """One row of the chart.

    Attributes:
        name: what is written at the left.
        value: where the dot is.
        low, high: the ends of its interval.
        note: what is written at the right.
        goal: where the mark of the goal is; ``None`` for no goal.
        met: whether the goal is met.
    """

    name: str
    value: float
    low: float
    high: float
    note: str = ""
    goal: float | None = None
    met: bool | None = None


def dot_chart(title: str, x_label: str, dots: Sequence[Dot], *, share: bool = False) -> str:
    """The chart as SVG text, the first dot at the top.

    With ``share`` the values are shares, and the axis goes from 0 to 100 %.
    """
    from matplotlib.ticker import PercentFormatter

    letters = max((len(dot.name) for dot in dots), default=0)
    notes = max((len(dot.note) for dot in dots), default=0)
    width = max(4.8 + 0.075 * (letters + notes), 0.6 + 0.105 * len(title))
    with style():
        figure = new_figure(width, 1.1 + 0.26 * max(len(dots), 1), title)
        axes = figure.add_subplot()
        axes.grid(axis="y", visible=False)
        for row, dot in enumerate(dots):
            colour = {True: MET, False: MISSED, None: PLAIN}[dot.met]
            axes.plot(
                [dot.low, dot.high], [row, row], color=colour, alpha=0.45, linewidth=3,
                solid_capstyle="round", gid=f"interval-{row}",
            )  # fmt: skip
            if dot.goal is not None:
                axes.plot(
                    dot.goal, row, "|", color=INK, markersize=13, markeredgewidth=1.4, clip_on=False
                )
            axes.plot(
                dot.value, row, "o", color=colour, markersize=6.5, markeredgecolor="white",
                clip_on=False, gid=f"dot-{row}",
            )  # fmt: skip
            axes.annotate(
                dot.note, (1.0, row), (8, 0), xycoords=axes.get_yaxis_transform(),
                textcoords="offset points", va="center", fontsize=8, color=FAINT,
            )  # fmt: skip
        axes.set_yticks(range(len(dots)), [dot.name for dot in dots], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(dots) - 0.4, -0.6)
        axes.set_xlabel(x_label)
        if share:
            axes.set_xlim(0.0, 1.0)
            axes.xaxis.set_major_formatter(PercentFormatter(1.0, 0))
        else:
            axes.margins(x=0.05)
            _, high = axes.get_xlim()
            if 0.0 <= min((dot.low for dot in dots), default=1.0) < 0.3 * high:
                axes.set_xlim(0.0, high)
        return svg_text(figure)
