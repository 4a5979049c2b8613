"""How far inside its support a robot's centre of mass is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .kernel import kernel


@kernel
def support_margin(
    points: NDArray[np.float64], loaded: NDArray[np.bool_], x: float, y: float
) -> float:
    """The distance [m] of (``x``, ``y``) from the edge of the convex hull of the ``loaded`` ones
    of ``points`` (n, 2 or 3), positive inside and negative outside or on a hull without area.

    Every pair of points that has all others on its left is an edge; the margin is the smallest
    distance to the left of an edge. Outside a corner that understates how far away the place is.
    With one point it is minus the distance to it, with none minus one metre.
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
            length = math.hypot(dx, dy)
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
        return -math.hypot(float(points[first, 0]) - x, float(points[first, 1]) - y)
    return margin
