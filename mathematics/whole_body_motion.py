"""Motion of a whole robot at many instants: momentum, contact points, base acceleration and joint
torques.

The base and the joints of a tree of bodies are given with the joints' accelerations and the contact forces. With p and n
the force and moment that the bodies need while the base does not accelerate (``composite_inertias``), c its centre of
mass, m its mass and I its inertia about c, the base accelerates by

    I alpha = sum (r - c) x F - (n - c x p),    m (a + alpha x c) = sum F + m g - p,

and the torque of a joint is what its subtree needs then, along the joint, less the contact forces on it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .arrays import Array1D, Array2D, Array3D, Flags2D, Indices1D, Rows3, Vector3
from .body_dynamics import (
    BodyMotion,
    BodyTree,
    Inertias,
    body_motion,
    composite_inertias,
    inertias,
    inner,
    momentum_of,
    move_bodies,
    point_position,
    set_body_poses,
    velocity_at,
)
from .constants import GRAVITY
from .kernel import kernel
from .linear_algebra import pairwise_sum
from .rotations import rotate, rotate_back, to_matrix


class FixedPoints(NamedTuple):
    """Points of bodies: their ``body`` (n_points,), the ``place`` (n_points, 3) [m] in its frame, and how far
    ``below`` (n_points,) it in the world they are [m]: the radius of a ball, of which the place is the centre."""

    body: Indices1D
    place: Rows3
    below: Array1D


class GivenMotion(NamedTuple):
    """The motion at n instants: ``position`` (n, 7 + n_joints) with the base's place and quaternion, ``velocity``
    (n, 6 + n_joints) with the base's in its own axes, ``bend`` (n, n_joints), the joints' accelerations, and
    ``force`` (n, n_contacts, 3) [N, world] on the first of the points."""

    position: Array2D
    velocity: Array2D
    bend: Array2D
    force: Array3D


class MotionTerms(NamedTuple):
    """Quantities that follow from the motion at n instants.

    ``com``, ``com_velocity`` and ``momentum``, the angular momentum about the centre of mass, (n, 3); ``inertia``
    (n, 6) about it: xx, yy, zz, xy, xz, yz; all in the world's axes. ``points`` and ``point_velocity``
    (n, n_points, 3) are of the material there, ``ahead`` the first axis of its body. ``base`` (n, 6) is the spatial
    acceleration of the base in its axes, ``torque`` (n, n_joints) that of the joints without rotors.
    """

    com: Rows3
    com_velocity: Rows3
    momentum: Rows3
    inertia: Array2D
    points: Array3D
    point_velocity: Array3D
    ahead: Array3D
    base: Array2D
    torque: Array2D


class MotionMemory(NamedTuple):
    """Scratch of one instant; ``gained`` (n_bodies, 6) are accelerations by the joints', the rest is (6,)."""

    motion: BodyMotion
    composite: Inertias
    gained: Array2D
    spatial: Array1D
    momentum: Array1D
    wrench: Array1D


def motion_memory(n_joints: int) -> MotionMemory:
    """Allocate the memory of a tree."""
    return MotionMemory(
        body_motion(n_joints), inertias(n_joints), np.zeros((n_joints + 1, 6)), *np.zeros((3, 6))
    )


@kernel
def evaluate_motion(
    tree: BodyTree, fixed: FixedPoints, given: GivenMotion, memory: MotionMemory, out: MotionTerms
) -> None:
    """All terms at all instants."""
    for i in range(given.position.shape[0]):
        set_poses_and_velocities(tree, given.position[i], given.velocity[i], given.bend[i], memory)
        composite_inertias(tree, memory.motion, memory.composite)
        momentum_terms(
            given.velocity[i, 6:], memory, out.com[i], out.com_velocity[i], out.momentum[i], out.inertia[i]
        )  # fmt: skip
        point_terms(fixed, given.position[i], i, memory.motion, out)
        base_acceleration(given, i, memory, out)
        joint_torques(tree, fixed, given, i, memory, out)


@kernel
def set_poses_at_instants(
    tree: BodyTree, position: Array2D, motion: BodyMotion, place: Array3D, rotation: Array3D
) -> None:
    """Compute the places of all bodies at n positions (n, 7 + n_joints): their origins (n,
    n_bodies, 3) and their rotations to the world, row by row (n, n_bodies, 9)."""
    for i in range(position.shape[0]):
        to_matrix(position[i, 3:7], motion.rotation[0])
        set_body_poses(tree, position[i, 7:], motion)
        for body in range(place.shape[1]):
            for row in range(3):
                place[i, body, row] = position[i, row] + motion.place[body, row]
                for column in range(3):
                    rotation[i, body, 3 * row + column] = motion.rotation[body, row, column]


