"""A robot as a tree of rigid bodies: its motion and its equations of motion, in plain loops.

Body 0 is the base; joint k carries body k + 1. All vectors have the world's axes. Places are relative
to the base's origin. A spatial vector has the linear part first, which is taken at the fixed point
where the base's origin is now, and then the angular part. Inertia, bias forces and momentum follow from the
composite rigid body algorithm and the recursive Newton-Euler algorithm (Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 2 and 4 to 6).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .arrays import (
    Array1D,
    Array2D,
    Array3D,
    Flags1D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from .elementary import sincos
from .kernel import kernel
from .rotations import rotate_about_axis


class BodyTree(NamedTuple):
    """Constant data of a tree of bodies: every joint's parent comes before it.

    ``parent`` (n_joints,) is the body that carries a joint; ``origin`` (n_joints, 3) [m] is where, in the
    parent's frame; ``axis`` (n_joints, 3) is the joint's axis in both frames, about which it turns, or
    along which it ``slides`` (n_joints,). Every body has a ``mass`` (n_bodies,) [kg], a ``com``
    (n_bodies, 3) [m] and an ``inertia`` (n_bodies, 6) [kg m^2] about it: xx, yy, zz, xy, xz, yz, all in
    the body's frame. Frames have the base's axes while all joints are at zero.
    """

    parent: Indices1D
    origin: Rows3
    axis: Rows3
    slides: Flags1D
    mass: Array1D
    com: Rows3
    inertia: Array2D


class BodyMotion(NamedTuple):
    """Quantities that follow from the joints' and the base's motion.

    ``rotation`` (n_bodies, 3, 3) takes a body's vectors to the world, ``place`` (n_bodies, 3) [m] is its
    frame's origin. ``joint`` (n_joints, 6) is the spatial velocity that a joint gives per unit of its
    speed. ``velocity`` and ``acceleration`` (n_bodies, 6) are spatial. The caller sets row 0 of
    ``rotation`` and ``velocity``; the base's place is zero, and so is its acceleration.
    """

    rotation: Array3D
    place: Rows3
    joint: Array2D
    velocity: Array2D
    acceleration: Array2D


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
def set_body_poses(tree: BodyTree, position: Array1D, motion: BodyMotion) -> None:
    """Compute the places of all bodies at the joints' positions [rad, or m for a slide],
    (n_joints,)."""
    for k in range(position.shape[0]):
        carrier = tree.parent[k]
        rotation, place, joint = motion.rotation[carrier], motion.place[k + 1], motion.joint[k]
        x, y, z = tree.origin[k, 0], tree.origin[k, 1], tree.origin[k, 2]
        u, v, w = tree.axis[k, 0], tree.axis[k, 1], tree.axis[k, 2]
        for row in range(3):
            a, b, c = rotation[row, 0], rotation[row, 1], rotation[row, 2]
            place[row] = motion.place[carrier, row] + (a * x + b * y + c * z)
            joint[3 + row] = a * u + b * v + c * w
        angle = position[k]
        if tree.slides[k]:
            for row in range(3):
                for column in range(3):
                    motion.rotation[k + 1, row, column] = rotation[row, column]
                joint[row] = joint[3 + row]
                place[row] = place[row] + joint[row] * angle
                joint[3 + row] = 0.0
            continue
        sine, cosine = sincos(angle)
        rotate_about_axis(rotation, tree.axis[k], cosine, sine, motion.rotation[k + 1])
        x, y, z = place[0], place[1], place[2]
        u, v, w = joint[3], joint[4], joint[5]
        joint[0], joint[1], joint[2] = y * w - z * v, z * u - x * w, x * v - y * u


@kernel
def move_bodies(tree: BodyTree, speed: Array1D, motion: BodyMotion) -> None:
    """Compute the velocities of all placed bodies at the joints' speeds [rad/s or m/s],
    (n_joints,), and their accelerations while no generalised velocity changes.

    V = V_parent + S q', and as S moves with the parent, A = A_parent + V_parent x S q'.
    """
    for k in range(speed.shape[0]):
        carrier, rate = tree.parent[k], speed[k]
        before, joint = motion.velocity[carrier], motion.joint[k]
        x, y, z = joint[0] * rate, joint[1] * rate, joint[2] * rate
        u, v, w = joint[3] * rate, joint[4] * rate, joint[5] * rate
        a, b, c = before[0], before[1], before[2]
        p, q, r = before[3], before[4], before[5]
        after = motion.velocity[k + 1]
        after[0], after[1], after[2] = a + x, b + y, c + z
        after[3], after[4], after[5] = p + u, q + v, r + w
        before, after = motion.acceleration[carrier], motion.acceleration[k + 1]
        after[0] = before[0] + ((q * z - r * y) + (b * w - c * v))
        after[1] = before[1] + ((r * x - p * z) + (c * u - a * w))
        after[2] = before[2] + ((p * y - q * x) + (a * v - b * u))
        after[3] = before[3] + (q * w - r * v)
        after[4] = before[4] + (r * u - p * w)
        after[5] = before[5] + (p * v - q * u)


@kernel
def point_position(motion: BodyMotion, body: int, local: Vector3, out: Vector3) -> None:
    """Compute the place (3,) of a body's point that is at ``local`` (3,) in the body's frame
    [m]."""
    x, y, z = local[0], local[1], local[2]
    for row in range(3):
        turned = (
            motion.rotation[body, row, 0] * x
            + motion.rotation[body, row, 1] * y
            + motion.rotation[body, row, 2] * z
        )
        out[row] = motion.place[body, row] + turned


@kernel
def velocity_at(motion: BodyMotion, body: int, place: Array1D, out: Array1D) -> None:
    """Compute the velocity (3,) of a body's point at ``place`` (3,) [m/s]: v + w x r."""
    x, y, z = place[0], place[1], place[2]
    spatial = motion.velocity[body]
    p, q, r = spatial[3], spatial[4], spatial[5]
    out[0] = spatial[0] + (q * z - r * y)
    out[1] = spatial[1] + (r * x - p * z)
    out[2] = spatial[2] + (p * y - q * x)


