"""Poses with a quaternion from the planner's coordinates."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array


def pose_of(q: Array) -> Array:
    """Base position, quaternion x, y, z, w and joints of base position, pitch, roll, yaw and joints.

    A product of half angles: it changes sign only where a full turn does.
    """
    pitch, roll, yaw = q[3:6]
    half = np.array([[0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2)],
                     [np.sin(roll / 2), 0.0, 0.0, np.cos(roll / 2)],
                     [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]])  # fmt: skip
    turned = product(product(half[0], half[1]), half[2])
    return np.concatenate([q[:3], turned, q[6:]])


def product(a: Array, b: Array) -> Array:
    """Of two quaternions."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])
