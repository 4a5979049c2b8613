"""How far inside its support a robot's centre of mass is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def support_margin(
    points: NDArray[np.float64], loaded: NDArray[np.bool_], x: float, y: float
) -> float:
    """The distance [m] of (``x``, ``y``) from the edge of the convex hull of the ``loaded`` ones
    of ``points`` (n, 2 or 3), positive inside and negative outside or on a hull without area.

    Every pair of points that has all others on its left is an edge; the margin is the smallest
    distance to the left of an edge. Outside a corner that understates how far away the place is.
    With one point it is minus the distance to it, with none minus one metre.
    """
    used = [k for k in range(len(points)) if loaded[k]]
    if not used:
        return -1.0
    margin = math.inf
    for i in used:
        ax, ay = points[i].item(0), points[i].item(1)
        for j in used:
            dx, dy = points[j].item(0) - ax, points[j].item(1) - ay
            length = math.hypot(dx, dy)
            if length < 1e-9:
                continue
            leftmost = all(
                dx * (points[k].item(1) - ay) - dy * (points[k].item(0) - ax) >= -1e-12
                for k in used
            )
            if leftmost:
                margin = min(margin, (dx * (y - ay) - dy * (x - ax)) / length)
    if margin == math.inf:
        first = points[used[0]]
        return -math.hypot(first.item(0) - x, first.item(1) - y)
    return margin