@kernel
def acceleration_at(motion: BodyMotion, body: int, place: Array1D, out: Array1D) -> None:
    """Compute the acceleration (3,) of a body's point at ``place`` (3,) [m/s^2]: a + w' x r + w x
    v_r."""
    velocity_at(motion, body, place, out)
    u, v, w = out[0], out[1], out[2]
    x, y, z = place[0], place[1], place[2]
    p, q, r = (
        motion.velocity[body, 3],
        motion.velocity[body, 4],
        motion.velocity[body, 5],
    )
    spatial = motion.acceleration[body]
    a, b, c = spatial[3], spatial[4], spatial[5]
    out[0] = spatial[0] + (b * z - c * y) + (q * w - r * v)
    out[1] = spatial[1] + (c * x - a * z) + (r * u - p * w)
    out[2] = spatial[2] + (a * y - b * x) + (p * v - q * u)


class Inertias(NamedTuple):
    """Every body with all that it carries (the base: the whole robot).

    ``mass`` (n_bodies,) [kg], ``moment`` (n_bodies, 3), mass times place of the centre of mass [kg m],
    ``inertia`` (n_bodies, 6) about the base's origin [kg m^2]: xx, yy, zz, xy, xz, yz. ``force``
    (n_bodies, 6) gives the bodies the acceleration of ``BodyMotion``, without gravity; ``spatial`` (6,),
    ``centre`` (3,) and ``turned`` (3, 3) are scratch.
    """

    mass: Array1D
    moment: Rows3
    inertia: Array2D
    force: Array2D
    spatial: Array1D
    centre: Vector3
    turned: Matrix3


def inertias(n_joints: int) -> Inertias:
    """Memory for the inertias of a tree."""
    n = n_joints + 1
    return Inertias(
        np.zeros(n), np.zeros((n, 3)), np.zeros((n, 6)), np.zeros((n, 6)),
        np.zeros(6), np.zeros(3), np.zeros((3, 3)),
    )  # fmt: skip


@kernel
def turn_inertia(inertia: Array1D, rotation: Matrix3, turned: Matrix3, out: Array1D) -> None:
    """R I R' of an inertia (6,): xx, yy, zz, xy, xz, yz. ``turned`` (3, 3) is scratch."""
    xx, yy, zz = inertia[0], inertia[1], inertia[2]
    xy, xz, yz = inertia[3], inertia[4], inertia[5]
    for row in range(3):
        a, b, c = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        turned[row, 0] = a * xx + b * xy + c * xz
        turned[row, 1] = a * xy + b * yy + c * yz
        turned[row, 2] = a * xz + b * yz + c * zz
    out[0] = turned[0] @ rotation[0]
    out[1] = turned[1] @ rotation[1]
    out[2] = turned[2] @ rotation[2]
    out[3] = turned[0] @ rotation[1]
    out[4] = turned[0] @ rotation[2]
    out[5] = turned[1] @ rotation[2]


@kernel
def momentum_of(inertias: Inertias, body: int, spatial: Array1D, out: Array1D) -> None:
    """Compute the spatial momentum (6,) of a body, with all that it carries, at a spatial velocity
    (6,)."""
    mass, moment, inertia = (
        inertias.mass[body],
        inertias.moment[body],
        inertias.inertia[body],
    )
    a, b, c = spatial[0], spatial[1], spatial[2]
    p, q, r = spatial[3], spatial[4], spatial[5]
    x, y, z = moment[0], moment[1], moment[2]
    xx, yy, zz = inertia[0], inertia[1], inertia[2]
    xy, xz, yz = inertia[3], inertia[4], inertia[5]
    out[0] = mass * a + (q * z - r * y)
    out[1] = mass * b + (r * x - p * z)
    out[2] = mass * c + (p * y - q * x)
    out[3] = (y * c - z * b) + (xx * p + xy * q + xz * r)
    out[4] = (z * a - x * c) + (xy * p + yy * q + yz * r)
    out[5] = (x * b - y * a) + (xz * p + yz * q + zz * r)


