"""Exact flight of a robot without contacts, from what is conserved: its momentum.

The joints move as planned. The centre of mass flies a parabola, and the angular momentum k about it is
constant, so the base turns as

    w = I(q)^-1 (R' k - h(q, dq/dt)),

with I the inertia of the robot, as rigid in this pose, about its centre of mass, and h the angular momentum of
the joints' motion, both in the base's axes. I and h depend on the joints only and are known for every
instant beforehand. Only the orientation R is integrated, by Runge and Kutta's method of order four. These are
the equations of motion of ``ExactDynamics``, integrated once, at a quarter of the cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.kinematics import matrices_of_quaternions

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class JointSide:
    """What the joints' motion says at n instants, in the base's axes.

    Attributes:
        com, com_velocity: the centre of mass seen from the base [m], and how it moves [m/s], (n, 3).
        inertia: about it [kg m^2], (n, 3, 3).
        momentum: the angular momentum about it of the joints' motion [N m s], (n, 3).
    """

    com: Array
    com_velocity: Array
    inertia: Array
    momentum: Array


def joint_side(pin: Any, model: Any, data: Any, position: Array, velocity: Array) -> JointSide:
    """The same from joint angles and velocities, both (n, n_joints)."""
    count = len(position)
    found = JointSide(
        np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    )
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    q[6] = 1.0
    for i in range(count):
        q[7:], v[6:] = position[i], velocity[i]
        matrix = pin.ccrba(model, data, q, v)
        moved = data.hg
        found.com[i] = data.com[0]
        found.com_velocity[i] = moved.linear
        found.inertia[i] = matrix[3:, 3:6]
        found.momentum[i] = moved.angular
    found.com_velocity[:] /= data.Ig.mass
    return found


def coast(base: Array, twist: Array, side: JointSide, step: float) -> tuple[Array, Array]:
    """The base after every step of a flight: its places (n, 7) and twists (n, 6).

    Args:
        base: its position [m] and quaternion (x, y, z, w) at the beginning, (7,).
        twist: its linear and angular velocity there [m/s, rad/s], in its own axes, (6,).
        side: what the joints say at the beginning, in the middle and at the end of every step, (2 n + 1).
        step: how long one step is [s].
    """
    count = len(side.com) // 2
    inverse = np.linalg.inv(side.inertia)
    own: list[Vector] = [
        (x, y, z) for x, y, z in np.einsum("nij,nj->ni", inverse, side.momentum).tolist()
    ]
    inverses = inverse.reshape(-1, 9).tolist()
    turn = matrices_of_quaternions(base[None, 3:7])[0]
    carried = turn @ (side.inertia[0] @ twist[3:6] + side.momentum[0])
    kx, ky, kz = carried.tolist()

    def spin(i: int, x: float, y: float, z: float, w: float) -> Quaternion:
        """The derivative of the quaternion at an instant."""
        # R' k for a quaternion that need not be of length one
        scale = 1.0 / (x * x + y * y + z * z + w * w)
        tx, ty, tz = 2.0 * (ky * z - kz * y), 2.0 * (kz * x - kx * z), 2.0 * (kx * y - ky * x)
        ax = kx + scale * (w * tx + ty * z - tz * y)
        ay = ky + scale * (w * ty + tz * x - tx * z)
        az = kz + scale * (w * tz + tx * y - ty * x)
        a, b, c, d, e, f, g, h, j = inverses[i]
        ox, oy, oz = own[i]
        wx = a * ax + b * ay + c * az - ox
        wy = d * ax + e * ay + f * az - oy
        wz = g * ax + h * ay + j * az - oz
        return (
            0.5 * (w * wx + y * wz - z * wy), 0.5 * (w * wy + z * wx - x * wz),
            0.5 * (w * wz + x * wy - y * wx), -0.5 * (x * wx + y * wy + z * wz),
        )  # fmt: skip

    x, y, z, w = base[3:7].tolist()
    quaternions = np.empty((count + 1, 4))
    quaternions[0] = x, y, z, w
    half, sixth = 0.5 * step, step / 6.0
    for n in range(count):
        i = 2 * n
        a = spin(i, x, y, z, w)
        b = spin(i + 1, x + half * a[0], y + half * a[1], z + half * a[2], w + half * a[3])
        c = spin(i + 1, x + half * b[0], y + half * b[1], z + half * b[2], w + half * b[3])
        d = spin(i + 2, x + step * c[0], y + step * c[1], z + step * c[2], w + step * c[3])
        x += sixth * (a[0] + 2.0 * (b[0] + c[0]) + d[0])
        y += sixth * (a[1] + 2.0 * (b[1] + c[1]) + d[1])
        z += sixth * (a[2] + 2.0 * (b[2] + c[2]) + d[2])
        w += sixth * (a[3] + 2.0 * (b[3] + c[3]) + d[3])
        size = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * size, y * size, z * size, w * size
        quaternions[n + 1] = x, y, z, w
    return _around_com(base, twist, side, quaternions, carried, step)


def _around_com(
    base: Array, twist: Array, side: JointSide, quaternions: Array, carried: Array, step: float
) -> tuple[Array, Array]:
    """Place and twist of the base behind every step, from its orientation and the parabola."""
    turns = matrices_of_quaternions(quaternions)
    com, rate = side.com[::2], side.com_velocity[::2]
    within = np.einsum("nji,j->ni", turns, carried) - side.momentum[::2]
    spins = np.linalg.solve(side.inertia[::2], within[:, :, None])[:, :, 0]
    start = base[:3] + turns[0] @ com[0]
    speed = turns[0] @ (twist[:3] + np.cross(twist[3:6], com[0]) + rate[0])
    time = step * np.arange(len(com))[:, None]
    down = np.array([0.0, 0.0, GRAVITY])
    flown, flying = start + time * speed - 0.5 * time**2 * down, speed - time * down
    places = flown - np.einsum("nij,nj->ni", turns, com)
    linear = np.einsum("nji,nj->ni", turns, flying) - np.cross(spins, com) - rate
    return np.hstack([places, quaternions])[1:], np.hstack([linear, spins])[1:]
