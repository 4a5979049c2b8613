"""The Euler angles of the base by which plans are solved: R = Ry Rx Rz, from body to world.

Functions take and return the angles about x, y and z. The planner's coordinates (n_velocities) are base
position, pitch, roll, yaw and joints: ``ORDER`` leads from one order of the angles to the other.
"""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import product
from ...mathematics.rotations import matrices_of_quaternions, multiply

ORDER = [1, 0, 2]
"""The planner's pitch, roll, yaw from angles about x, y, z, and back."""


def angles_of(rotation: Array) -> Array:
    """The angles [rad] (..., 3) of rotation matrices (..., 3, 3)."""
    about_x = np.arcsin(np.clip(-rotation[..., 1, 2], -1.0, 1.0))
    about_y = np.arctan2(rotation[..., 0, 2], rotation[..., 2, 2])
    about_z = np.arctan2(rotation[..., 1, 0], rotation[..., 1, 1])
    return np.stack([about_x, about_y, about_z], axis=-1)


def euler_angles(quaternions: Array) -> Array:
    """The angles [rad] of a motion's quaternions, both (n, ...), followed through full turns."""
    angles = angles_of(matrices_of_quaternions(quaternions))
    angles[:, 1:] = np.unwrap(angles[:, 1:], axis=0)
    return angles


def euler_rates(angles: Array, angular_velocity: Array) -> Array:
    """The rates [rad/s] of the angles (3,) at a body-frame angular velocity (3,)."""
    x, _, z = angles
    # Undone: angular velocity = Rz' (x rate, y rate cos x, -y rate sin x) + (0, 0, z rate).
    first = np.cos(z) * angular_velocity[0] - np.sin(z) * angular_velocity[1]
    second = np.sin(z) * angular_velocity[0] + np.cos(z) * angular_velocity[1]
    about_y = second / np.cos(x)
    return np.array([first, about_y, angular_velocity[2] + about_y * np.sin(x)])


def rotation(angles: Array) -> Array:
    """Ry Rx Rz, from body to world."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return product(product(about_y, about_x), about_z)


def angular_motion(angles: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Angular velocity [rad/s] and acceleration [rad/s^2] in the body frame."""
    x, _, z = angles
    back = np.array([[np.cos(z), np.sin(z), 0.0], [-np.sin(z), np.cos(z), 0.0], [0.0, 0.0, 1.0]])
    sine, cosine = np.sin(x), np.cos(x)
    turning = product(back, np.array([rates[0], rates[1] * cosine, -rates[1] * sine]))
    bend = np.array(
        [
            accelerations[0],
            accelerations[1] * cosine - rates[0] * rates[1] * sine,
            -accelerations[1] * sine - rates[0] * rates[1] * cosine,
        ]
    )
    about_z = np.array([0.0, 0.0, rates[2]])
    change = product(back, bend) - cross(about_z, turning) + np.array([0.0, 0.0, accelerations[2]])
    return turning + about_z, change


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors (3,); NumPy's own takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def pose_of(q: Array) -> Array:
    """The robot's position, with a quaternion x, y, z, w, of the planner's coordinates.

    The quaternion is a product of half angles: it changes sign only where a full turn does.
    """
    half, quaternion = np.zeros((3, 4)), np.empty(4)
    half[[0, 1, 2], [1, 0, 2]], half[:, 3] = np.sin(q[3:6] / 2), np.cos(q[3:6] / 2)
    multiply(half[0], half[1], quaternion)
    multiply(quaternion, half[2], quaternion)
    return np.concatenate([q[:3], quaternion, q[6:]])


def twist_of(q: Array, v: Array, bend: Array) -> tuple[Array, Array]:
    """The robot's velocity and acceleration, with the base's part in the body frame, of the
    planner's coordinates, their rates and accelerations."""
    angles = q[3:6][ORDER]
    spin, turn = angular_motion(angles, v[3:6][ORDER], bend[3:6][ORDER])
    back = rotation(angles).T
    speed = back @ v[:3]
    pull = back @ bend[:3] - cross(spin, speed)
    return np.concatenate([speed, spin, v[6:]]), np.concatenate([pull, turn, bend[6:]])


def coordinates_of(position: Array, velocity: Array) -> tuple[Array, Array]:
    """The planner's coordinates and their rates, both (n, n_velocities), of a motion: ``position``
    (n, n_positions) and ``velocity`` (n, n_velocities) as ``pose_of`` and ``twist_of`` give them."""
    angles = euler_angles(position[:, 3:7])
    places = np.hstack([position[:, :3], angles[:, ORDER], position[:, 7:]])
    rates = np.zeros_like(places)
    for k, row in enumerate(velocity):
        rates[k, :3] = rotation(angles[k]) @ row[:3]
        rates[k, 3:6] = euler_rates(angles[k], row[3:6])[ORDER]
        rates[k, 6:] = row[6:]
    return places, rates
