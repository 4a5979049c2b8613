"""The Euler angles of the base by which plans are solved: R = Ry Rx Rz, from body to world.

Functions take and return the angles about x, y and z. The planner's coordinates (n_velocities) are base
position, pitch, roll, yaw and joints: ``ORDER`` leads from one order of the angles to the other.
"""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.rotations import cross_products, matrices_of_quaternions

ORDER = [1, 0, 2]
"""The planner's pitch, roll, yaw from angles about x, y, z, and back."""


def angles_of(rotation: Array) -> Array:
    """Return the angles [rad] (..., 3) of rotation matrices (..., 3, 3)."""
    about_x = np.arcsin(np.clip(-rotation[..., 1, 2], -1.0, 1.0))
    about_y = np.arctan2(rotation[..., 0, 2], rotation[..., 2, 2])
    about_z = np.arctan2(rotation[..., 1, 0], rotation[..., 1, 1])
    return np.stack([about_x, about_y, about_z], axis=-1)


def euler_angles(quaternions: Array) -> Array:
    """Return the angles [rad] of a motion's quaternions, both (n, ...), followed through full turns."""
    angles = angles_of(matrices_of_quaternions(quaternions))
    angles[:, 1:] = unwrapped(angles[:, 1:])
    return angles


def unwrapped(angles: Array) -> Array:
    """Return angles [rad] (n, ...) followed through full turns: what ``np.unwrap`` does along the first axis, at once
    where there are none.
    """
    if not (np.abs(angles[1:] - angles[:-1]) < np.pi).all():
        return np.unwrap(angles, axis=0)
    found = angles.copy()
    found[1:] += 0.0  # as there, minus zero becomes zero
    return found


def euler_rates(angles: Array, angular_velocity: Array) -> Array:
    """Return the rates [rad/s] of the angles (..., 3) at a body-frame angular velocity (..., 3)."""
    (x, _, z), (p, q, r) = _parts(angles), _parts(angular_velocity)
    # Undone: angular velocity = Rz' (x rate, y rate cos x, -y rate sin x) + (0, 0, z rate).
    about_y = (np.sin(z) * p + np.cos(z) * q) / np.cos(x)
    return np.stack([np.cos(z) * p - np.sin(z) * q, about_y, r + about_y * np.sin(x)], axis=-1)


def rotation(angles: Array) -> Array:
    """Return Ry Rx Rz, from body to world, (..., 3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = _parts(np.cos(angles)), _parts(np.sin(angles))
    found = np.empty((*angles.shape, 3))
    for row, (ahead, aside) in enumerate(
        ((cy, sy * sx), (0.0 * cy, cx), (-sy, cy * sx))
    ):  # of Ry Rx
        found[..., row, 0] = ahead * cz + aside * sz
        found[..., row, 1] = aside * cz - ahead * sz
    found[..., 0, 2], found[..., 1, 2], found[..., 2, 2] = sy * cx, -sx, cy * cx
    found += 0.0  # as in a product of matrices, no zero has a sign
    return found


def angular_motion(angles: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Return the angular velocity [rad/s] and acceleration [rad/s^2] in the body frame, all (..., 3)."""
    x, _, z = _parts(angles)
    (p, q, r), (a, b, c) = _parts(rates), _parts(accelerations)
    sine, cosine = np.sin(x), np.cos(x)

    def back(u: Array, v: Array, w: Array) -> Array:
        """Return Rz' of a vector."""
        return np.stack([np.cos(z) * u + np.sin(z) * v, -np.sin(z) * u + np.cos(z) * v, w], axis=-1)

    turning = back(p, q * cosine, -q * sine)
    bend = back(a, b * cosine - p * q * sine, -b * sine - p * q * cosine)
    about_z, more = np.zeros_like(turning), np.zeros_like(turning)
    about_z[..., 2], more[..., 2] = r, c
    return turning + about_z, bend - cross_products(about_z, turning) + more


def _parts(vectors: Array) -> tuple[Array, Array, Array]:
    """Return the three components of vectors (..., 3)."""
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def times(matrices: Array, vectors: Array) -> Array:
    """Multiply matrices (..., 3, 3) by vectors (..., 3)."""
    x, y, z = (each[..., None] for each in _parts(vectors))
    found = matrices[..., 0] * x + matrices[..., 1] * y + matrices[..., 2] * z
    return np.asarray(found + 0.0)  # no zero has a sign, as in ``rotation``


def times_transposed(matrices: Array, vectors: Array) -> Array:
    """Return the transposed matrices (..., 3, 3) times vectors (..., 3)."""
    return times(np.swapaxes(matrices, -1, -2), vectors)


def pose_of(q: Array) -> Array:
    """Return the robot's positions, with a quaternion x, y, z, w, of the planner's coordinates (..., n_velocities).

    The quaternion is a product of half angles: it changes sign only where a full turn does.
    """
    (sy, sx, sz), (cy, cx, cz) = _parts(np.sin(q[..., 3:6] / 2)), _parts(np.cos(q[..., 3:6] / 2))
    x, y, z, w = cy * sx, sy * cx, -(sy * sx), cy * cx
    turned = [x * cz + y * sz, y * cz - x * sz, w * sz + z * cz, w * cz - z * sz]
    return np.concatenate([q[..., :3], np.stack(turned, axis=-1), q[..., 6:]], axis=-1)


def twist_of(q: Array, v: Array, bend: Array) -> tuple[Array, Array]:
    """Return the robot's velocities and accelerations, with the base's part in the body frame, of the planner's
    coordinates, their rates and accelerations, all (..., n_velocities).
    """
    angles = q[..., 3:6][..., ORDER]
    spin, turn = angular_motion(angles, v[..., 3:6][..., ORDER], bend[..., 3:6][..., ORDER])
    to_world = rotation(angles)
    speed = times_transposed(to_world, v[..., :3])
    pull = times_transposed(to_world, bend[..., :3]) - cross_products(spin, speed)
    return (
        np.concatenate([speed, spin, v[..., 6:]], axis=-1),
        np.concatenate([pull, turn, bend[..., 6:]], axis=-1),
    )


def coordinates_of(position: Array, velocity: Array) -> tuple[Array, Array]:
    """Return the planner's coordinates and their rates, both (n, n_velocities), of a motion: ``position`` (n,
    n_positions) and ``velocity`` (n, n_velocities) as ``pose_of`` and ``twist_of`` give them.
    """
    angles = euler_angles(position[:, 3:7])
    places = np.hstack([position[:, :3], angles[:, ORDER], position[:, 7:]])
    moved = times(rotation(angles), velocity[:, :3])
    turned = euler_rates(angles, velocity[:, 3:6])[:, ORDER]
    return places, np.hstack([moved, turned, velocity[:, 6:]])
