"""The mathematics of the state estimator as pure functions: propagation and corrections.

Orientations are quaternions x, y, z, w from body to world and are changed in place. Points are
the contact points seen from the base [m, body frame], their rates what they would have if the
base only turned [m/s, body frame]. Nothing here allocates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .constants import GRAVITY
from .kernel import kernel
from .rotations import integrate, normalise, rotate

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@kernel
def propagate(
    orientation: Array,
    position: Array,
    velocity: Array,
    last_rate: Array,
    rate: Array,
    specific_force: Array,
    period: float,
    middle: Array,
    acceleration: Array,
) -> None:
    """One period of inertial navigation.

    The angular velocity is taken to be linear between its samples and the specific force is the
    mean over the period, turned by the orientation in the middle of it:
    v += (R_mid f + g) T, p += v T + (R_mid f + g) T^2 / 2.

    Args:
        last_rate, rate: angular velocity at the beginning and the end [rad/s, body]; the first
            becomes the mean.
        middle, acceleration: scratch, (4,) and (3,); the second is the world acceleration after.
    """
    for i in range(3):
        last_rate[i] = 0.5 * (float(last_rate[i]) + float(rate[i]))
    integrate(orientation, last_rate, 0.5 * period, middle)
    integrate(orientation, last_rate, period, orientation)
    rotate(middle, specific_force, acceleration)
    acceleration[2] -= GRAVITY
    for i in range(3):
        gained = period * float(acceleration[i])
        position[i] += period * (float(velocity[i]) + 0.5 * gained)
        velocity[i] += gained


@kernel
def turn(orientation: Array, x: float, y: float, z: float) -> None:
    """Turn by a small rotation vector [rad, world], to second order and normalised."""
    qx, qy, qz, qw = (
        float(orientation[0]),
        float(orientation[1]),
        float(orientation[2]),
        float(orientation[3]),
    )
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    w = 1.0 - 0.5 * (x * x + y * y + z * z)
    orientation[0] = w * qx + x * qw + y * qz - z * qy
    orientation[1] = w * qy - x * qz + y * qw + z * qx
    orientation[2] = w * qz + x * qy - y * qx + z * qw
    orientation[3] = w * qw - x * qx - y * qy - z * qz
    normalise(orientation, orientation)


@kernel
def right_up(orientation: Array, specific_force: Array, gain: float, up: Array) -> None:
    """Turn a share ``gain`` of the way to where the specific force points straight up.

    Args:
        up: scratch (3,).
    """
    rotate(orientation, specific_force, up)
    x, y, z = float(up[0]), float(up[1]), float(up[2])
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-3:
        return
    turn(orientation, gain * y / size, -gain * x / size, 0.0)


@kernel
def upright(specific_force: Array, orientation: Array) -> None:
    """The orientation without heading in which the specific force points straight up."""
    x, y, z = float(specific_force[0]), float(specific_force[1]), float(specific_force[2])
    size = math.sqrt(x * x + y * y + z * z)
    orientation[0] = orientation[1] = orientation[2] = 0.0
    orientation[3] = 1.0
    if size < 1e-3:
        return
    # Half way between the force's direction and up is the quaternion's axis of rotation.
    orientation[0], orientation[1], orientation[3] = y / size, -x / size, 1.0 + z / size
    if orientation[3] < 1e-6:
        orientation[0], orientation[1], orientation[3] = 1.0, 0.0, 0.0
    normalise(orientation, orientation)


@kernel
def misalignment(
    orientation: Array, points: Array, forward: Array, out: Array, place: Array
) -> bool:
    """The turn (3,) [rad, world] that brings all points to one height and ``forward`` to x.

    A small turn (a, b) about the world's x and y changes the height of a point at (x, y) from the middle
    by a y - b x; least squares over the points. False, and zero, while they are in one line.

    Args:
        forward: the direction the feet point [body].
        place: scratch (3,).
    """
    n = points.shape[0]
    mean_x, mean_y, mean_z = 0.0, 0.0, 0.0
    for i in range(n):
        rotate(orientation, points[i], place)
        mean_x += float(place[0]) / n
        mean_y += float(place[1]) / n
        mean_z += float(place[2]) / n
    xx, xy, yy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        rotate(orientation, points[i], place)
        x, y, z = float(place[0]) - mean_x, float(place[1]) - mean_y, float(place[2]) - mean_z
        xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
    determinant = xx * yy - xy * xy
    out[0] = out[1] = out[2] = 0.0
    if determinant <= 1e-4 * (xx + yy) * (xx + yy):
        return False
    out[0] = (xy * xz - xx * yz) / determinant
    out[1] = (yy * xz - xy * yz) / determinant
    rotate(orientation, forward, place)
    out[2] = -math.atan2(float(place[1]), float(place[0]))
    return True


@kernel
def weigh(world_rates: Array, active: Flags, velocity: Array, gate: float, weights: Array) -> float:
    """How far to trust that each active point stands still; returns the largest weight.

    The point's velocity is ``velocity`` plus its world rate. Its weight falls from one as
    1 / (1 + (speed / gate)^2)^2: noise passes, a slipping or lifting point does not.
    """
    largest = 0.0
    for i in range(weights.shape[0]):
        weights[i] = 0.0
        if active[i]:
            x = float(velocity[0]) + float(world_rates[i, 0])
            y = float(velocity[1]) + float(world_rates[i, 1])
            z = float(velocity[2]) + float(world_rates[i, 2])
            ratio = 1.0 + (x * x + y * y + z * z) / (gate * gate)
            weights[i] = weight = 1.0 / (ratio * ratio)
            largest = max(largest, weight)
    return largest


class StandingPoints(NamedTuple):
    """Contact points, turned to the world.

    ``places`` from the base's origin and their ``rates`` as the base turns and the joints move [m,
    m/s], (n, 3); which are ``active`` and with what ``weights``, (n,); the ``anchors`` where they stand
    [m, world], (n, 3), and which have one, ``anchored`` (n,).
    """

    places: Array
    rates: Array
    active: Flags
    weights: Array
    anchors: Array
    anchored: Flags


@kernel
def stand_on(
    points: StandingPoints,
    velocity_gain: float,
    position_gain: float,
    position: Array,
    velocity: Array,
) -> None:
    """Correct velocity and position by the points that stand still.

    Every active point is anchored where it was first seen active. If it stands still, the base
    moves with minus its rate and is at its anchor minus its place; the weighted means of these
    corrections are applied with the gains. What a point is not trusted with, it drags its anchor
    along, so a foot that has slipped is anchored where it came to rest.
    """
    active, weights = points.active, points.weights
    anchors, anchored = points.anchors, points.anchored
    total = 0.0
    for i in range(weights.shape[0]):
        total += float(weights[i])
    share = 1.0 / max(total, 1.0)
    for k in range(3):
        still, back = 0.0, 0.0
        for i in range(weights.shape[0]):
            if not active[i]:
                continue
            weight = float(weights[i])
            place = float(position[k]) + float(points.places[i, k])
            if anchored[i]:
                anchors[i, k] += (1.0 - weight) * (place - float(anchors[i, k]))
            else:
                anchors[i, k] = place
            still -= weight * (float(velocity[k]) + float(points.rates[i, k]))
            back += weight * (float(anchors[i, k]) - place)
        velocity[k] += velocity_gain * share * still
        position[k] += position_gain * share * back
    for i in range(weights.shape[0]):
        anchored[i] = active[i]
