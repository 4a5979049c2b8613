"""Motion of a robot under constant contact forces, by its equations of motion for the base.

The joints move as planned. At every instant the base accelerates as

    a = M(q)^-1 (W - b),

with M its own block of the mass matrix, b the bias of the joints' motion and gravity, and W the wrench of the contact
forces, all in the base's axes. M and the places of the contact points seen from the base depend on the joints only,
so both are evaluated for every instant beforehand. Runge and Kutta's method of order four has four evaluations of b a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array


@dataclass(frozen=True)
class PushedSide:
    """What the joints' angles say at n instants, in the base's axes, under given contact forces.

    Attributes:
        inverse: of the base's block of the mass matrix, (n, 6, 6).
        lever: the sum over the contacts of r F', with r a contact point seen from the base [m] and
            F its force in the world [N], (n, 3, 3).
    """

    inverse: Array
    lever: Array


def pushed_side(
    pin: Any, model: Any, data: Any, points: Callable[[Array], Array], position: Array, force: Array
) -> PushedSide:
    """The same from joint angles (n, n_joints) and forces (n_contacts, 3); ``points`` gives the
    places of the contact points (n_contacts, 3) in a configuration."""
    inertia = np.empty((len(position), 6, 6))
    places = np.empty((len(position), *force.shape))
    q = np.zeros(model.nq)
    q[6] = 1.0
    for i, angles in enumerate(position):
        q[7:] = angles
        # Of the base's own block Pinocchio writes both triangles.
        inertia[i] = pin.crba(model, data, q)[:6, :6]
        places[i] = points(q)
    inverse = np.asarray(np.linalg.inv(inertia), dtype=np.float64)
    return PushedSide(inverse, np.einsum("nci,cj->nij", places, force))


def push(
    bias: Callable[[int, Array, Array], Array],
    base: Array,
    twist: Array,
    side: PushedSide,
    force: Array,
    moment: Array,
    step: float,
) -> tuple[Array, Array]:
    """The base after every step: its places (n, 7) and twists (n, 6).

    Args:
        bias: the base's part of the bias (6,) at an instant with a place and a twist of the base.
        base: its position [m] and quaternion (x, y, z, w) at the beginning, (7,).
        twist: its linear and angular velocity there [m/s, rad/s], in its own axes, (6,).
        side: what the joints say at the beginning, in the middle and at the end of every step, (2 n + 1).
        force: the sum of all contact forces [N], in the world, (3,).
        moment: what ``side`` does not know of their moment about the base [N m], in the world, (3,).
        step: how long one step is [s].
    """
    fx, fy, fz = force.tolist()
    mx, my, mz = moment.tolist()
    levers = side.lever.reshape(-1, 9).tolist()
    wrench, rate = np.empty(6), np.empty(13)

    def rates(i: int, place: Array, speed: Array) -> Array:
        """The derivative of base position, quaternion and twist, (13,)."""
        unit = place.copy()
        x, y, z, w = place[3:7].tolist()
        size = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * size, y * size, z * size, w * size
        unit[3:7] = x, y, z, w
        # The base's axes in the world are the columns of this rotation.
        a, b, c = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
        d, e, f = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
        g, h, j = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
        # Of lever times rotation the sum over the contacts of r x R'F is the antisymmetric part.
        xx, xy, xz, yx, yy, yz, zx, zy, zz = levers[i]
        wrench[:] = (
            a * fx + d * fy + g * fz,
            b * fx + e * fy + h * fz,
            c * fx + f * fy + j * fz,
            yx * c + yy * f + yz * j - (zx * b + zy * e + zz * h) + a * mx + d * my + g * mz,
            zx * a + zy * d + zz * g - (xx * c + xy * f + xz * j) + b * mx + e * my + h * mz,
            xx * b + xy * e + xz * h - (yx * a + yy * d + yz * g) + c * mx + f * my + j * mz,
        )
        u, v, s, p, q, r = speed.tolist()
        rate[:7] = (
            a * u + b * v + c * s, d * u + e * v + f * s, g * u + h * v + j * s,
            0.5 * (w * p + y * r - z * q), 0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p), -0.5 * (x * p + y * q + z * r),
        )  # fmt: skip
        rate[7:] = side.inverse[i] @ (wrench - bias(i, unit, speed))
        return rate

    count = len(levers) // 2
    places, twists = np.empty((count, 7)), np.empty((count, 6))
    now = np.concatenate([base, twist])
    for n in range(count):
        i = 2 * n
        first = rates(i, now[:7], now[7:]).copy()
        there = now + 0.5 * step * first
        second = rates(i + 1, there[:7], there[7:]).copy()
        there = now + 0.5 * step * second
        third = rates(i + 1, there[:7], there[7:]).copy()
        there = now + step * third
        last = rates(i + 2, there[:7], there[7:])
        now = now + step / 6.0 * (first + 2.0 * (second + third) + last)
        now[3:7] /= np.linalg.norm(now[3:7])
        places[n], twists[n] = now[:7], now[7:]
    return places, twists
