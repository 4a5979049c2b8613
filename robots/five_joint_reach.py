"""Targets beyond the reach of a five-joint leg, and the velocity of its targets.

These kernels complete ``five_joint_leg``: they move a foot's target into reach in the plane of its
sole, slow down a leg that stretches, and differentiate the foot's line. All quantities are in the
base's frame, in m and rad.
"""

from __future__ import annotations

import math

from ..mathematics.arrays import Array
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import multiply_matrices, solve_damped
from .five_joint_leg import inverse

_LEVEL = 0.3
"""A sole whose normal has less than this along the base's z axis does not slide."""
_HALVINGS = 8
"""The number of bisections: the place in reach is found to within a 256th of the way."""
_FARTHEST = 10.0
"""Places are limited to this distance [m] before they slide."""
_JUMP = 0.1
"""A line that rotates by more than this [rad] in a tick is a new target, not a motion."""


@kernel
def pitched_line(rotation: Array, pitch: float, out: Array) -> None:
    """The x axis of ``rotation`` (3, 3), turned by ``pitch`` [rad] about its y axis."""
    cosine, sine = math.cos(pitch), math.sin(pitch)
    for i in range(3):
        out[i] = cosine * float(rotation[i, 0]) - sine * float(rotation[i, 2])


@kernel
def slide(
    hip: Array,
    plane: Array,
    signs: Array,
    limits: Array,
    sole: Array,
    rotation: Array,
    softness: float,
    kept_yaw: float,
    level: float,
    place: Array,
    angles: Array,
) -> tuple[bool, float]:
    """Move a ``sole`` out of reach, in its own plane, towards a place that is in reach.

    That place is the foot of the perpendicular from the hip to the plane of the sole, or if even
    this is out of reach the plane's point on the base's z axis through the hip, where every angle
    of the hip is small. The place in reach that is nearest to the target on the line between both
    is found by bisection, to within a 256th of their distance.

    Args:
        hip, plane, signs, limits, softness, kept_yaw, level: as for ``five_joint_leg.inverse``.
        sole, rotation: the target's place and axes, of which the third is normal to the sole.
        place: scratch (3,).
        angles: out, the joint angles (5,) for that place; as they were where there is none.

    Returns:
        Whether there is such a place, and the second result of ``inverse`` for it.
    """
    nx, ny, nz = float(rotation[0, 2]), float(rotation[1, 2]), float(rotation[2, 2])
    if nz < _LEVEL or not abs(nx * nx + ny * ny + nz * nz - 1.0) < 0.1:
        return False, 1.0
    hx, hy, hz = float(hip[0]), float(hip[1]), float(hip[2])
    sx = min(max(float(sole[0]), -_FARTHEST), _FARTHEST)
    sy = min(max(float(sole[1]), -_FARTHEST), _FARTHEST)
    sz = min(max(float(sole[2]), -_FARTHEST), _FARTHEST)
    depth = nx * (hx - sx) + ny * (hy - sy) + nz * (hz - sz)
    line = rotation[:, 0]
    for axis in range(2):
        ax, ay, az = hx - depth * nx, hy - depth * ny, hz - depth * nz
        if axis == 1:
            ax, ay, az = hx, hy, hz - depth / nz
        near, far, share = 0.0, 1.0, 1.0
        for step in range(_HALVINGS + 2):
            # First the end of the way, whether it is in reach; halves of it; the answer again.
            last = step == _HALVINGS + 1
            part = near if step == 0 or last else 0.5 * (near + far)
            place[0] = ax + part * (sx - ax)
            place[1] = ay + part * (sy - ay)
            place[2] = az + part * (sz - az)
            inside, kept = inverse(
                hip, plane, signs, limits, place, line, softness, kept_yaw, level, angles
            )
            if inside:
                near, share = part, kept
            elif step == 0:
                break
            else:
                far = part
            if last:
                return True, share
    inverse(hip, plane, signs, limits, sole, line, softness, kept_yaw, level, angles)
    return False, 1.0


@kernel
def keep_along(axis: Array, vector: Array) -> None:
    """Replace ``vector`` (3,) by its component along ``axis`` (3,), which has unit length."""
    part = 0.0
    for i in range(3):
        part += float(axis[i]) * float(vector[i])
    for i in range(3):
        vector[i] = part * float(axis[i])


