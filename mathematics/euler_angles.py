"""Roll, pitch and yaw: the rotation about z by yaw, then about the new y by pitch, then about x by
roll; so R = Rz(yaw) Ry(pitch) Rx(roll). Quaternions are x, y, z, w as in ``rotations``."""

from __future__ import annotations

import math

from .arrays import Array
from .kernel import kernel


@kernel
def from_euler(angles: Array, out: Array) -> None:
    """The unit quaternion (4) of roll, pitch and yaw [rad]."""
    r, p, y = 0.5 * float(angles[0]), 0.5 * float(angles[1]), 0.5 * float(angles[2])
    cr, sr, cp, sp, cy, sy = (
        math.cos(r), math.sin(r), math.cos(p), math.sin(p), math.cos(y), math.sin(y),
    )  # fmt: skip
    out[0] = sr * cp * cy - cr * sp * sy
    out[1] = cr * sp * cy + sr * cp * sy
    out[2] = cr * cp * sy - sr * sp * cy
    out[3] = cr * cp * cy + sr * sp * sy


@kernel
def to_euler(quaternion: Array, out: Array) -> None:
    """Roll (-pi to pi), pitch (-pi/2 to pi/2) and yaw (-pi to pi) [rad] of a unit quaternion.

    Where pitch is at its end only the sum or difference of the others is defined, and they are
    ill-conditioned near it.
    """
    x, y, z, w = (
        float(quaternion[0]),
        float(quaternion[1]),
        float(quaternion[2]),
        float(quaternion[3]),
    )
    sine = 2.0 * (w * y - z * x)
    side = 2.0 * (x * y + w * z)
    front = 1.0 - 2.0 * (y * y + z * z)
    out[0] = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    # not the arc sine, which would lose half the digits near its end
    out[1] = math.atan2(sine, math.sqrt(side * side + front * front))
    out[2] = math.atan2(side, front)
