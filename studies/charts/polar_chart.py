"""A polar chart: one closed curve for every arm around the origin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from . import svg

RADIUS = 230.0
TOP = 60.0
MOST_FILLED = 3
"""More curves than these are not filled: what lies below would be hidden."""


def polar_chart(
    title: str,
    subtitle: str,
    curves: Mapping[str, Sequence[tuple[float, float]]],
    rings: Sequence[float],
    unit: str,
) -> str:
    """Curves of (angle [rad], radius); zero is up and angles grow to the left, as seen from above.

    The rings are labelled with their values; the largest is the edge. A curve whose angles go
    once around is closed; another one stays open.
    """
    edge = max(rings) or 1.0
    centre_x, centre_y = 50 + RADIUS, TOP + 40 + RADIUS

    def place(angle: float, radius: float) -> tuple[float, float]:
        length = RADIUS * radius / edge
        return centre_x - length * math.sin(angle), centre_y - length * math.cos(angle)

    out = [svg.text(20, 47, subtitle, fill=svg.FAINT)]
    for degrees in range(0, 360, 15):
        far = place(math.radians(degrees), edge)
        out.append(svg.line(centre_x, centre_y, *far, f'stroke="{svg.PALE}" stroke-width="0.7"'))
        if degrees % 45 == 0:
            x, y = place(math.radians(degrees), edge * 1.075)
            out.append(svg.text(x, y + 4, f"{degrees}°", anchor="middle", fill=svg.FAINT))
    for ring in rings:
        length = RADIUS * ring / edge
        heavy = 1.4 if ring == edge else 0.8
        out.append(
            f'<circle cx="{centre_x:.1f}" cy="{centre_y:.1f}" r="{length:.1f}" fill="none" '
            f'stroke="{svg.PALE}" stroke-width="{heavy}"/>'
        )
    for number, points in enumerate(curves.values()):
        ordered = sorted(points)
        placed = [place(angle, radius) for angle, radius in ordered]
        closed = _goes_around([angle for angle, _ in ordered])
        filled = closed and len(curves) <= MOST_FILLED
        fill = f'fill="{svg.colour(number)}" fill-opacity="0.06"' if filled else 'fill="none"'
        out.append(svg.path(placed, f"{fill} {svg.stroke(number)}", closed=closed))
        out += [svg.dot(x, y, number) for x, y in placed]
    label = math.radians(-7.5)
    for ring in rings:
        x, y = place(label, ring)
        out.append(
            f'<rect x="{x - 13:.1f}" y="{y - 7:.1f}" width="26" height="13" fill="white" '
            'fill-opacity="0.85"/>'
        )
        out.append(svg.text(x, y + 4, f"{ring:g}", anchor="middle", size=11, fill=svg.FAINT))
    x, y = place(label, edge * 1.075)
    out.append(svg.text(x + 4, y, unit, size=11, fill=svg.FAINT))
    names = list(curves)
    legend_x = centre_x + RADIUS + 60
    out.append(svg.legend(names, legend_x, TOP + 40))
    width = legend_x + svg.legend_width(names) + 20
    height = max(centre_y + RADIUS + 45, TOP + 60 + 20 * len(names))
    return svg.page(title, max(width, 60 + 9 * len(title)), height, out)


def _goes_around(angles: Sequence[float]) -> bool:
    """Whether the largest gap between neighbours is no more than a quarter turn."""
    if len(angles) < 3:
        return False
    around = [*angles, angles[0] + 2 * math.pi]
    return max(b - a for a, b in pairwise(around)) <= math.pi / 2 + 1e-9
