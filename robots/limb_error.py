"""The error of a foot's pose, as far as the foot's kind counts it, and the rotation of targets.

How much of a target's orientation counts follows from the kind of the foot: nothing for a point
foot, the direction of its line for a line foot, all of it for a flat one. A pose is an array
(4, 3): a place, and then the rows of a rotation matrix. Everything is in the base's frame, in m
and rad. The kernels allocate nothing and return finite numbers for all finite arguments.
"""

from __future__ import annotations

import math

from ..mathematics.arrays import Array
from ..mathematics.kernel import kernel
from ..mathematics.rotations import unit

_FAR = 10.0
"""Targets are limited to this distance [m], so that no square overflows."""


@kernel
def aim(position: Array, rotation: Array, target: Array) -> None:
    """Make a target of any finite numbers: within 10 m, and with a true rotation matrix.

    Args:
        position: of the sole centre (3,).
        rotation: from foot to base (3, 3); its first and then its second axis are kept.
        target: out, the place and then the rows of the rotation matrix, (4, 3).
    """
    for k in range(3):
        target[0, k] = min(max(float(position[k]), -_FAR), _FAR)
    x0, x1, x2 = unit(
        float(rotation[0, 0]), float(rotation[1, 0]), float(rotation[2, 0]), 1.0, 0.0, 0.0
    )
    y0, y1, y2 = unit(
        float(rotation[0, 1]), float(rotation[1, 1]), float(rotation[2, 1]), 0.0, 1.0, 0.0
    )
    part = x0 * y0 + x1 * y1 + x2 * y2
    if abs(part) > 0.999999:
        # The second axis is parallel to the first: take the base's axis farthest from that.
        y0, y1, y2 = 0.0, 0.0, 0.0
        if abs(x1) <= abs(x0) and abs(x1) <= abs(x2):
            y1 = 1.0
        elif abs(x2) <= abs(x0):
            y2 = 1.0
        else:
            y0 = 1.0
        part = x0 * y0 + x1 * y1 + x2 * y2
    y0, y1, y2 = unit(y0 - part * x0, y1 - part * x1, y2 - part * x2, 0.0, 1.0, 0.0)
    target[1, 0], target[2, 0], target[3, 0] = x0, x1, x2
    target[1, 1], target[2, 1], target[3, 1] = y0, y1, y2
    target[1, 2] = x1 * y2 - x2 * y1
    target[2, 2] = x2 * y0 - x0 * y2
    target[3, 2] = x0 * y1 - x1 * y0


@kernel
def foot_error(tip: Array, pose: Array, target: Array, weights: Array, error: Array) -> float:
    """The weighted error of a foot's pose, and its square [m^2].

    Args:
        tip: of the ``Limb``.
        pose, target: a place and the rows of a rotation matrix, (4, 3).
        weights: of the place in the plane of the target's sole, of the place along its normal,
            and how many metres a turn of 1 rad counts as, (3,).
        error: out, (6,); the last three are zero for a point foot.
    """
    plane, normal, length = float(weights[0]), float(weights[1]), float(weights[2])
    ex = float(target[0, 0]) - float(pose[0, 0])
    ey = float(target[0, 1]) - float(pose[0, 1])
    ez = float(target[0, 2]) - float(pose[0, 2])
    nx, ny, nz = float(target[1, 2]), float(target[2, 2]), float(target[3, 2])
    along = (normal - plane) * (nx * ex + ny * ey + nz * ez)
    ex, ey, ez = plane * ex + along * nx, plane * ey + along * ny, plane * ez + along * nz
    tx, ty, tz, sine, cosine = 0.0, 0.0, 0.0, 0.0, 1.0
    if tip[6] == 1.0:
        lx, ly, lz = _along(pose, tip)
        wx, wy, wz = _along(target, tip)
        tx, ty, tz = ly * wz - lz * wy, lz * wx - lx * wz, lx * wy - ly * wx
        sine, cosine = math.sqrt(tx * tx + ty * ty + tz * tz), lx * wx + ly * wy + lz * wz
        if sine < 1e-7 and cosine < 0.0:
            # The line points the opposite way: turn about an axis at right angles to it.
            tx, ty, tz = unit(-ly * lx, 1.0 - ly * ly, -ly * lz, 0.0, 0.0, 1.0)
            sine = 1.0
            cosine = -1e9
    elif tip[6] == 2.0:
        # The axis of target times the foot's inverse, times the sine of the angle.
        tx = 0.5 * (_product(target, pose, 3, 2) - _product(target, pose, 2, 3))
        ty = 0.5 * (_product(target, pose, 1, 3) - _product(target, pose, 3, 1))
        tz = 0.5 * (_product(target, pose, 2, 1) - _product(target, pose, 1, 2))
        a, b, c = (
            _product(target, pose, 1, 1),
            _product(target, pose, 2, 2),
            _product(target, pose, 3, 3),
        )
        sine, cosine = math.sqrt(tx * tx + ty * ty + tz * tz), 0.5 * (a + b + c - 1.0)
        if sine < 1e-7 and cosine < 0.0:
            # Half a turn: its axis is that of the largest element of the diagonal.
            k = 1 if a >= b and a >= c else (2 if b >= c else 3)
            tx = 0.5 * (_product(target, pose, 1, k) + _product(target, pose, k, 1))
            ty = 0.5 * (_product(target, pose, 2, k) + _product(target, pose, k, 2))
            tz = 0.5 * (_product(target, pose, 3, k) + _product(target, pose, k, 3))
            if k == 1:
                tx += 1.0
            elif k == 2:
                ty += 1.0
            else:
                tz += 1.0
            tx, ty, tz = unit(tx, ty, tz, 1.0, 0.0, 0.0)
            sine = 1.0
            cosine = -1e9
    scale = length if sine < 1e-7 else length * math.atan2(sine, cosine) / sine
    tx, ty, tz = scale * tx, scale * ty, scale * tz
    error[0], error[1], error[2], error[3], error[4], error[5] = ex, ey, ez, tx, ty, tz
    return ex * ex + ey * ey + ez * ez + tx * tx + ty * ty + tz * tz


