"""Distances between segments at many instants: those of capsules, less their radii."""

from __future__ import annotations

import math

from .arrays import Array1D, Array2D, Array3D, Vector3
from .kernel import kernel


@kernel
def bounded(value: float) -> float:
    """Clip the value to between 0 and 1."""
    return min(max(value, 0.0), 1.0)


@kernel
def segment_gap(a: Vector3, b: Vector3, c: Vector3, d: Vector3) -> float:
    """Return the distance between the segments a-b and c-d.

    The closest points are the crossing of the two lines where it lies in both segments, else an
    end of one of them and what is closest to it on the other.
    """
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    w0, w1, w2 = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    uv = u0 * v0 + u1 * v1 + u2 * v2
    uw, vw = u0 * w0 + u1 * w1 + u2 * w2, v0 * w0 + v1 * w1 + v2 * w2
    determinant = uu * vv - uv * uv
    crossing = 0.5
    if determinant > 1e-12 * uu * vv:
        crossing = bounded((uv * vw - vv * uw) / determinant)
    best = math.inf
    for trial in range(3):
        s = crossing if trial == 0 else float(trial - 1)
        t = bounded((vw + s * uv) / vv) if vv > 0.0 else bounded(vw + s * uv)
        s = bounded((t * uv - uw) / uu) if uu > 0.0 else bounded(t * uv - uw)
        x, y, z = w0 + s * u0 - t * v0, w1 + s * u1 - t * v1, w2 + s * u2 - t * v2
        best = min(best, x * x + y * y + z * z)
    return math.sqrt(best)


@kernel
def capsule_gaps(
    starts: Array3D, ends: Array3D, radii: Array1D,
    other_starts: Array3D, other_ends: Array3D, other_radii: Array1D, out: Array2D,
) -> None:  # fmt: skip
    """Compute the distances between some capsules and others at n instants.

    Args:
        starts, ends, radii: (n_first, n, 3) and (n_first,); the others' are (n_second, n, 3) and (n_second,).
        out: the distance of first i and second j is row i n_second + j, (n_first n_second, n).
    """
    for i in range(radii.shape[0]):
        for j in range(other_radii.shape[0]):
            row = i * other_radii.shape[0] + j
            apart = radii[i] + other_radii[j]
            for k in range(out.shape[1]):
                gap = segment_gap(starts[i, k], ends[i, k], other_starts[j, k], other_ends[j, k])
                out[row, k] = gap - apart
