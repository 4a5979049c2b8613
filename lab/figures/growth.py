"""Draws what grows with what: a panel for each curve of ``aloft bench growth``, with an earlier build's beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...plotting import COLOURS, FAINT, Curve, Panel, draw_panels, new_figure, style, svg_text

COLUMNS = 2
PANEL_HEIGHT = 2.3
"""inch, with its title and what x is."""


class Measured(NamedTuple):
    """The points of a curve.

    Attributes:
        work: what is measured.
        over: what grows.
        points: its values.
        times: processor time at each point [s].
        earlier: that of the earlier build [s]; empty without one.
        since: the earlier build.
    """

    work: str
    over: str
    points: list[int]
    times: list[float]
    earlier: list[float]
    since: str


def measured(rows: Sequence[Mapping[str, Any]]) -> list[Measured]:
    """Return the curves in the rows of ``aloft bench growth``. The earlier build's time is this one's divided by the
    median of the ratios, each of which is of one turn."""
    found: dict[str, Measured] = {}
    for row in rows:
        work, _, place = row["name"].rpartition(": ")
        point, over = place.split()
        curve = found.setdefault(work, Measured(work, over, [], [], [], row["peer"]))
        curve.points.append(int(point))
        curve.times.append(row["value"])
        if row["ratio"] is not None:
            curve.earlier.append(row["value"] / row["ratio"])
    return list(found.values())


def seconds(time: float) -> str:
    """Format a time [s] with two digits."""
    return f"{time:.2g} s" if time < 10.0 else f"{time:.0f} s"


def growth_chart(rows: Sequence[Mapping[str, Any]]) -> str:
    """Draw the curves as SVG text. Each ends in its last time."""
    curves = measured(rows)
    lines = -(-len(curves) // COLUMNS)
    with style():
        figure = new_figure(9.0, 0.5 + PANEL_HEIGHT * lines, "What grows with what: processor time")
        axes = list(figure.subplots(lines, COLUMNS, squeeze=False).flat)
        for left_over in axes[len(curves) :]:
            left_over.set_axis_off()
        draw_panels(list(zip(axes, map(_panel, curves), strict=False)))
        return svg_text(figure)


def _panel(curve: Measured) -> Panel:
    x = np.array(curve.points, dtype=float)
    # from zero, so that a straight line through the origin is what grows in proportion
    lines = [Curve("", np.zeros(1), np.zeros(1), COLOURS[0])]
    if curve.earlier:
        name = f"{seconds(curve.earlier[-1])} {curve.since[:8]}"
        lines.append(Curve(name, x, np.array(curve.earlier), FAINT, True))
    lines.append(Curve(seconds(curve.times[-1]), x, np.array(curve.times), COLOURS[0]))
    return Panel(f"{curve.work} [s]", lines, curve.over, (0.0, float(x[-1])))
