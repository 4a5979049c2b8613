"""A limb of any number of joints: the chain from the base to a foot, its pose and its Jacobian.

A limb is kept as flat arrays, so that kernels can work on it. All vectors are in the base's frame,
in m and rad. Link frames are parallel to the base's where all joints are at zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import product
from .robot_description import RobotDescription

_COLLINEAR = 1e-6
"""Contact points nearer to one line than this [m] are a line."""


class FootKind(IntEnum):
    """The kind of a foot: what its contact points constrain of its pose on the ground."""

    POINT = 0
    """One contact point: it constrains the position."""
    LINE = 1
    """Two points, or several in a line: they constrain position and direction of the line."""
    FLAT = 2
    """Three or more points not in a line: they constrain position and orientation."""


@dataclass(frozen=True, eq=False)
class Limb:
    """The chain of joints from the base to a foot.

    Attributes:
        joints: the indices of the chain's n joints among the robot's, from the base outwards.
        links: one row a joint, (n, 7): its origin in the frame of the link before it, its axis,
            and 1 for a slide, 0 for a hinge.
        tip: the foot, (7,): its sole centre and the direction of its line in the last link's
            frame, and the ``FootKind``.
        limits: lower and upper limits of the joints [rad or m], (n, 2).
    """

    joints: tuple[int, ...]
    links: Array
    tip: Array
    limits: Array

    @property
    def kind(self) -> FootKind:
        """The kind of the foot."""
        return FootKind(int(self.tip[6]))


def chain_to(robot: RobotDescription, link: str) -> tuple[int, ...]:
    """The indices of the joints that carry ``link``, from the base outwards.

    Raises:
        ValueError: no joint carries one of the links on the way.
    """
    chain: list[int] = []
    while link != robot.base:
        index = next((i for i, joint in enumerate(robot.joints) if joint.child == link), None)
        if index is None or index in chain:
            raise ValueError(f"{robot.name}: no joint leads from {robot.base!r} to {link!r}")
        chain.insert(0, index)
        link = robot.joints[index].parent
    return tuple(chain)


def foot_shape(robot: RobotDescription, foot: int) -> tuple[FootKind, Array]:
    """The kind of a foot and the direction of its line, (3,), in its link's frame.

    The line of a foot with several contact points goes through the two that are farthest apart,
    towards the one that is ahead (or to the left, for a line that lies across). That of a point
    foot is x.
    """
    name = robot.feet[foot].name
    points = np.array([c.position for c in robot.contacts if c.foot == name]).reshape(-1, 3)
    ahead = np.array([1.0, 0.0, 0.0])
    if len(points) < 2:
        return FootKind.POINT, ahead
    differences = points[:, None, :] - points[None, :, :]
    lengths = np.sqrt((differences**2).sum(axis=2))
    first, second = np.unravel_index(int(lengths.argmax()), lengths.shape)
    if lengths[first, second] < _COLLINEAR:
        return FootKind.POINT, ahead
    line: Array = differences[first, second] / lengths[first, second]
    if line[0] < -1e-9 or (abs(line[0]) <= 1e-9 and line[1] < 0.0):
        line = -line
    offsets = points - points[first]
    aside = offsets - np.outer(product(offsets, line), line)
    if np.sqrt((aside**2).sum(axis=1)).max() < _COLLINEAR:
        return FootKind.LINE, line + 0.0
    return FootKind.FLAT, ahead


def read_limb(robot: RobotDescription, foot: int, margin: float = 0.0) -> Limb:
    """The limb that ends in foot number ``foot``.

    ``margin`` is kept from both limits of every joint. A joint that the description holds has its
    held angle for both limits.

    Raises:
        ValueError: no chain of joints leads from the base to the foot.
    """
    chain = chain_to(robot, robot.feet[foot].link)
    joints = [robot.joints[i] for i in chain]
    links = np.array([[*j.origin, *j.axis, float(j.kind == "slide")] for j in joints])
    limits = robot.joint_limits[list(chain)].reshape(-1, 2).copy()
    room = np.minimum(margin, 0.5 * (limits[:, 1] - limits[:, 0]))
    limits[:, 0] += room
    limits[:, 1] -= room
    for row, joint in enumerate(joints):
        if joint.name in robot.held:
            limits[row] = robot.held[joint.name]
    kind, line = foot_shape(robot, foot)
    tip = np.array([*robot.feet[foot].sole, *line, float(kind)])
    return Limb(chain, links.reshape(-1, 7), tip, limits)


@kernel
def place_limb(links: Array, tip: Array, angles: Array, anchors: Array, pose: Array) -> None:
    """Compute the pose of the foot and of the joints from the joint angles.

    Args:
        links, tip: of the ``Limb``.
        angles: of the joints [rad or m], (n,).
        anchors: out, the place and the axis of every joint, (n, 6).
        pose: out, the sole centre and then the rows of the foot's rotation matrix, (4, 3).
    """
    px, py, pz = 0.0, 0.0, 0.0
    xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    for j in range(links.shape[0]):
        ox, oy, oz = float(links[j, 0]), float(links[j, 1]), float(links[j, 2])
        ax, ay, az = float(links[j, 3]), float(links[j, 4]), float(links[j, 5])
        angle = float(angles[j])
        px += xx * ox + xy * oy + xz * oz
        py += yx * ox + yy * oy + yz * oz
        pz += zx * ox + zy * oy + zz * oz
        bx = xx * ax + xy * ay + xz * az
        by = yx * ax + yy * ay + yz * az
        bz = zx * ax + zy * ay + zz * az
        anchors[j, 0], anchors[j, 1], anchors[j, 2] = px, py, pz
        anchors[j, 3], anchors[j, 4], anchors[j, 5] = bx, by, bz
        if float(links[j, 6]) > 0.5:
            px += angle * bx
            py += angle * by
            pz += angle * bz
        else:
            # Every row r becomes c r + s (r x axis) + (1 - c) (r . axis) axis (Rodrigues).
            c, s = math.cos(angle), math.sin(angle)
            d = 1.0 - c
            xx, xy, xz = (
                c * xx + s * (xy * az - xz * ay) + d * bx * ax,
                c * xy + s * (xz * ax - xx * az) + d * bx * ay,
                c * xz + s * (xx * ay - xy * ax) + d * bx * az,
            )
            yx, yy, yz = (
                c * yx + s * (yy * az - yz * ay) + d * by * ax,
                c * yy + s * (yz * ax - yx * az) + d * by * ay,
                c * yz + s * (yx * ay - yy * ax) + d * by * az,
            )
            zx, zy, zz = (
                c * zx + s * (zy * az - zz * ay) + d * bz * ax,
                c * zy + s * (zz * ax - zx * az) + d * bz * ay,
                c * zz + s * (zx * ay - zy * ax) + d * bz * az,
            )
    sx, sy, sz = float(tip[0]), float(tip[1]), float(tip[2])
    pose[0, 0] = px + xx * sx + xy * sy + xz * sz
    pose[0, 1] = py + yx * sx + yy * sy + yz * sz
    pose[0, 2] = pz + zx * sx + zy * sy + zz * sz
    pose[1, 0], pose[1, 1], pose[1, 2] = xx, xy, xz
    pose[2, 0], pose[2, 1], pose[2, 2] = yx, yy, yz
    pose[3, 0], pose[3, 1], pose[3, 2] = zx, zy, zz


@kernel
def limb_jacobian(links: Array, anchors: Array, pose: Array, out: Array) -> None:
    """The sole's linear (rows 0-2) and angular (rows 3-5) velocity per joint velocity, (6, n).

    Args:
        links: of the ``Limb``.
        anchors, pose: from ``place_limb``.
    """
    px, py, pz = float(pose[0, 0]), float(pose[0, 1]), float(pose[0, 2])
    for j in range(links.shape[0]):
        ax, ay, az = float(anchors[j, 3]), float(anchors[j, 4]), float(anchors[j, 5])
        if float(links[j, 6]) > 0.5:
            out[0, j], out[1, j], out[2, j] = ax, ay, az
            out[3, j] = out[4, j] = out[5, j] = 0.0
        else:
            x, y, z = (
                px - float(anchors[j, 0]),
                py - float(anchors[j, 1]),
                pz - float(anchors[j, 2]),
            )
            out[0, j] = ay * z - az * y
            out[1, j] = az * x - ax * z
            out[2, j] = ax * y - ay * x
            out[3, j], out[4, j], out[5, j] = ax, ay, az