@kernel
def place_points(
    place: Array3D, rotation: Array3D, body: Indices1D, point: Rows3, out: Array3D
) -> None:
    """Compute where points (n_points, 3) of bodies are at n instants, (n_points, n, 3), from poses as
    ``set_poses_at_instants`` gives them."""
    for k in range(body.shape[0]):
        x, y, z = point[k, 0], point[k, 1], point[k, 2]
        for i in range(place.shape[0]):
            turn = rotation[i, body[k]]
            for row in range(3):
                turned = turn[3 * row] * x + turn[3 * row + 1] * y + turn[3 * row + 2] * z
                out[k, i, row] = place[i, body[k], row] + turned


@kernel
def set_poses_and_velocities(
    tree: BodyTree, position: Array1D, velocity: Array1D, bend: Array1D, memory: MotionMemory
) -> None:
    """Places, velocities and accelerations of all bodies, while the base does not accelerate."""
    motion, gained = memory.motion, memory.gained
    to_matrix(position[3:7], motion.rotation[0])
    rotate(position[3:7], velocity[0:3], motion.velocity[0, 0:3])
    rotate(position[3:7], velocity[3:6], motion.velocity[0, 3:6])
    set_body_poses(tree, position[7:], motion)
    move_bodies(tree, velocity[6:], motion)
    for k in range(bend.shape[0]):
        carrier = tree.parent[k]
        for axis in range(6):
            gained[k + 1, axis] = gained[carrier, axis] + motion.joint[k, axis] * bend[k]
            motion.acceleration[k + 1, axis] = (
                motion.acceleration[k + 1, axis] + gained[k + 1, axis]
            )


@kernel
def momentum_terms(
    speed: Array1D, memory: MotionMemory, com: Vector3, com_velocity: Vector3, momentum: Vector3, inertia: Array1D
) -> None:  # fmt: skip
    """Centre of mass, its velocity, angular momentum and inertia about it, seen from the base, at the joints' speeds
    (n_joints,)."""
    motion, composite = memory.motion, memory.composite
    spatial, total = memory.spatial, memory.momentum
    momentum_of(composite, 0, motion.velocity[0], total)
    for k in range(motion.joint.shape[0]):
        momentum_of(composite, k + 1, motion.joint[k], spatial)
        for axis in range(6):
            total[axis] = total[axis] + spatial[axis] * speed[k]
    mass = composite.mass[0]
    for axis in range(3):
        com[axis] = composite.moment[0, axis] / mass
        com_velocity[axis] = total[axis] / mass
    x, y, z = com[0], com[1], com[2]
    u, v, w = total[0], total[1], total[2]
    momentum[0] = total[3] - (y * w - z * v)
    momentum[1] = total[4] - (z * u - x * w)
    momentum[2] = total[5] - (x * v - y * u)
    for axis in range(6):
        inertia[axis] = composite.inertia[0, axis]
    inertia[0] = inertia[0] - mass * (y * y + z * z)
    inertia[1] = inertia[1] - mass * (x * x + z * z)
    inertia[2] = inertia[2] - mass * (x * x + y * y)
    inertia[3] = inertia[3] + mass * x * y
    inertia[4] = inertia[4] + mass * x * z
    inertia[5] = inertia[5] + mass * y * z


@kernel
def point_terms(
    fixed: FixedPoints, position: Array1D, i: int, motion: BodyMotion, out: MotionTerms
) -> None:
    """Places and velocities of the points in the world at instant ``i``."""
    for k in range(fixed.body.shape[0]):
        body, point = fixed.body[k], out.points[i, k]
        point_position(motion, body, fixed.place[k], point)
        point[2] = point[2] - fixed.below[k]
        velocity_at(motion, body, point, out.point_velocity[i, k])
        for axis in range(3):
            out.ahead[i, k, axis] = motion.rotation[body, axis, 0]
            point[axis] = point[axis] + position[axis]


@kernel
def velocities_at_points(
    columns: Array3D,
    moves: Flags2D,
    points: Array3D,
    velocity: Array2D,
    share: Array2D,
    out: Array3D,
) -> None:
    """Compute the velocities of the material at points of bodies at n instants, from the columns of Jacobians.

    Args:
        columns: (n, n_velocities, 6), linear and angular, of the material at the world's origin.
        moves: whether a velocity moves the body of a point, (n_points, n_velocities).
        points: (n, n_points, 3) [m]; ``velocity`` (n, n_velocities).
        share: scratch, (6, n_velocities).
        out: (n, n_points, 6), linear [m/s] and angular [rad/s].
    """
    for i in range(points.shape[0]):
        for point in range(points.shape[1]):
            x, y, z = points[i, point, 0], points[i, point, 1], points[i, point, 2]
            for k in range(velocity.shape[1]):
                for axis in range(6):
                    share[axis, k] = 0.0
                if moves[point, k]:
                    speed, column = velocity[i, k], columns[i, k]
                    p, q, r = column[3], column[4], column[5]
                    share[0, k] = (column[0] - (y * r - z * q)) * speed
                    share[1, k] = (column[1] - (z * p - x * r)) * speed
                    share[2, k] = (column[2] - (x * q - y * p)) * speed
                    share[3, k], share[4, k], share[5, k] = p * speed, q * speed, r * speed
            for axis in range(6):
                out[i, point, axis] = pairwise_sum(share[axis])


