"""The stability margin of a standing robot: how far its centre of mass is inside the support."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .kernel import kernel


@kernel
def support_margin(
    points: NDArray[np.float64], loaded: NDArray[np.bool_], x: float, y: float
) -> float:
    """The distance [m] of the place (``x``, ``y``) from the edge of the support polygon.

    The support polygon is the convex hull of the ``loaded`` ones of ``points`` (n, 2 or 3). The
    margin is positive inside, and negative outside or if the hull has no area. A pair of points
    that has all others on its left is an edge, and the margin is the smallest distance of the place
    to the left of an edge. Near a corner, outside, it is less than the true distance. With one
    loaded point it is minus the distance to that point, with none it is minus one metre.
    """
    count, first, margin = points.shape[0], -1, math.inf
    for i in range(count):
        if not loaded[i]:
            continue
        first = i if first < 0 else first
        ax, ay = float(points[i, 0]), float(points[i, 1])
        for j in range(count):
            if not loaded[j]:
                continue
            dx, dy = float(points[j, 0]) - ax, float(points[j, 1]) - ay
            length = math.sqrt(dx * dx + dy * dy)
            if length < 1e-9:
                continue
            leftmost = True
            for k in range(count):
                side = dx * (float(points[k, 1]) - ay) - dy * (float(points[k, 0]) - ax)
                leftmost = leftmost and (side >= -1e-12 or not loaded[k])
            if leftmost:
                margin = min(margin, (dx * (y - ay) - dy * (x - ax)) / length)
    if first < 0:
        return -1.0
    if margin == math.inf:
        dx, dy = float(points[first, 0]) - x, float(points[first, 1]) - y
        return -math.sqrt(dx * dx + dy * dy)
    return margin
