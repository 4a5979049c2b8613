"""The Euler angles of the base by which plans are solved: R = Ry Rx Rz, from body to world.

Functions take and return the angles about x, y and z. The planner's coordinates (n_velocities) are base
position, pitch, roll, yaw and joints: ``ORDER`` leads from one order of the angles to the other.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.kernel_on_rows import KernelOnRows
from ...mathematics.euler_motion import motions_in_body, motions_in_world
from ...mathematics.rotations import matrices_of_quaternions

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
    size = v.shape[-1]
    angles = q.reshape(-1, size)[:, 3:6]
    call = _in_body(size)
    sine, cosine, rate, change, _, velocity, acceleration = call.rows(len(angles))
    np.sin(angles, out=sine)
    np.cos(angles, out=cosine)
    rate[:], change[:] = v.reshape(-1, size), bend.reshape(-1, size)
    call.run()
    return velocity.reshape(v.shape).copy(), acceleration.reshape(v.shape).copy()


@cache
def _in_body(size: int) -> KernelOnRows:
    """Return the call of ``motions_in_body`` for so many coordinates."""
    return KernelOnRows(
        motions_in_body,
        lambda n: (*np.zeros((2, n, 3)), *np.zeros((2, n, size)), np.zeros((3, 3)), *np.zeros((2, n, size))),
    )  # fmt: skip


def coordinates_of(position: Array, velocity: Array) -> tuple[Array, Array]:
    """Return the planner's coordinates and their rates, both (n, n_velocities), of a motion: ``position`` (n,
    n_positions) and ``velocity`` (n, n_velocities) as ``pose_of`` and ``twist_of`` give them.
    """
    angles, call = euler_angles(position[:, 3:7])[:, ORDER], _in_world(velocity.shape[1])
    sine, cosine, given, _, rates = call.rows(len(angles))
    np.sin(angles, out=sine)
    np.cos(angles, out=cosine)
    given[:] = velocity
    call.run()
    return np.hstack([position[:, :3], angles, position[:, 7:]]), rates.copy()


@cache
def _in_world(size: int) -> KernelOnRows:
    """Return the call of ``motions_in_world`` for so many coordinates."""
    return KernelOnRows(
        motions_in_world,
        lambda n: (*np.zeros((2, n, 3)), np.zeros((n, size)), np.zeros((3, 3)), np.zeros((n, size))),
    )  # fmt: skip
