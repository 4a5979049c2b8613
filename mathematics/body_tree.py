"""A robot as a tree of rigid bodies: where its bodies are and how they move, in plain loops.

Body 0 is the base; joint k carries body k + 1. All vectors have the world's axes. Places are relative
to the base's origin. A spatial vector has the linear part first, which is taken at the fixed point
where the base's origin is now, and then the angular part (Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 2 and 4).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array, Flags, Indices
from .kernel import kernel


class BodyTree(NamedTuple):
    """What does not change: every joint's parent comes before it.

    ``parent`` (n_joints,) is the body that carries a joint; ``origin`` (n_joints, 3) [m] is where, in the
    parent's frame; ``axis`` (n_joints, 3) is the joint's axis in both frames, about which it turns, or
    along which it ``slides`` (n_joints,). Every body has a ``mass`` (n_bodies,) [kg], a ``com``
    (n_bodies, 3) [m] and an ``inertia`` (n_bodies, 6) [kg m^2] about it: xx, yy, zz, xy, xz, yz, all in
    the body's frame. Frames have the base's axes while all joints are at zero.
    """

    parent: Indices
    origin: Array
    axis: Array
    slides: Flags
    mass: Array
    com: Array
    inertia: Array


class BodyMotion(NamedTuple):
    """What follows from the joints' and the base's motion.

    ``rotation`` (n_bodies, 3, 3) takes a body's vectors to the world, ``place`` (n_bodies, 3) [m] is its
    frame's origin. ``joint`` (n_joints, 6) is the spatial velocity that a joint gives per unit of its
    speed. ``velocity`` and ``acceleration`` (n_bodies, 6) are spatial. The caller sets row 0 of
    ``rotation`` and ``velocity``; the base's place is zero, and so is its acceleration.
    """

    rotation: Array
    place: Array
    joint: Array
    velocity: Array
    acceleration: Array


def body_motion(n_joints: int) -> BodyMotion:
    """Memory for the motion of a tree, with an upright base at rest."""
    n_bodies = n_joints + 1
    motion = BodyMotion(
        np.zeros((n_bodies, 3, 3)),
        np.zeros((n_bodies, 3)),
        np.zeros((n_joints, 6)),
        np.zeros((n_bodies, 6)),
        np.zeros((n_bodies, 6)),
    )
    motion.rotation[0] = np.eye(3)
    return motion


@kernel
def turn_about(base: Array, axis: Array, angle: float, out: Array) -> None:
    """``base`` (3, 3) times the rotation by ``angle`` [rad] about the unit vector ``axis``."""
    x, y, z = float(axis[0]), float(axis[1]), float(axis[2])
    cos, sin = math.cos(angle), math.sin(angle)
    rest = 1.0 - cos
    xx, yy, zz = cos + x * x * rest, cos + y * y * rest, cos + z * z * rest
    xy, xz, yz = x * y * rest, x * z * rest, y * z * rest
    for row in range(3):
        a, b, c = float(base[row, 0]), float(base[row, 1]), float(base[row, 2])
        out[row, 0] = a * xx + b * (xy + z * sin) + c * (xz - y * sin)
        out[row, 1] = a * (xy - z * sin) + b * yy + c * (yz + x * sin)
        out[row, 2] = a * (xz + y * sin) + b * (yz - x * sin) + c * zz


@kernel
def place_bodies(tree: BodyTree, position: Array, motion: BodyMotion) -> None:
    """Where all bodies are at the joints' positions [rad, or m for a slide], (n_joints,)."""
    for k in range(position.shape[0]):
        carrier = int(tree.parent[k])
        rotation, place, joint = motion.rotation[carrier], motion.place[k + 1], motion.joint[k]
        x, y, z = float(tree.origin[k, 0]), float(tree.origin[k, 1]), float(tree.origin[k, 2])
        u, v, w = float(tree.axis[k, 0]), float(tree.axis[k, 1]), float(tree.axis[k, 2])
        for row in range(3):
            a, b, c = float(rotation[row, 0]), float(rotation[row, 1]), float(rotation[row, 2])
            place[row] = float(motion.place[carrier, row]) + (a * x + b * y + c * z)
            joint[3 + row] = a * u + b * v + c * w
        angle = float(position[k])
        if tree.slides[k]:
            for row in range(3):
                for column in range(3):
                    motion.rotation[k + 1, row, column] = rotation[row, column]
                joint[row] = joint[3 + row]
                place[row] = float(place[row]) + float(joint[row]) * angle
                joint[3 + row] = 0.0
            continue
        turn_about(rotation, tree.axis[k], angle, motion.rotation[k + 1])
        x, y, z = float(place[0]), float(place[1]), float(place[2])
        u, v, w = float(joint[3]), float(joint[4]), float(joint[5])
        joint[0], joint[1], joint[2] = y * w - z * v, z * u - x * w, x * v - y * u


