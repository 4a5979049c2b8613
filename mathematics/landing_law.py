"""The landing law of the paper (IV), and how a foot moves to its landing place in flight."""

from __future__ import annotations

import math

from .arrays import Array
from .kernel import kernel


@kernel
def landing_place(
    nominal: Array,
    side: float,
    linear: Array,
    angular: Array,
    w_l: Array,
    w_k: Array,
    w_c: float,
    p_max: Array,
    centre: Array,
    out: Array,
) -> None:
    """The paper's law (IV): the landing place (3,) from the nominal one (3,); z is unchanged.

    Args:
        side: 1 for a foot on the left, -1 on the right, 0 in the middle.
        linear, angular: the momenta l and k fed back.
        p_max: the largest distance of the place from ``centre`` (3,), ahead and aside [m].
    """
    x = float(nominal[0]) + float(w_l[0]) * float(linear[0]) + float(w_k[0]) * float(angular[1])
    y = float(nominal[1]) + float(w_l[1]) * float(linear[1]) + float(w_k[1]) * float(angular[0])
    y += side * w_c * abs(float(linear[1]))
    out[0], out[1], out[2] = x, y, nominal[2]
    keep_within(p_max, centre, out)


@kernel
def keep_within(p_max: Array, centre: Array, place: Array) -> None:
    """Move a ``place`` (3,) that is farther from the ``centre`` than ``p_max`` ahead or aside to
    that limit."""
    for i in range(2):
        far = float(p_max[i])
        distance = float(place[i]) - float(centre[i])
        if abs(distance) > far:
            place[i] = float(centre[i]) + math.copysign(far, distance)


@kernel
def pull_to_place(goal: Array, miss: Array, gain: float, width: float) -> None:
    """Move the landing place with regard to balance towards the planned place in the world.

    The way from the planned place to the ``goal`` is d = goal + miss. Of this way the share
    gain / (1 + (|d| / width)^4) is taken back: nearly ``gain`` of a way that the standing feet can
    balance, and next to nothing where the robot would fall.

    Args:
        goal: the shift of the feet ahead and to the left [m], (2 or more,), which is changed.
        miss: by how much the feet miss their planned place without a shift [m], (2 or more,).
        width: the length of d at which half of ``gain`` is left [m].
    """
    x, y = float(goal[0]) + float(miss[0]), float(goal[1]) + float(miss[1])
    far = (x * x + y * y) / (width * width)
    share = gain / (1.0 + far * far)
    goal[0] -= share * x
    goal[1] -= share * y


@kernel
def turn_places(places: Array, angle: float, out: Array) -> None:
    """Rotate places (n, 3) about the vertical by ``angle`` [rad]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    for i in range(places.shape[0]):
        x, y = float(places[i, 0]), float(places[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = cosine * x - sine * y, sine * x + cosine * y, places[i, 2]


@kernel
def lowest_height(points: Array) -> float:
    """The least z of points (n, 3)."""
    lowest = float(points[0, 2])
    for i in range(1, points.shape[0]):
        lowest = min(lowest, float(points[i, 2]))
    return lowest


@kernel
def swing(
    planned: Array, place: Array, offset: Array, share: float, rate: float, out: Array, speed: Array
) -> None:
    """The motion of a foot from its offset at lift-off to its corrected landing place.

    Args:
        planned, place: the positions relative to the centre of mass [m, world] without and with the
            correction, (3,).
        offset: the measured minus the planned position at lift-off [m, world], (3,).
        share, rate: the share of the way, from 0 to 1, and its time derivative [1/s].
        out: becomes the foot's position.
        speed: the planned velocity [m/s], which becomes the foot's.
    """
    for k in range(3):
        goal = float(place[k]) - float(planned[k])
        start = float(offset[k])
        out[k] = float(planned[k]) + start + share * (goal - start)
        speed[k] += rate * (goal - start)


@kernel
def hasten(swing_velocity: Array, lead: float, rate: float, place: Array, speed: Array) -> None:
    """Bring a foot forward on its planned way by the time ``lead``, ahead and aside.

    Args:
        swing_velocity: planned, of the foot as seen from the centre of mass [m/s, world], (3,).
        lead, rate: how far ahead of the plan the foot should be [s], and the derivative of that.
        place, speed: the foot's position from the centre of mass [m] and its velocity [m/s], (3,),
            which are changed.
    """
    for k in range(2):
        place[k] += lead * float(swing_velocity[k])
        speed[k] += rate * float(swing_velocity[k])


@kernel
def retraction(left: float, speed: float, duration: float) -> tuple[float, float]:
    """Height added to the foot and its rate, ``left`` seconds before touchdown.

    It first reaches down, then comes up, so that at touchdown it is zero and its rate ``speed``.
    """
    x = min(max(left / duration, 0.0), 1.0)
    return -speed * duration * x * (1.0 - x) ** 2, speed * (1.0 - x) * (1.0 - 3.0 * x)


@kernel
def heading_matrix(angle: float, out: Array) -> None:
    """The rotation about the vertical by ``angle`` [rad], (3, 3)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    out[:, :] = 0.0
    out[0, 0] = out[1, 1] = cosine
    out[0, 1], out[1, 0], out[2, 2] = -sine, sine, 1.0