@kernel
def body_inertia(tree: BodyTree, motion: BodyMotion, body: int, own: Inertias) -> None:
    """Compute a body's own inertia."""
    mass = tree.mass[body]
    point_position(motion, body, tree.com[body], own.centre)
    x, y, z = own.centre[0], own.centre[1], own.centre[2]
    own.mass[body] = mass
    own.moment[body, 0], own.moment[body, 1], own.moment[body, 2] = mass * x, mass * y, mass * z
    inertia = own.inertia[body]
    turn_inertia(tree.inertia[body], motion.rotation[body], own.turned, inertia)
    inertia[0] = inertia[0] + mass * (y * y + z * z)
    inertia[1] = inertia[1] + mass * (x * x + z * z)
    inertia[2] = inertia[2] + mass * (x * x + y * y)
    inertia[3] = inertia[3] - mass * x * y
    inertia[4] = inertia[4] - mass * x * z
    inertia[5] = inertia[5] - mass * y * z


@kernel
def body_wrench(motion: BodyMotion, body: int, own: Inertias) -> None:
    """Compute the force that gives a body, of its own inertia, its acceleration: f = I a + v x* I v."""
    force, spatial = own.force[body], own.spatial
    momentum_of(own, body, motion.acceleration[body], force)
    momentum_of(own, body, motion.velocity[body], spatial)
    velocity = motion.velocity[body]
    a, b, c = velocity[0], velocity[1], velocity[2]
    p, q, r = velocity[3], velocity[4], velocity[5]
    x, y, z = spatial[0], spatial[1], spatial[2]
    u, v, w = spatial[3], spatial[4], spatial[5]
    force[0] = force[0] + (q * z - r * y)
    force[1] = force[1] + (r * x - p * z)
    force[2] = force[2] + (p * y - q * x)
    force[3] = force[3] + ((q * w - r * v) + (b * z - c * y))
    force[4] = force[4] + ((r * u - p * w) + (c * x - a * z))
    force[5] = force[5] + ((p * v - q * u) + (a * y - b * x))


@kernel
def composite_inertias(tree: BodyTree, motion: BodyMotion, composite: Inertias) -> None:
    """Compute the inertia and the force of every body with all that it carries."""
    for body in range(motion.joint.shape[0] + 1):
        body_inertia(tree, motion, body, composite)
        body_wrench(motion, body, composite)
    add_carried_inertias(tree, composite)
    for joint in range(motion.joint.shape[0] - 1, -1, -1):
        carrier, carried = tree.parent[joint], joint + 1
        for k in range(6):
            composite.force[carrier, k] = composite.force[carrier, k] + composite.force[carried, k]


@kernel
def add_carried_inertias(tree: BodyTree, composite: Inertias) -> None:
    """Add to every body's own inertia those of all that it carries."""
    for joint in range(tree.parent.shape[0] - 1, -1, -1):
        carrier, carried = tree.parent[joint], joint + 1
        composite.mass[carrier] = composite.mass[carrier] + composite.mass[carried]
        composite.moment[carrier, :] = composite.moment[carrier] + composite.moment[carried]
        for k in range(6):
            composite.inertia[carrier, k] = (
                composite.inertia[carrier, k] + composite.inertia[carried, k]
            )


@kernel
def inner(a: Array1D, b: Array1D) -> float:
    """Return the inner product of two spatial vectors (6,)."""
    total = 0.0
    for k in range(6):
        total += a[k] * b[k]
    return total


@kernel
def point_jacobian(
    tree: BodyTree, motion: BodyMotion, body: int, place: Vector3, out: Array2D
) -> None:
    """Compute the Jacobian (3, n_velocities) of a body's point: v + w x r of every generalised
    velocity."""
    for row in range(3):
        out[row, :] = 0.0
    x, y, z = place[0], place[1], place[2]
    for k in range(3):
        a, b, c = (
            motion.rotation[0, 0, k],
            motion.rotation[0, 1, k],
            motion.rotation[0, 2, k],
        )
        out[0, k], out[1, k], out[2, k] = a, b, c
        out[0, 3 + k], out[1, 3 + k], out[2, 3 + k] = b * z - c * y, c * x - a * z, a * y - b * x
    while body > 0:
        joint = motion.joint[body - 1]
        a, b, c = joint[3], joint[4], joint[5]
        out[0, 5 + body] = joint[0] + (b * z - c * y)
        out[1, 5 + body] = joint[1] + (c * x - a * z)
        out[2, 5 + body] = joint[2] + (a * y - b * x)
        body = tree.parent[body - 1]


@kernel
def rotation_jacobian(tree: BodyTree, motion: BodyMotion, body: int, out: Array2D) -> None:
    """Compute the angular velocity [rad/s, world] of a body for every generalised velocity, (3,
    n_velocities)."""
    out[:, :] = 0.0
    for row in range(3):
        for k in range(3):
            out[row, 3 + k] = motion.rotation[0, row, k]
    carried = body
    while carried > 0:
        for row in range(3):
            out[row, 5 + carried] = motion.joint[carried - 1, 3 + row]
        carried = int(tree.parent[carried - 1])
