"""Interpolation: linear in tables of one or several dimensions, and polynomials between two states of motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array1D, Array2D, Indices1D, Vector3
from .kernel import kernel


@kernel
def interval(points: Array1D, start: int, count: int, at: float) -> int:
    """Return the place of the interval, from 0 to count - 2, in which ``at`` lies; the outer ones
    go on.

    The rising points are ``points[start]`` to ``points[start + count - 1]``, at least two.
    """
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if at < points[start + middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def interpolate(points: Array1D, values: Array1D, at: float, clamp: bool) -> float:
    """Return the value at ``at`` of the line through (points, values); both (k), points rising, k
    >= 2.

    Beyond the ends the outer values hold (``clamp``), or the outer lines go on.
    """
    k = interval(points, 0, points.shape[0], at)
    x0, x1 = points[k], points[k + 1]
    share = (at - x0) / (x1 - x0)
    if clamp:
        share = min(max(share, 0.0), 1.0)
    return float(values[k] * (1.0 - share) + values[k + 1] * share)


@kernel
def interpolate_grid(
    points: Array1D,
    counts: Indices1D,
    values: Array1D,
    at: Array1D,
    clamp: bool,
    places: Indices1D,
    shares: Array1D,
) -> float:
    """Return the multilinear value at ``at`` (d) of a table on a grid of d dimensions.

    ``points`` are the rising points of all axes one behind the other, ``counts`` (d) how many each
    has, at least two; ``values`` is the table in row-major order, flat. ``places`` (d) and
    ``shares`` (d) are scratch.
    """
    dimensions = counts.shape[0]
    start = 0
    for axis in range(dimensions):
        count = counts[axis]
        k = interval(points, start, count, at[axis])
        x0, x1 = points[start + k], points[start + k + 1]
        share = (at[axis] - x0) / (x1 - x0)
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
            share = shares[axis]
            weight *= share if upper == 1 else 1.0 - share
            place = place * counts[axis] + places[axis] + upper
        if weight != 0.0:
            total += weight * values[place]
    return total


@kernel
def cubic_motion(
    place: Array2D, rate: Array2D, time: Array1D, knot: Indices1D, passed: Array1D,
    places: Array2D, rates: Array2D, changes: Array2D,
) -> None:  # fmt: skip
    """Compute places, rates and their changes (n, m) on the cubics between the places and rates (n_knots, m) of knots
    at ``time`` (n_knots,), each at a time ``passed`` (n,) since a ``knot`` (n,). Two knots at one time count as one
    second apart.
    """
    for i in range(knot.shape[0]):
        k, length = knot[i], time[knot[i] + 1] - time[knot[i]]
        t = length if length > 0.0 else 1.0
        u = passed[i] / t
        for j in range(place.shape[1]):
            way, begin, end = place[k + 1, j] - place[k, j], rate[k, j], rate[k + 1, j]
            bend = 3.0 * way - t * (2.0 * begin + end)
            twist = t * (begin + end) - 2.0 * way
            places[i, j] = place[k, j] + u * (t * begin + u * (bend + u * twist))
            rates[i, j] = begin + u / t * (2.0 * bend + 3.0 * u * twist)
            changes[i, j] = (2.0 * bend + 6.0 * u * twist) / (t * t)


@dataclass(frozen=True)
class Quintic:
    """A polynomial of degree five in time, lowest coefficient first."""

    coefficients: tuple[float, ...]

    def position(self, time: float) -> float:
        """Return the value of the polynomial at ``time``."""
        a, b, c, d, e, f = self.coefficients
        return a + time * (b + time * (c + time * (d + time * (e + time * f))))

    def velocity(self, time: float) -> float:
        """Return the first derivative at ``time``."""
        _, b, c, d, e, f = self.coefficients
        return b + time * (2 * c + time * (3 * d + time * (4 * e + time * 5 * f)))

    def acceleration(self, time: float) -> float:
        """Return the second derivative at ``time``."""
        _, _, c, d, e, f = self.coefficients
        return 2 * c + time * (6 * d + time * (12 * e + time * 20 * f))


def quintic(
    duration: float, start: tuple[float, float, float], end: tuple[float, float, float]
) -> Quintic:
    """Return the quintic from position, velocity and acceleration at 0 to those at ``duration``."""
    t = duration
    matrix = np.array(
        [
            [t**3, t**4, t**5],
            [3 * t**2, 4 * t**3, 5 * t**4],
            [6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    p, v, a = start
    right = np.array([end[0] - p - v * t - 0.5 * a * t**2, end[1] - v - a * t, end[2] - a])
    d, e, f = np.linalg.solve(matrix, right).tolist()
    return Quintic((p, v, 0.5 * a, d, e, f))


@kernel
def minimum_jerk(share: float) -> tuple[float, float, float]:
    """Return the minimum-jerk motion from 0 to 1: its value and two derivatives after a ``share``
    u.

    The motion 10 u^3 - 15 u^4 + 6 u^5 begins and ends at rest. A ``share`` outside of 0 to 1 gives
    the state at the nearer end.
    """
    u = min(max(share, 0.0), 1.0)
    return (
        u * u * u * (10.0 + u * (-15.0 + 6.0 * u)),
        30.0 * u * u * (1.0 - u) * (1.0 - u),
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


@kernel
def lengthen(
    off_place: Vector3,
    gain: float,
    limit: float,
    flight: float,
    duration: float,
    share: float,
    place: Vector3,
    velocity: Vector3,
    acceleration: Vector3,
) -> None:
    """Let a jump land elsewhere: v_d s(u) is added to the velocity of the centre of mass, its integral to the
    place and its derivative to the acceleration, with s the motion of ``minimum_jerk``, until lift-off, and

        v_d = d / (T_f + T_p / 2),    d = -gain off_place, of a length of at most ``limit``,

    so that at touchdown they have moved it by d.

    Args:
        off_place: the horizontal position error of the feet, (3,) [m].
        gain: the share of the error that is corrected.
        limit: the largest change of the jump's length [m].
        flight: the duration T_f of the planned flight [s].
        duration, share: how long before lift-off it begins, T_p [s], and the share u of that
            time which is over, 0 to 1.
        place, velocity, acceleration: of the centre of mass, (3,) each; they are changed.
    """
    u = min(max(share, 0.0), 1.0)
    grown, rate, _ = minimum_jerk(u)
    size = gain * math.sqrt(off_place[0] ** 2 + off_place[1] ** 2)
    limited = 1.0 if size <= limit else limit / size
    for k in range(2):
        speed = -limited * gain * off_place[k] / (flight + 0.5 * duration)
        place[k] += speed * duration * u * u * u * u * (2.5 + u * (u - 3.0))
        velocity[k] += speed * grown
        acceleration[k] += speed * rate / duration