@kernel
def move_bodies(tree: BodyTree, speed: Array, motion: BodyMotion) -> None:
    """The velocities of all placed bodies at the joints' speeds [rad/s or m/s], (n_joints,), and
    their accelerations while no generalised velocity changes.

    V = V_parent + S q', and as S moves with the parent, A = A_parent + V_parent x S q'.
    """
    for k in range(speed.shape[0]):
        carrier, rate = int(tree.parent[k]), float(speed[k])
        before, joint = motion.velocity[carrier], motion.joint[k]
        x, y, z = float(joint[0]) * rate, float(joint[1]) * rate, float(joint[2]) * rate
        u, v, w = float(joint[3]) * rate, float(joint[4]) * rate, float(joint[5]) * rate
        a, b, c = float(before[0]), float(before[1]), float(before[2])
        p, q, r = float(before[3]), float(before[4]), float(before[5])
        after = motion.velocity[k + 1]
        after[0], after[1], after[2] = a + x, b + y, c + z
        after[3], after[4], after[5] = p + u, q + v, r + w
        before, after = motion.acceleration[carrier], motion.acceleration[k + 1]
        after[0] = float(before[0]) + ((q * z - r * y) + (b * w - c * v))
        after[1] = float(before[1]) + ((r * x - p * z) + (c * u - a * w))
        after[2] = float(before[2]) + ((p * y - q * x) + (a * v - b * u))
        after[3] = float(before[3]) + (q * w - r * v)
        after[4] = float(before[4]) + (r * u - p * w)
        after[5] = float(before[5]) + (p * v - q * u)


@kernel
def place_of(motion: BodyMotion, body: int, local: Array, out: Array) -> None:
    """The place (3,) of a body's point that is at ``local`` (3,) in the body's frame [m]."""
    x, y, z = float(local[0]), float(local[1]), float(local[2])
    for row in range(3):
        turned = (
            float(motion.rotation[body, row, 0]) * x
            + float(motion.rotation[body, row, 1]) * y
            + float(motion.rotation[body, row, 2]) * z
        )
        out[row] = float(motion.place[body, row]) + turned


@kernel
def velocity_at(motion: BodyMotion, body: int, place: Array, out: Array) -> None:
    """The velocity (3,) of a body's point at ``place`` (3,) [m/s]: v + w x r."""
    x, y, z = float(place[0]), float(place[1]), float(place[2])
    spatial = motion.velocity[body]
    p, q, r = float(spatial[3]), float(spatial[4]), float(spatial[5])
    out[0] = float(spatial[0]) + (q * z - r * y)
    out[1] = float(spatial[1]) + (r * x - p * z)
    out[2] = float(spatial[2]) + (p * y - q * x)


@kernel
def acceleration_at(motion: BodyMotion, body: int, place: Array, out: Array) -> None:
    """The acceleration (3,) of a body's point at ``place`` (3,) [m/s^2]: a + w' x r + w x v_r."""
    velocity_at(motion, body, place, out)
    u, v, w = float(out[0]), float(out[1]), float(out[2])
    x, y, z = float(place[0]), float(place[1]), float(place[2])
    p, q, r = (
        float(motion.velocity[body, 3]),
        float(motion.velocity[body, 4]),
        float(motion.velocity[body, 5]),
    )
    spatial = motion.acceleration[body]
    a, b, c = float(spatial[3]), float(spatial[4]), float(spatial[5])
    out[0] = float(spatial[0]) + (b * z - c * y) + (q * w - r * v)
    out[1] = float(spatial[1]) + (c * x - a * z) + (r * u - p * w)
    out[2] = float(spatial[2]) + (a * y - b * x) + (p * v - q * u)