@kernel
def solve_inertia(inertia: Array1D, vector: Vector3, out: Vector3) -> None:
    """Solve for the vector (3,) whose product with the inertia (6,) is ``vector`` (3,)."""
    xx, yy, zz = inertia[0], inertia[1], inertia[2]
    xy, xz, yz = inertia[3], inertia[4], inertia[5]
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    scale = 1.0 / (xx * a + xy * b + xz * c)
    x, y, z = vector[0] * scale, vector[1] * scale, vector[2] * scale
    out[0] = a * x + b * y + c * z
    out[1] = b * x + (xx * zz - xz * xz) * y + (xy * xz - xx * yz) * z
    out[2] = c * x + (xy * xz - xx * yz) * y + (xx * yy - xy * xy) * z


@kernel
def base_acceleration(given: GivenMotion, i: int, memory: MotionMemory, out: MotionTerms) -> None:
    """Compute the base's acceleration at instant ``i``; ``memory.spatial`` is the same in the
    world's axes, less gravity. The centre of mass becomes a place in the world."""
    spatial, wrench, com = memory.spatial, memory.wrench, out.com[i]
    need, mass = memory.composite.force[0], memory.composite.mass[0]
    x, y, z = com[0], com[1], com[2]
    for axis in range(3):
        com[axis] = com[axis] + given.position[i, axis]
        wrench[axis] = -need[axis]
    u, v, w = need[0], need[1], need[2]
    wrench[3] = (y * w - z * v) - need[3]
    wrench[4] = (z * u - x * w) - need[4]
    wrench[5] = (x * v - y * u) - need[5]
    for k in range(given.force.shape[1]):
        force = given.force[i, k]
        p, q, r = (
            out.points[i, k, 0] - com[0],
            out.points[i, k, 1] - com[1],
            out.points[i, k, 2] - com[2],
        )
        u, v, w = force[0], force[1], force[2]
        wrench[0], wrench[1], wrench[2] = wrench[0] + u, wrench[1] + v, wrench[2] + w
        wrench[3] = wrench[3] + (q * w - r * v)
        wrench[4] = wrench[4] + (r * u - p * w)
        wrench[5] = wrench[5] + (p * v - q * u)
    solve_inertia(out.inertia[i], wrench[3:6], spatial[3:6])
    u, v, w = spatial[3], spatial[4], spatial[5]
    spatial[0] = wrench[0] / mass - (v * z - w * y)
    spatial[1] = wrench[1] / mass - (w * x - u * z)
    spatial[2] = wrench[2] / mass - (u * y - v * x)
    turn = given.position[i, 3:7]
    spatial[2] = spatial[2] - GRAVITY
    rotate_back(turn, spatial[0:3], out.base[i, 0:3])
    rotate_back(turn, spatial[3:6], out.base[i, 3:6])
    spatial[2] = spatial[2] + GRAVITY


@kernel
def joint_torques(
    tree: BodyTree, fixed: FixedPoints, given: GivenMotion, i: int, memory: MotionMemory, out: MotionTerms
) -> None:  # fmt: skip
    """Compute the torques of the joints at instant ``i``, with the base accelerating as
    ``memory.spatial``."""
    motion, composite, wrench, torque = (
        memory.motion,
        memory.composite,
        memory.wrench,
        out.torque[i],
    )
    for k in range(torque.shape[0]):
        momentum_of(composite, k + 1, memory.spatial, memory.momentum)
        torque[k] = inner(motion.joint[k], composite.force[k + 1]) + inner(
            motion.joint[k], memory.momentum
        )
    for k in range(given.force.shape[1]):
        force, point = given.force[i, k], out.points[i, k]
        x, y, z = (
            point[0] - given.position[i, 0],
            point[1] - given.position[i, 1],
            point[2] - given.position[i, 2],
        )
        u, v, w = force[0], force[1], force[2]
        wrench[0], wrench[1], wrench[2] = u, v, w
        wrench[3], wrench[4], wrench[5] = y * w - z * v, z * u - x * w, x * v - y * u
        body = int(fixed.body[k])
        while body > 0:
            torque[body - 1] = torque[body - 1] - inner(motion.joint[body - 1], wrench)
            body = int(tree.parent[body - 1])
