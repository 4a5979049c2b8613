"""A polar chart: one curve for every line around the origin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ...plotting import FAINT, look, new_figure, style, svg_text

MOST_FILLED = 3
"""Where there are more curves than this, none is filled, and the curves are turned a little against one
another: they would hide what lies below."""
TURN = math.radians(1.0)
"""The angle between neighbours among many curves [rad]."""


def polar_chart(
    title: str,
    subtitle: str,
    curves: Mapping[str, Sequence[tuple[float, float]]],
    rings: Sequence[float],
    unit: str,
) -> str:
    """The chart as SVG text.

    Args:
        title: stands on top.
        subtitle: stands below it.
        curves: points (angle [rad], radius) by the curve's name. Angle zero is up, and angles grow
            to the left, as seen from above. A curve whose angles go once around is closed.
        rings: the radii that are drawn and labelled; the largest one is the edge.
        unit: what the radius is, with its unit.
    """
    edge = max(rings, default=1.0)
    letters = max((len(name) for name in curves), default=0)
    width = max(6.0 + 0.085 * letters, 0.6 + 0.105 * len(title), 0.6 + 0.08 * len(subtitle))
    with style():
        figure = new_figure(width, 6.2, f"{title}\n")
        figure.text(0.01, 1.0 - 0.42 / 6.2, subtitle, color=FAINT, va="center")
        axes = figure.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(1)
        axes.set_thetagrids(range(0, 360, 45))
        axes.set_ylim(0.0, edge)
        axes.set_rgrids(
            rings, [f"{ring:g}" for ring in rings], angle=-22.5, fontsize=8, color=FAINT,
            ha="center", va="center",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip
        axes.text(math.radians(-22.5), 1.1 * edge, unit, color=FAINT, fontsize=8, ha="left")
        for number, (name, points) in enumerate(curves.items()):
            ordered = sorted(points)
            closed = goes_around([angle for angle, _ in ordered])
            if closed:
                ordered.append(ordered[0])
            aside = 0.0
            if len(curves) > MOST_FILLED:
                aside = TURN * (number - 0.5 * (len(curves) - 1))
            angles = [angle + aside for angle, _ in ordered]
            radii = [radius for _, radius in ordered]
            if closed and len(curves) <= MOST_FILLED:
                axes.fill(angles, radii, color=look(number)["color"], alpha=0.06, linewidth=0)
            axes.plot(
                angles, radii, marker="o", markersize=4.5, markeredgecolor="white", clip_on=False,
                markeredgewidth=0.7, label=name, gid=f"line-{number}", **look(number),
            )  # fmt: skip
        figure.legend(loc="outside right center")
        return svg_text(figure)


def goes_around(angles: Sequence[float]) -> bool:
    """Whether no two neighbours of the sorted angles [rad] are more than a quarter turn apart."""
    if len(angles) < 3:
        return False
    around = [*angles, angles[0] + 2 * math.pi]
    return max(b - a for a, b in pairwise(around)) <= math.pi / 2 + 1e-9
