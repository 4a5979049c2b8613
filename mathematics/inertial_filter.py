"""The mathematics of the state estimator as pure functions: propagation and corrections.

Orientations are quaternions x, y, z, w from body to world and are changed in place. Points are
the positions of the contact points relative to the base [m, body frame]. Their rates are the
velocities they would have if the base only rotated [m/s, body frame]. No function here allocates
memory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .arrays import Array1D, Array2D, Flags1D, Rows3, Vector3
from .constants import GRAVITY
from .elementary import atan2
from .kernel import kernel
from .rotations import integrate, normalise, rotate

STARTING_RATE = 0.5
"""A robot of which some points have no contact at the start stands on all if no rate [rad/s] is above this."""


@kernel
def propagate(
    orientation: Array1D,
    position: Vector3,
    velocity: Vector3,
    last_rate: Vector3,
    rate: Vector3,
    specific_force: Vector3,
    period: float,
    middle: Array1D,
    acceleration: Vector3,
) -> None:
    """Integrate the inertial measurements over one period T.

    The angular velocity is assumed to be linear between its samples, and the specific force f to be
    its mean over the period. f is rotated by the orientation R_mid in the middle of the period:
    v += (R_mid f + g) T, p += v T + (R_mid f + g) T^2 / 2.

    Args:
        last_rate, rate: angular velocity at the beginning and the end [rad/s, body], (3,) each;
            ``last_rate`` is overwritten by the mean of both.
        middle, acceleration: scratch, (4,) and (3,); ``acceleration`` holds the acceleration
            [m/s^2, world] afterwards.
    """
    last_rate[:] = 0.5 * (last_rate + rate)
    integrate(orientation, last_rate, 0.5 * period, middle)
    integrate(orientation, last_rate, period, orientation)
    rotate(middle, specific_force, acceleration)
    acceleration[2] -= GRAVITY
    for i in range(3):
        gained = period * acceleration[i]
        position[i] += period * (velocity[i] + 0.5 * gained)
        velocity[i] += gained


@kernel
def rotate_in_world(orientation: Array1D, x: float, y: float, z: float) -> None:
    """Rotate an orientation by a small rotation vector [rad, world], to second order.

    The quaternion is normalised afterwards.
    """
    qx, qy, qz, qw = (
        orientation[0],
        orientation[1],
        orientation[2],
        orientation[3],
    )
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    w = 1.0 - 0.5 * (x * x + y * y + z * z)
    orientation[0] = w * qx + x * qw + y * qz - z * qy
    orientation[1] = w * qy - x * qz + y * qw + z * qx
    orientation[2] = w * qz + x * qy - y * qx + z * qw
    orientation[3] = w * qw - x * qx - y * qy - z * qz
    normalise(orientation, orientation)


@kernel
def correct_tilt_from_gravity(
    orientation: Array1D, specific_force: Array1D, gain: float, up: Array1D
) -> None:
    """Correct the tilt of an orientation by the specific force, which should point straight up.

    Args:
        gain: the share, 0 to 1, of the angle between the specific force and up that is corrected.
        up: scratch (3,).
    """
    rotate(orientation, specific_force, up)
    x, y, z = up[0], up[1], up[2]
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-3:
        return
    rotate_in_world(orientation, gain * y / size, -gain * x / size, 0.0)


@kernel
def orientation_from_gravity(specific_force: Array1D, orientation: Array1D) -> None:
    """Compute the orientation, with no rotation about the vertical, whose specific force points
    upwards."""
    x, y, z = specific_force[0], specific_force[1], specific_force[2]
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
    orientation: Array1D,
    points: Array2D,
    active: Flags1D,
    forward: Array1D,
    gradient: Array1D,
    out: Array1D,
    place: Array1D,
) -> bool:
    """Compute the rotation (3,) [rad, world] that brings all points to the ground and ``forward``
    to x.

    A small rotation (a, b) about the world's x and y axes changes the height of a point at (x, y)
    relative to the points' mean by a y - b x; a and b are the least-squares solution over all
    points that are active. Where they lie in one line the function returns False, and the rotation is the smallest that brings this line to the
    ground; about the vertical, and of one point, it is zero.

    Args:
        active: the points to use, (n,).
        gradient: how much the ground rises along x and y, (2,); zeros: it is level.
        forward: the direction the feet point [body].
        place: scratch (3,).
    """
    mean_x, mean_y, mean_z, n = 0.0, 0.0, 0.0, 0.0
    for i in range(points.shape[0]):
        if active[i]:
            rotate(orientation, points[i], place)
            mean_x += place[0]
            mean_y += place[1]
            mean_z += place[2]
            n += 1.0
    n = max(n, 1.0)
    mean_x, mean_y, mean_z = mean_x / n, mean_y / n, mean_z / n
    xx, xy, yy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(points.shape[0]):
        if active[i]:
            rotate(orientation, points[i], place)
            x, y, z = place[0] - mean_x, place[1] - mean_y, place[2] - mean_z
            z -= gradient[0] * x + gradient[1] * y
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
            xz, yz = xz + x * z, yz + y * z
    out[2] = 0.0
    if not turn_to_level(xx, xy, yy, xz, yz, out):
        return False
    rotate(orientation, forward, place)
    out[2] = -atan2(place[1], place[0])
    return True


@kernel
def turn_to_level(xx: float, xy: float, yy: float, xz: float, yz: float, out: Array1D) -> bool:
    """Compute the turn about x and y [rad] that levels points with these sums of products; see ``misalignment``.

    It is written to the first two of ``out``. False: the points lie in one line.
    """
    determinant = xx * yy - xy * xy
    if determinant <= 1e-4 * (xx + yy) * (xx + yy):
        extent = max((xx + yy) * (xx + yy), 1e-12)
        out[0] = -(yy * yz + xy * xz) / extent
        out[1] = (xx * xz + xy * yz) / extent
        return False
    out[0] = (xy * xz - xx * yz) / determinant
    out[1] = (yy * xz - xy * yz) / determinant
    return True


@kernel
def weigh_contacts(
    world_rates: Array2D, active: Flags1D, velocity: Array1D, gate: float, weights: Array1D
) -> float:
    """Weigh each active point by how likely it stands still; returns the largest weight.

    A point's velocity is ``velocity`` plus its rate [m/s, world]. Its weight is
    1 / (1 + (speed / gate)^2)^2, which is near one for noise and small for a point that slips or
    lifts off.
    """
    largest = 0.0
    for i in range(weights.shape[0]):
        weights[i] = 0.0
        if active[i]:
            x = velocity[0] + world_rates[i, 0]
            y = velocity[1] + world_rates[i, 1]
            z = velocity[2] + world_rates[i, 2]
            ratio = 1.0 + (x * x + y * y + z * z) / (gate * gate)
            weights[i] = weight = 1.0 / (ratio * ratio)
            largest = max(largest, weight)
    return largest


class StandingPoints(NamedTuple):
    """The contact points in world coordinates.

    ``places`` (n, 3) are their positions relative to the base's origin [m], and ``rates`` (n, 3)
    their velocities [m/s] due to the base's rotation and the joints' motion. ``active`` (n,) marks
    those in contact, and ``weights`` (n,) are their weights. ``anchors`` (n, 3) are the positions
    where they stand [m, world], and ``anchored`` (n,) marks the points that have one.
    """

    places: Rows3
    rates: Rows3
    active: Flags1D
    weights: Array1D
    anchors: Rows3
    anchored: Flags1D


@kernel
def correct_by_contacts(
    points: StandingPoints,
    velocity_gain: float,
    position_gain: float,
    position: Vector3,
    velocity: Vector3,
    residual: Vector3,
) -> None:
    """Correct velocity and position by the points that stand still.

    Every active point has an anchor, at first the position at which it became active. If the point
    stands still, the base's velocity is minus the point's rate, and its position is the anchor
    minus the point's place. The weighted means of these two corrections are applied with the gains.
    A point of a weight below 1/4 moves its anchor with it, so the anchor of a foot that has slipped is
    where the foot came to rest; any other anchor holds, however many ticks a second has.

    Args:
        residual: (3,) [m/s, world], the velocity's correction before its gain, written.
    """
    active, weights = points.active, points.weights
    anchors, anchored = points.anchors, points.anchored
    total = 0.0
    for i in range(weights.shape[0]):
        total += weights[i]
    share = 1.0 / max(total, 1.0)
    for k in range(3):
        still, back = 0.0, 0.0
        for i in range(weights.shape[0]):
            if not active[i]:
                continue
            weight = weights[i]
            place = position[k] + points.places[i, k]
            if not anchored[i] or weight < 0.25:
                anchors[i, k] = place
            still -= weight * (velocity[k] + points.rates[i, k])
            back += weight * (anchors[i, k] - place)
        residual[k] = share * still
        velocity[k] += velocity_gain * residual[k]
        position[k] += position_gain * share * back
    for i in range(weights.shape[0]):
        anchored[i] = active[i]
