"""Rotations as pure functions over arrays: quaternions, matrices, Euler angles, exponential and logarithm.

A quaternion is x, y, z, w (Hamilton) and takes body vectors to the world. Functions write their
result into ``out``, which may be the same array as an argument, and allocate no memory. Angles are
in rad. Roll, pitch and yaw are a rotation about z by yaw, then about the new y by pitch, then about x by
roll: R = Rz(yaw) Ry(pitch) Rx(roll). Functions of many rotations at once are at the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Array1D, Array2D, Array3D, Matrix3, Vector3
from .elementary import atan2, cos, sin, sincos
from .kernel import kernel
from .linear_algebra import product

_SMALL = 1e-8
"""Below this angle [rad] the series to second order is exact to the last bit."""
_VERTICAL = 1e-8
"""The cosine of pitch below which rounding alone would choose roll and yaw."""


@kernel
def skew(vector: Array1D, out: Array2D) -> None:
    """Compute the matrix (3, 3) whose product with b is the cross product of ``vector`` and b."""
    x, y, z = vector[0], vector[1], vector[2]
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -z, y, -x
    out[1, 0], out[2, 0], out[2, 1] = z, -y, x


@kernel
def normalise(quaternion: Array1D, out: Array1D) -> None:
    """Divide a quaternion by its norm; the quaternion zero becomes the identity."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    largest = max(abs(x), abs(y), abs(z), abs(w))
    if largest == 0.0:
        out[0] = out[1] = out[2] = 0.0
        out[3] = 1.0
        return
    # Scaling first keeps the squares of very large and very small numbers representable.
    x, y, z, w = x / largest, y / largest, z / largest, w / largest
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    out[0], out[1], out[2], out[3] = x / norm, y / norm, z / norm, w / norm


@kernel
def conjugate(quaternion: Array1D, out: Array1D) -> None:
    """Compute the inverse of a unit quaternion."""
    w = quaternion[3]
    out[0], out[1], out[2] = -quaternion[0], -quaternion[1], -quaternion[2]
    out[3] = w


@kernel
def multiply(a: Array1D, b: Array1D, out: Array1D) -> None:
    """Compute the quaternion product a b, which is the rotation ``b`` followed by the rotation
    ``a``."""
    ax, ay, az, aw = a[0], a[1], a[2], a[3]
    bx, by, bz, bw = b[0], b[1], b[2], b[3]
    out[0] = aw * bx + ax * bw + ay * bz - az * by
    out[1] = aw * by - ax * bz + ay * bw + az * bx
    out[2] = aw * bz + ax * by - ay * bx + az * bw
    out[3] = aw * bw - ax * bx - ay * by - az * bz


@kernel
def rotate(quaternion: Array1D, vector: Array1D, out: Array1D) -> None:
    """Rotate ``vector`` by a unit quaternion: from body to world."""
    x, y, z = quaternion[0], quaternion[1], quaternion[2]
    rotate_components(x, y, z, quaternion[3], vector, out)


@kernel
def rotate_back(quaternion: Array1D, vector: Array1D, out: Array1D) -> None:
    """Rotate ``vector`` by the inverse of a unit quaternion: from world to body."""
    x, y, z = quaternion[0], quaternion[1], quaternion[2]
    rotate_components(-x, -y, -z, quaternion[3], vector, out)


@kernel
def rotate_components(
    x: float, y: float, z: float, w: float, vector: Array1D, out: Array1D
) -> None:
    """Rotate ``vector`` by the unit quaternion (x, y, z, w)."""
    a, b, c = vector[0], vector[1], vector[2]
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out[0] = a + w * tx + y * tz - z * ty
    out[1] = b + w * ty + z * tx - x * tz
    out[2] = c + w * tz + x * ty - y * tx


