"""Balance of a standing robot: its stability margin, and where it must step when that is lost.

The linear inverted pendulum of height h has the natural frequency w, w^2 = g / h. Its capture point

    xi = c + c' / w + (k_y, -k_x) w / (m g)

is the place above which it would come to rest if the ground pushed there; the last term is how far
the ground's force can move off that place to remove the angular momentum k within 1 / w. While the
force acts at p, the capture point moves away from it: xi(t) = p + (xi - p) exp(w t). So outside the
support polygon it cannot be brought back, and only a step helps (Pratt et al., "Capture point: a
step toward humanoid push recovery", Humanoids 2006; Englsberger et al., IROS 2011).
"""

from __future__ import annotations

import math

from .arrays import Array1D, Array2D, Flags1D, Indices1D
from .constants import GRAVITY
from .elementary import hypot, sincos
from .kernel import kernel


@kernel
def capture_point(
    com: Array1D,
    velocity: Array1D,
    angular: Array1D,
    mass: float,
    height: float,
    turn: float,
    out: Array1D,
) -> float:
    """Compute the capture point ``out`` (2,) [m]; returns the pendulum's frequency w [1/s].

    Args:
        com, velocity: of the centre of mass [m, m/s], (3,).
        angular: momentum about it [N m s], (3,).
        height: of the centre of mass above the ground [m]; less than 0.05 m counts as that.
        turn: the share of the angular momentum that counts.
    """
    rate = math.sqrt(GRAVITY / max(height, 0.05))
    way = turn * rate / (mass * GRAVITY)
    out[0] = com[0] + velocity[0] / rate + way * angular[1]
    out[1] = com[1] + velocity[1] / rate - way * angular[0]
    return rate


@kernel
def nearest_in_foot(
    points: Array2D, foot_of_point: Indices1D, foot: int, place: Array1D, out: Array1D
) -> float:
    """Find the place ``out`` (2,) nearest to a ``place`` (2,) between two contact points of a
    ``foot``.

    Args:
        points: all contact points [m], (n, 3).
        foot_of_point: the foot of every point, (n,).

    Returns:
        The distance [m].
    """
    x, y = place[0], place[1]
    least = math.inf
    for i in range(points.shape[0]):
        if foot_of_point[i] != foot:
            continue
        ax, ay = points[i, 0], points[i, 1]
        for j in range(i, points.shape[0]):
            if foot_of_point[j] != foot:
                continue
            dx, dy = points[j, 0] - ax, points[j, 1] - ay
            square = dx * dx + dy * dy
            share = 0.0
            if square > 1e-12:
                share = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0)
            px, py = ax + share * dx, ay + share * dy
            distance = hypot(x - px, y - py)
            if distance < least:
                least = distance
                out[0], out[1] = px, py
    return least


@kernel
def farthest_foot(
    points: Array2D, foot_of_point: Indices1D, n_feet: int, place: Array1D, scratch: Array1D
) -> int:
    """Find the foot that is farthest from a ``place`` (2,): the one that carries least there.

    ``scratch`` has the shape (2,).
    """
    chosen, most = 0, -1.0
    for foot in range(n_feet):
        distance = nearest_in_foot(points, foot_of_point, foot, place, scratch)
        if distance > most + 1e-9:
            chosen, most = foot, distance
    return chosen


@kernel
def limit_foothold(
    stance: Array1D,
    heading: float,
    side: float,
    ahead: float,
    nearest: float,
    farthest: float,
    out: Array1D,
) -> None:
    """Move a foothold to where the legs reach and do not cross.

    Args:
        stance: the middle of the feet that stand [m], (3,).
        heading: of these feet [rad].
        side: 1 if the foot belongs on their left, -1 on their right, 0 for either.
        ahead: the farthest place ahead of or behind them [m].
        nearest, farthest: the range of its distance to that side [m].
        out: the foothold, (3,), changed.
    """
    sine, cosine = sincos(heading)
    dx, dy = out[0] - stance[0], out[1] - stance[1]
    along = min(max(cosine * dx + sine * dy, -ahead), ahead)
    across = cosine * dy - sine * dx
    if side != 0.0:
        across = side * min(max(side * across, nearest), farthest)
    else:
        across = min(max(across, -farthest), farthest)
    out[0] = stance[0] + cosine * along - sine * across
    out[1] = stance[1] + sine * along + cosine * across


@kernel
def approach(place: float, speed: float, goal: float, left: float) -> float:
    """Return the present acceleration [m/s^2] of the motion that reaches ``goal`` at rest after
    ``left`` [s].

    It is the motion of least mean square acceleration: 6 (goal - place) / left^2 - 4 speed / left.
    """
    return 6.0 * (goal - place) / (left * left) - 4.0 * speed / left


@kernel
def spread_to_feet(stance: Flags1D, foot: Indices1D, n_feet: int, out: Flags1D) -> int:
    """All points of the feet that have a point in ``stance``; returns how many feet these are."""
    count = 0
    for number in range(n_feet):
        stands = False
        for i in range(stance.shape[0]):
            if foot[i] == number and stance[i]:
                stands = True
        for i in range(stance.shape[0]):
            if foot[i] == number:
                out[i] = stands
        count += 1 if stands else 0
    return count


@kernel
def support_margin(points: Array2D, loaded: Flags1D, x: float, y: float) -> float:
    """Return the distance [m] of the place (``x``, ``y``) from the edge of the support polygon.

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
        ax, ay = points[i, 0], points[i, 1]
        for j in range(count):
            if not loaded[j]:
                continue
            dx, dy = points[j, 0] - ax, points[j, 1] - ay
            length = math.sqrt(dx * dx + dy * dy)
            if length < 1e-9:
                continue
            leftmost = True
            for k in range(count):
                side = dx * (points[k, 1] - ay) - dy * (points[k, 0] - ax)
                leftmost = leftmost and (side >= -1e-12 or not loaded[k])
            if leftmost:
                margin = min(margin, (dx * (y - ay) - dy * (x - ax)) / length)
    if first < 0:
        return -1.0
    if margin == math.inf:
        dx, dy = points[first, 0] - x, points[first, 1] - y
        return -math.sqrt(dx * dx + dy * dy)
    return margin
