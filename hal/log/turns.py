"""Turns in logs: quaternions x, y, z, w, rotation matrices, roll, pitch and yaw."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from .log_file import LogError


def unit_quaternions(values: Array, order: str) -> Array:
    """Return quaternions x, y, z, w of norm 1, those of zeros, which are none, are NaN.

    Raises:
        LogError: they are no quaternions.
    """
    four = values if order == "xyzw" else values[:, [1, 2, 3, 0]]
    norm = np.linalg.norm(four, axis=1, keepdims=True)
    turns = np.isfinite(norm) & (norm > 1e-6)
    said = norm[turns]
    if said.size and abs(np.median(said) - 1.0) > 0.05:
        raise LogError(f"no quaternions: their norm is {np.median(said):.3g}, expected 1")
    return np.where(turns, four, np.nan) / np.where(turns, norm, 1.0)


def quaternion_of_rpy(angles: Array) -> Array:
    """Return quaternions x, y, z, w (n, 4) of roll, pitch and yaw (n, 3) [rad]: R = Rz Ry Rx."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(0.5 * angles).T, np.cos(0.5 * angles).T
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy,
        ],
        axis=1,
    )  # fmt: skip


def rotation_of(four: Array) -> Array:
    """Return rotation matrices (n, 3, 3) of quaternions x, y, z, w (n, 4) of any norm."""
    return matrices_of_quaternions(four / np.linalg.norm(four, axis=1, keepdims=True))


def rotation_of_rpy(angles: Array) -> Array:
    """Return rotation matrices (n, 3, 3) of roll, pitch and yaw (n, 3) [rad]."""
    return rotation_of(quaternion_of_rpy(angles))


def rates_of(four: Array, change: Array) -> Array:
    """Return angular velocities (n, 3) [rad/s], in the body's axes, of quaternions x, y, z, w (n, 4) and their change [1/s]."""
    x, y, z, w = four.T
    a, b, c, d = change.T
    return 2.0 * np.stack(
        [w * a - x * d - y * c + z * b, w * b - y * d - z * a + x * c, w * c - z * d - x * b + y * a],
        axis=1,
    )  # fmt: skip