@kernel
def to_matrix(quaternion: Array1D, out: Array2D) -> None:
    """Compute the rotation matrix (3, 3) of a unit quaternion."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def rotate_about_axis(
    base: Matrix3, axis: Vector3, cosine: float, sine: float, out: Matrix3
) -> None:
    """Multiply ``base`` (3, 3) by the rotation about a unit ``axis`` by the angle of that cosine
    and sine (Rodrigues' formula)."""
    x, y, z = axis[0], axis[1], axis[2]
    rest = 1.0 - cosine
    xx, yy, zz = cosine + x * x * rest, cosine + y * y * rest, cosine + z * z * rest
    xy, xz, yz = x * y * rest, x * z * rest, y * z * rest
    for row in range(3):
        a, b, c = base[row, 0], base[row, 1], base[row, 2]
        out[row, 0] = a * xx + b * (xy + z * sine) + c * (xz - y * sine)
        out[row, 1] = a * (xy - z * sine) + b * yy + c * (yz + x * sine)
        out[row, 2] = a * (xz + y * sine) + b * (yz - x * sine) + c * zz


@kernel
def from_matrix(matrix: Array2D, out: Array1D) -> None:
    """Compute the unit quaternion of a rotation matrix, with w >= 0 where w is not tiny.

    Shepperd's method: divide by the largest of the four components, so no digit is lost.
    """
    a, b, c = matrix[0, 0], matrix[1, 1], matrix[2, 2]
    trace = a + b + c
    if trace >= a and trace >= b and trace >= c:
        s = 2.0 * math.sqrt(1.0 + trace)
        out[0] = (matrix[2, 1] - matrix[1, 2]) / s
        out[1] = (matrix[0, 2] - matrix[2, 0]) / s
        out[2] = (matrix[1, 0] - matrix[0, 1]) / s
        out[3] = 0.25 * s
        return
    i = 0 if a >= b and a >= c else (1 if b >= c else 2)
    j, k = (i + 1) % 3, (i + 2) % 3
    diagonal = 1.0 + matrix[i, i] - matrix[j, j] - matrix[k, k]
    s = 2.0 * math.sqrt(max(diagonal, 0.0))
    w = (matrix[k, j] - matrix[j, k]) / s
    sign = -1.0 if w < 0.0 else 1.0
    out[i] = sign * 0.25 * s
    out[j] = sign * (matrix[i, j] + matrix[j, i]) / s
    out[k] = sign * (matrix[i, k] + matrix[k, i]) / s
    out[3] = sign * w


@kernel
def between(a: Array1D, b: Array1D, share: float, out: Array1D) -> None:
    """Compute the unit quaternion at a ``share`` (0 to 1) of the way from ``a`` to ``b``, at an even
    rate about one axis and the short way round; the order of the elements does not matter.

    Where the two are half a turn apart the axis is not defined.
    """
    side = 0.0
    for k in range(4):
        side += a[k] * b[k]
    sign = -1.0 if side < 0.0 else 1.0
    apart = together = 0.0
    for k in range(4):
        apart += (a[k] - sign * b[k]) * (a[k] - sign * b[k])
        together += (a[k] + sign * b[k]) * (a[k] + sign * b[k])
    angle = 2.0 * atan2(math.sqrt(apart), math.sqrt(together))  # exact near zero, unlike arccos
    first, second = 1.0 - share, sign * share
    if angle > _SMALL:
        first = sin(first * angle) / sin(angle)
        second = sign * sin(share * angle) / sin(angle)
    for k in range(4):
        out[k] = first * a[k] + second * b[k]
    normalise(out, out)


@kernel
def exponential(vector: Array1D, out: Array1D) -> None:
    """Compute the unit quaternion of a rotation vector [rad]: axis times angle."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < _SMALL else sin(0.5 * angle) / angle
    out[0], out[1], out[2] = scale * x, scale * y, scale * z
    out[3] = cos(0.5 * angle)


@kernel
def logarithm(quaternion: Array1D, out: Array1D) -> None:
    """Compute the rotation vector [rad] of a unit quaternion, of length at most pi."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine < _SMALL else 2.0 * atan2(sine, w) / sine
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@kernel
def integrate(
    quaternion: Array1D, angular_velocity: Array1D, duration: float, out: Array1D
) -> None:
    """Compute the orientation after rotating at a constant body rate [rad/s] for ``duration``
    [s]."""
    wx, wy, wz = angular_velocity[0], angular_velocity[1], angular_velocity[2]
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * rate * duration
    scale = 0.5 * duration if abs(half) < _SMALL else sin(half) / rate
    bx, by, bz, bw = scale * wx, scale * wy, scale * wz, cos(half)
    ax, ay, az, aw = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    out[0] = aw * bx + ax * bw + ay * bz - az * by
    out[1] = aw * by - ax * bz + ay * bw + az * bx
    out[2] = aw * bz + ax * by - ay * bx + az * bw
    out[3] = aw * bw - ax * bx - ay * by - az * bz
    normalise(out, out)


@kernel
def yaw(quaternion: Array1D) -> float:
    """Return the heading [rad]: the angle about the world's z axis from its x axis to the
    body's."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    return atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


@kernel
def pitch_angle(quaternion: Array1D) -> float:
    """Return the angle [rad] about the world's y axis from its x axis to the body's, seen in the
    x-z plane."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    return atan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z))


@kernel
def tilt(quaternion: Array1D) -> float:
    """Return the angle [rad] between the body's z axis and the world's, from 0 to pi."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    # Computed from half angles, as the arc cosine of R_zz would lose half the digits at zero.
    return 2.0 * atan2(math.sqrt(x * x + y * y), math.sqrt(z * z + w * w))


@kernel
def wrap(angle: float) -> float:
    """Wrap an angle [rad] to between -pi and pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@kernel
def mean_heading(rotations: Array3D, counted: NDArray[np.bool_]) -> float:
    """Return the heading [rad] of the mean x axis of the rotations (n, 3, 3) that are ``counted``
    (n,)."""
    x = y = 0.0
    for i in range(rotations.shape[0]):
        if counted[i]:
            x += rotations[i, 0, 0]
            y += rotations[i, 1, 0]
    return atan2(y, x)


@kernel
def pattern_turn(
    planned: Array2D, planned_middle: Array1D, points: Array2D, middle: Array1D
) -> float:
    """Return the rotation [rad] of a pattern of points (n, 3) about the vertical, by least squares.

    Args:
        planned, planned_middle: the pattern before the rotation, and its middle (3,).
        points, middle: the same points now, and their middle.
    """
    sine = cosine = 0.0
    for i in range(planned.shape[0]):
        ax, ay = planned[i, 0] - planned_middle[0], planned[i, 1] - planned_middle[1]
        bx, by = points[i, 0] - middle[0], points[i, 1] - middle[1]
        sine += ax * by - ay * bx
        cosine += ax * bx + ay * by
    return atan2(sine, cosine)


@kernel
def turn_about_vertical(vector: Array1D, angle: float, out: Array1D) -> None:
    """Rotate a vector (3,) about the world's z axis by ``angle`` [rad]."""
    sine, cosine = sincos(angle)
    x, y = vector[0], vector[1]
    out[0], out[1], out[2] = cosine * x - sine * y, sine * x + cosine * y, vector[2]


@kernel
def unit(
    x: float, y: float, z: float, default_x: float, default_y: float, default_z: float
) -> tuple[float, float, float]:
    """Return the unit vector along (x, y, z), or the default where there is no direction.

    Dividing by the largest element first keeps very long and very short vectors exact.
    """
    largest = max(abs(x), abs(y), abs(z))
    if largest < 1e-300:
        return default_x, default_y, default_z
    x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@kernel
def from_euler(angles: Array1D, out: Array1D) -> None:
    """Compute the unit quaternion (4) of roll, pitch and yaw [rad]."""
    r, p, y = 0.5 * angles[0], 0.5 * angles[1], 0.5 * angles[2]
    cr, sr, cp, sp, cy, sy = (
        cos(r), sin(r), cos(p), sin(p), cos(y), sin(y),
    )  # fmt: skip
    out[0] = sr * cp * cy - cr * sp * sy
    out[1] = cr * sp * cy + sr * cp * sy
    out[2] = cr * cp * sy - sr * sp * cy
    out[3] = cr * cp * cy + sr * sp * sy


@kernel
def to_euler(quaternion: Array1D, out: Array1D) -> None:
    """Roll (-pi to pi), pitch (-pi/2 to pi/2) and yaw (-pi to pi) [rad] of a unit quaternion.

    Where pitch is within 1e-8 rad of its end only the sum or difference of the others is defined: roll is zero there.
    """
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    sine = 2.0 * (w * y - z * x)
    side = 2.0 * (x * y + w * z)
    front = 1.0 - 2.0 * (y * y + z * z)
    level = math.sqrt(side * side + front * front)
    # not the arc sine, which would lose half the digits near its end
    out[1] = atan2(sine, level)
    if level < _VERTICAL:
        out[0] = 0.0
        out[2] = atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
    else:
        out[0] = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        out[2] = atan2(side, front)


def cross_products(one: Array, other: Array) -> Array:
    """Cross products of vectors (..., 3), in a fraction of the time of NumPy's."""
    (ax, ay, az), (bx, by, bz) = (tuple(each[..., k] for k in range(3)) for each in (one, other))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def axis_rotations(axis: Sequence[float], angles: Array) -> Array:
    """Rotation matrices (n, 3, 3) about a unit axis by ``angles`` [rad] (n,), all at once."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    rotations: Array = np.eye(3) + sine * cross + (1.0 - cosine) * product(cross, cross)
    return rotations


def matrices_of_quaternions(quaternions: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    x, y, z, w = (quaternions[..., k] for k in range(4))
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    matrices = np.empty((*quaternions.shape[:-1], 3, 3))
    # As ``to_matrix``, of all at once.
    matrices[..., 0, 0] = 1.0 - 2.0 * (yy + zz)
    matrices[..., 0, 1] = 2.0 * (xy - wz)
    matrices[..., 0, 2] = 2.0 * (xz + wy)
    matrices[..., 1, 0] = 2.0 * (xy + wz)
    matrices[..., 1, 1] = 1.0 - 2.0 * (xx + zz)
    matrices[..., 1, 2] = 2.0 * (yz - wx)
    matrices[..., 2, 0] = 2.0 * (xz - wy)
    matrices[..., 2, 1] = 2.0 * (yz + wx)
    matrices[..., 2, 2] = 1.0 - 2.0 * (xx + yy)
    return matrices


def quaternions_of_matrices(matrices: Array) -> Array:
    """Convert rotation matrices (..., 3, 3) to unit quaternions x, y, z, w (..., 4)."""
    m = matrices
    diagonal = np.einsum("...ii->...i", m)
    trace = diagonal.sum(axis=-1)
    # four times the square of each component; the largest gives the most exact result
    squares = np.stack(
        [1.0 - trace + 2.0 * diagonal[..., k] for k in range(3)] + [1.0 + trace], axis=-1
    )
    off = {(i, j): m[..., i, j] for i in range(3) for j in range(3)}
    x, y, z = (off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1])
    xy, xz, yz = (off[0, 1] + off[1, 0], off[0, 2] + off[2, 0], off[1, 2] + off[2, 1])
    rows = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, x], axis=-1),
            np.stack([xy, squares[..., 1], yz, y], axis=-1),
            np.stack([xz, yz, squares[..., 2], z], axis=-1),
            np.stack([x, y, z, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = squares.argmax(axis=-1)
    picked = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    unit: Array = picked / np.linalg.norm(picked, axis=-1, keepdims=True)
    return unit
