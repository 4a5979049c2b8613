"""How the base and the joints turn and place what they carry, as CasADi expressions.

The base's attitude is given by the Euler angles pitch, roll, yaw of ``R = Ry(pitch) Rx(roll) Rz(yaw)``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...robots.description import Joint, Link
from ...robots.welding import HeldLoad

Expression = Any
"""A CasADi SX or DM; the library has no types of its own."""


def base_rotation(angles: Expression) -> Expression:
    """The rotation from body to world of pitch, roll, yaw."""
    import casadi as ca

    sp, cp = ca.sin(angles[0]), ca.cos(angles[0])
    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    return ca.vertcat(
        ca.horzcat(cp * cy + sp * sr * sy, -cp * sy + sp * sr * cy, sp * cr),
        ca.horzcat(cr * sy, cr * cy, -sr),
        ca.horzcat(-sp * cy + cp * sr * sy, sp * sy + cp * sr * cy, cp * cr),
    )


def base_angular_velocity(angles: Expression, rates: Expression) -> Expression:
    """The base's angular velocity in the body frame."""
    import casadi as ca

    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    return ca.vertcat(
        cr * sy * rates[0] + cy * rates[1],
        cr * cy * rates[0] - sy * rates[1],
        -sr * rates[0] + rates[2],
    )


def base_angular_acceleration(
    angles: Expression, rates: Expression, accelerations: Expression
) -> Expression:
    """The time derivative of ``base_angular_velocity``, in the body frame."""
    import casadi as ca

    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    _, roll, yaw = rates[0], rates[1], rates[2]
    drift = ca.vertcat(
        (-sr * sy * roll + cr * cy * yaw) * rates[0] - sy * yaw * roll,
        (-sr * cy * roll - cr * sy * yaw) * rates[0] - cy * yaw * roll,
        -cr * roll * rates[0],
    )
    return base_angular_velocity(angles, accelerations) + drift


def joint_origin(joint: Joint, place: Expression) -> Expression:
    """The child's origin in the parent's frame; a slide carries it along its axis."""
    import casadi as ca

    origin = ca.DM(list(joint.origin))
    return origin + ca.DM(list(joint.axis)) * place if joint.kind == "slide" else origin


def joint_rotation(joint: Joint, angle: Expression) -> Expression:
    """The rotation from child to parent: none for a slide, Rodrigues' formula for a hinge.

    A hinge about a coordinate axis gets a matrix with structural zeros, which is far cheaper.
    """
    import casadi as ca

    if joint.kind == "slide":
        return ca.SX.eye(3)
    axis = int(np.argmax(np.abs(joint.axis)))
    if abs(joint.axis[axis]) != 1.0:
        x, y, z = joint.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turned = ca.DM(cross) * ca.sin(angle) + ca.DM(cross @ cross) * (1.0 - ca.cos(angle))
        return ca.SX.eye(3) + turned
    sine, cosine = joint.axis[axis] * ca.sin(angle), ca.cos(angle)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = ca.SX(3, 3)
    rotation[axis, axis] = 1
    rotation[first, first] = rotation[second, second] = cosine
    rotation[first, second], rotation[second, first] = -sine, sine
    return rotation


def inertia_tensor(link: Link | HeldLoad) -> np.ndarray[Any, np.dtype[np.float64]]:
    xx, yy, zz, xy, xz, yz = link.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