@kernel
def slow_stretch(
    hip: Array, plane: Array, sole: Array, rotation: Array, share: float, velocity: Array
) -> None:
    """Keep only a ``share`` of the velocity [m/s] that leads the ankle away from the hip.

    Args:
        hip, plane: of the ``Leg``.
        sole, rotation: of the foot, from ``five_joint_leg.forward``.
    """
    if share == 1.0:
        return
    square, along = 1e-9, 0.0
    for i in range(3):
        lever = float(plane[2, 0]) * float(rotation[i, 0]) + float(plane[2, 1]) * float(
            rotation[i, 2]
        )
        reach = float(sole[i]) - lever - float(hip[i])
        square += reach * reach
        along += reach * float(velocity[i])
    scale = (1.0 - share) * along / square
    for i in range(3):
        lever = float(plane[2, 0]) * float(rotation[i, 0]) + float(plane[2, 1]) * float(
            rotation[i, 2]
        )
        velocity[i] -= scale * (float(sole[i]) - lever - float(hip[i]))


@kernel
def line_rate(line: Array, last: Array, period: float, known: bool, out: Array) -> None:
    """The time derivative (3,) of the direction of ``line`` [1/s]; updates ``last``."""
    x, y, z = float(line[0]), float(line[1]), float(line[2])
    largest = max(abs(x), abs(y), abs(z))
    if largest < 1e-300:
        x, y, z = 1.0, 0.0, 0.0
    else:
        x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    dx, dy, dz = x - float(last[0]), y - float(last[1]), z - float(last[2])
    jumped = dx * dx + dy * dy + dz * dz > _JUMP * _JUMP
    scale = 0.0 if jumped or not known else 1.0 / period
    out[0], out[1], out[2] = scale * dx, scale * dy, scale * dz
    last[0], last[1], last[2] = x, y, z


@kernel
def inverse_velocity(
    sole_jacobian: Array,
    rotation: Array,
    velocity: Array,
    line_rate: Array,
    length: float,
    damping: float,
    held: float,
    kept_rate: float,
    rows: Array,
    turns: Array,
    normal: Array,
    out: Array,
) -> None:
    """Joint velocities (5,) for a sole velocity and a rate of the foot's line.

    Least squares, damped: (A'A + damping^2) out = A'b. A's rows are the sole's velocity, times
    ``length`` the two turns of the line, and times ``held length`` the hip's yaw.

    Args:
        sole_jacobian: from ``jacobian``.
        rotation: the foot's, from ``forward``.
        velocity: of the sole [m/s, base frame].
        line_rate: the time derivative of the line's unit direction [1/s, base frame].
        length: the distance that a rotation by 1 rad is equal to [m].
        damping: in m; 1e-4 has no effect until a leg is within 1e-4 rad of full stretch.
        held: from 0 to 1, how much the hip's yaw keeps to ``kept_rate``; see ``yaw_share``.
        kept_rate: of the robot's hip yaw near gimbal lock [rad/s].
        rows, turns, normal: scratch of shapes (6, 5), (3, 5) and (5, 5).
    """
    multiply_matrices(rotation.T, sole_jacobian[3:6, :], turns)
    turn = nod = 0.0
    for i in range(3):
        turn += float(rotation[i, 1]) * float(line_rate[i])
        nod -= float(rotation[i, 2]) * float(line_rate[i])
    for j in range(5):
        for i in range(3):
            rows[i, j] = sole_jacobian[i, j]
        rows[3, j] = length * float(turns[2, j])
        rows[4, j] = length * float(turns[1, j])
        rows[5, j] = 0.0
    rows[5, 0] = held * length
    # With the task (velocity, length * turn, length * nod), whose product with the rows is:
    for j in range(5):
        value = length * (float(rows[3, j]) * turn + float(rows[4, j]) * nod)
        for i in range(3):
            value += float(rows[i, j]) * float(velocity[i])
        out[j] = value + float(rows[5, j]) * held * length * kept_rate
    solve_damped(rows, damping, normal, out)