@kernel
def weigh_rows(tip: Array, pose: Array, target: Array, weights: Array, rows: Array) -> None:
    """Make of the foot's Jacobian (6, n) the negative derivative of ``foot_error``, in place."""
    plane, normal, length = float(weights[0]), float(weights[1]), float(weights[2])
    n = rows.shape[1]
    if plane != normal or plane != 1.0:
        nx, ny, nz = float(target[1, 2]), float(target[2, 2]), float(target[3, 2])
        for j in range(n):
            x, y, z = float(rows[0, j]), float(rows[1, j]), float(rows[2, j])
            along = (normal - plane) * (nx * x + ny * y + nz * z)
            rows[0, j] = plane * x + along * nx
            rows[1, j] = plane * y + along * ny
            rows[2, j] = plane * z + along * nz
    lx, ly, lz = 0.0, 0.0, 0.0
    if tip[6] == 0.0:
        length = 0.0
    elif tip[6] == 1.0:
        lx, ly, lz = _along(pose, tip)
    for j in range(n):
        x, y, z = float(rows[3, j]), float(rows[4, j]), float(rows[5, j])
        along = lx * x + ly * y + lz * z
        rows[3, j] = length * (x - along * lx)
        rows[4, j] = length * (y - along * ly)
        rows[5, j] = length * (z - along * lz)


@kernel
def turning(
    tip: Array, last: Array, target: Array, period: float, limit: float, out: Array
) -> None:
    """The angular velocity (3,) [rad/s] of a target, from its orientation one period before.

    It is that of a line's direction for a line foot and zero for a point foot. A target that has
    turned by more than ``limit`` [rad] is a new target and has no angular velocity.

    Args:
        last, target: places and rows of rotation matrices, (4, 3).
    """
    ax, ay, az, sine, cosine = 0.0, 0.0, 0.0, 0.0, 1.0
    if tip[6] == 1.0:
        lx, ly, lz = _along(last, tip)
        wx, wy, wz = _along(target, tip)
        ax, ay, az = ly * wz - lz * wy, lz * wx - lx * wz, lx * wy - ly * wx
        cosine = lx * wx + ly * wy + lz * wz
    elif tip[6] == 2.0:
        ax = 0.5 * (_product(target, last, 3, 2) - _product(target, last, 2, 3))
        ay = 0.5 * (_product(target, last, 1, 3) - _product(target, last, 3, 1))
        az = 0.5 * (_product(target, last, 2, 1) - _product(target, last, 1, 2))
        trace = _product(target, last, 1, 1) + _product(target, last, 2, 2)
        cosine = 0.5 * (trace + _product(target, last, 3, 3) - 1.0)
    sine = math.sqrt(ax * ax + ay * ay + az * az)
    angle = math.atan2(sine, cosine)
    scale = 0.0
    if angle <= limit:
        scale = 1.0 / period if sine < 1e-7 else angle / (sine * period)
    out[0], out[1], out[2] = scale * ax, scale * ay, scale * az


@kernel
def _along(pose: Array, tip: Array) -> tuple[float, float, float]:
    """The direction of a foot's line in the base's frame."""
    x, y, z = float(tip[3]), float(tip[4]), float(tip[5])
    return (
        float(pose[1, 0]) * x + float(pose[1, 1]) * y + float(pose[1, 2]) * z,
        float(pose[2, 0]) * x + float(pose[2, 1]) * y + float(pose[2, 2]) * z,
        float(pose[3, 0]) * x + float(pose[3, 1]) * y + float(pose[3, 2]) * z,
    )


@kernel
def _product(first: Array, second: Array, row: int, column: int) -> float:
    """An element of a rotation matrix times the transpose of another; row 0 is the position."""
    return (
        float(first[row, 0]) * float(second[column, 0])
        + float(first[row, 1]) * float(second[column, 1])
        + float(first[row, 2]) * float(second[column, 2])
    )
