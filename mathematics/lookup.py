"""Tables, interpolated linearly in one dimension or in several."""

from __future__ import annotations

from .arrays import Array, Indices
from .kernel import kernel


@kernel
def interval(points: Array, start: int, count: int, at: float) -> int:
    """The place of the interval, from 0 to count - 2, in which ``at`` lies; the outer ones go on.

    The rising points are ``points[start]`` to ``points[start + count - 1]``, at least two.
    """
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if at < float(points[start + middle]):
            high = middle
        else:
            low = middle
    return low


@kernel
def interpolate(points: Array, values: Array, at: float, clamp: bool) -> float:
    """The value at ``at`` of the line through (points, values); both (k), points rising, k >= 2.

    Beyond the ends the outer values hold (``clamp``), or the outer lines go on.
    """
    k = interval(points, 0, points.shape[0], at)
    x0, x1 = float(points[k]), float(points[k + 1])
    share = (at - x0) / (x1 - x0)
    if clamp:
        share = min(max(share, 0.0), 1.0)
    return float(values[k]) * (1.0 - share) + float(values[k + 1]) * share


@kernel
def interpolate_grid(
    points: Array,
    counts: Indices,
    values: Array,
    at: Array,
    clamp: bool,
    places: Indices,
    shares: Array,
) -> float:
    """The multilinear value at ``at`` (d) of a table on a grid of d dimensions.

    ``points`` are the rising points of all axes one behind the other, ``counts`` (d) how many each
    has, at least two; ``values`` is the table in row-major order, flat. ``places`` (d) and
    ``shares`` (d) are scratch.
    """
    dimensions = counts.shape[0]
    start = 0
    for axis in range(dimensions):
        count = int(counts[axis])
        k = interval(points, start, count, float(at[axis]))
        x0, x1 = float(points[start + k]), float(points[start + k + 1])
        share = (float(at[axis]) - x0) / (x1 - x0)
        if clamp:
            share = min(max(share, 0.0), 1.0)
        places[axis] = k
        shares[axis] = share
        start += count
    total = 0.0
    for corner in range(2**dimensions):
        weight = 1.0
        place = 0
        for axis in range(dimensions):
            upper = (corner >> axis) & 1
            share = float(shares[axis])
            weight *= share if upper == 1 else 1.0 - share
            place = place * int(counts[axis]) + int(places[axis]) + upper
        if weight != 0.0:
            total += weight * float(values[place])
    return total
