"""A limb of any number of joints: the chain from the base to a foot, its pose, its Jacobian and its error.

A limb is kept as flat arrays, so that kernels can work on it. All vectors are in the base's frame,
in m and rad. Link frames are parallel to the base's where all joints are at zero.

How much of a target's orientation counts follows from the kind of the foot: nothing for a point
foot, the direction of its line for a line foot, all of it for a flat one. A pose is an array
(4, 3): a place, and then the rows of a rotation matrix. The kernels allocate nothing and return finite
numbers for all finite arguments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..mathematics.arrays import Array, Array1D, Array2D, Indices2D, Matrix3, Rows3, Vector3
from ..mathematics.elementary import atan2, sincos
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import product
from ..mathematics.rotations import unit
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
    """Return the indices of the joints that carry ``link``, from the base outwards.

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


def leg_joints(robot: RobotDescription) -> Indices2D:
    """Return the joints of each foot's leg from the base outwards, (n_feet, joints of the longest leg); -1 where a leg
    has fewer.

    Raises:
        ValueError: no joint carries one of the links on the way.
    """
    chains = [chain_to(robot, foot.link) for foot in robot.feet]
    found = np.full((len(chains), max(map(len, chains), default=0)), -1, dtype=np.int64)
    for row, chain in zip(found, chains, strict=True):
        row[: len(chain)] = chain
    return found


def foot_shape(robot: RobotDescription, foot: int) -> tuple[FootKind, Array]:
    """Return the kind of a foot and the direction of its line, (3,), in its link's frame.

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
    """Return the limb that ends in foot number ``foot``.

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
def set_limb_pose(
    links: Array2D, tip: Array1D, angles: Array1D, anchors: Array2D, pose: Array2D
) -> None:
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
        ox, oy, oz = links[j, 0], links[j, 1], links[j, 2]
        ax, ay, az = links[j, 3], links[j, 4], links[j, 5]
        angle = angles[j]
        px += xx * ox + xy * oy + xz * oz
        py += yx * ox + yy * oy + yz * oz
        pz += zx * ox + zy * oy + zz * oz
        bx = xx * ax + xy * ay + xz * az
        by = yx * ax + yy * ay + yz * az
        bz = zx * ax + zy * ay + zz * az
        anchors[j, 0], anchors[j, 1], anchors[j, 2] = px, py, pz
        anchors[j, 3], anchors[j, 4], anchors[j, 5] = bx, by, bz
        if links[j, 6] > 0.5:
            px += angle * bx
            py += angle * by
            pz += angle * bz
        else:
            # Every row r becomes c r + s (r x axis) + (1 - c) (r . axis) axis (Rodrigues).
            s, c = sincos(angle)
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
    sx, sy, sz = tip[0], tip[1], tip[2]
    pose[0, 0] = px + xx * sx + xy * sy + xz * sz
    pose[0, 1] = py + yx * sx + yy * sy + yz * sz
    pose[0, 2] = pz + zx * sx + zy * sy + zz * sz
    pose[1, 0], pose[1, 1], pose[1, 2] = xx, xy, xz
    pose[2, 0], pose[2, 1], pose[2, 2] = yx, yy, yz
    pose[3, 0], pose[3, 1], pose[3, 2] = zx, zy, zz


@kernel
def limb_jacobian(links: Array2D, anchors: Array2D, pose: Array2D, out: Array2D) -> None:
    """Compute the sole's linear (rows 0-2) and angular (rows 3-5) velocity per joint velocity, (6, n).

    Args:
        links: of the ``Limb``.
        anchors, pose: from ``set_limb_pose``.
    """
    px, py, pz = pose[0, 0], pose[0, 1], pose[0, 2]
    for j in range(links.shape[0]):
        ax, ay, az = anchors[j, 3], anchors[j, 4], anchors[j, 5]
        if links[j, 6] > 0.5:
            out[0, j], out[1, j], out[2, j] = ax, ay, az
            out[3, j] = out[4, j] = out[5, j] = 0.0
        else:
            x, y, z = (
                px - anchors[j, 0],
                py - anchors[j, 1],
                pz - anchors[j, 2],
            )
            out[0, j] = ay * z - az * y
            out[1, j] = az * x - ax * z
            out[2, j] = ax * y - ay * x
            out[3, j], out[4, j], out[5, j] = ax, ay, az


_FAR = 10.0
"""Targets are limited to this distance [m], so that no square overflows."""


@kernel
def aim(position: Vector3, rotation: Matrix3, target: Rows3) -> None:
    """Make a target of any finite numbers: within 10 m, and with a true rotation matrix.

    Args:
        position: of the sole centre (3,).
        rotation: from foot to base (3, 3); its first and then its second axis are kept.
        target: out, the place and then the rows of the rotation matrix, (4, 3).
    """
    target[0, :] = min(max(position, -_FAR), _FAR)  # type: ignore[assignment]  # of each element
    x0, x1, x2 = unit(rotation[0, 0], rotation[1, 0], rotation[2, 0], 1.0, 0.0, 0.0)
    y0, y1, y2 = unit(rotation[0, 1], rotation[1, 1], rotation[2, 1], 0.0, 1.0, 0.0)
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
def foot_error(tip: Array1D, pose: Rows3, target: Rows3, weights: Array1D, error: Array1D) -> float:
    """Return the weighted error of a foot's pose, and its square [m^2].

    Args:
        tip: of the ``Limb``.
        pose, target: a place and the rows of a rotation matrix, (4, 3).
        weights: of the place in the plane of the target's sole, of the place along its normal,
            and how many metres a turn of 1 rad counts as, (3,).
        error: out, (6,); the last three are zero for a point foot.
    """
    plane, normal, length = weights[0], weights[1], weights[2]
    ex = target[0, 0] - pose[0, 0]
    ey = target[0, 1] - pose[0, 1]
    ez = target[0, 2] - pose[0, 2]
    nx, ny, nz = target[1, 2], target[2, 2], target[3, 2]
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
        tx = 0.5 * (target[3] @ pose[2] - target[2] @ pose[3])
        ty = 0.5 * (target[1] @ pose[3] - target[3] @ pose[1])
        tz = 0.5 * (target[2] @ pose[1] - target[1] @ pose[2])
        a, b, c = (
            target[1] @ pose[1],
            target[2] @ pose[2],
            target[3] @ pose[3],
        )
        sine, cosine = math.sqrt(tx * tx + ty * ty + tz * tz), 0.5 * (a + b + c - 1.0)
        if sine < 1e-7 and cosine < 0.0:
            # Half a turn: its axis is that of the largest element of the diagonal.
            k = 1 if a >= b and a >= c else (2 if b >= c else 3)
            tx = 0.5 * (target[1] @ pose[k] + target[k] @ pose[1])
            ty = 0.5 * (target[2] @ pose[k] + target[k] @ pose[2])
            tz = 0.5 * (target[3] @ pose[k] + target[k] @ pose[3])
            if k == 1:
                tx += 1.0
            elif k == 2:
                ty += 1.0
            else:
                tz += 1.0
            tx, ty, tz = unit(tx, ty, tz, 1.0, 0.0, 0.0)
            sine = 1.0
            cosine = -1e9
    scale = length if sine < 1e-7 else length * atan2(sine, cosine) / sine
    tx, ty, tz = scale * tx, scale * ty, scale * tz
    error[0], error[1], error[2], error[3], error[4], error[5] = ex, ey, ez, tx, ty, tz
    return float(ex * ex + ey * ey + ez * ez + tx * tx + ty * ty + tz * tz)


@kernel
def weigh_rows(tip: Array1D, pose: Rows3, target: Rows3, weights: Array1D, rows: Array2D) -> None:
    """Make of the foot's Jacobian (6, n) the negative derivative of ``foot_error``, in place."""
    plane, normal, length = weights[0], weights[1], weights[2]
    n = rows.shape[1]
    if plane != normal or plane != 1.0:
        nx, ny, nz = target[1, 2], target[2, 2], target[3, 2]
        for j in range(n):
            x, y, z = rows[0, j], rows[1, j], rows[2, j]
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
        x, y, z = rows[3, j], rows[4, j], rows[5, j]
        along = lx * x + ly * y + lz * z
        rows[3, j] = length * (x - along * lx)
        rows[4, j] = length * (y - along * ly)
        rows[5, j] = length * (z - along * lz)


@kernel
def turning(
    tip: Array1D, last: Rows3, target: Rows3, period: float, limit: float, out: Array1D
) -> None:
    """Compute the angular velocity (3,) [rad/s] of a target, from its orientation one period before.

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
        ax = 0.5 * (target[3] @ last[2] - target[2] @ last[3])
        ay = 0.5 * (target[1] @ last[3] - target[3] @ last[1])
        az = 0.5 * (target[2] @ last[1] - target[1] @ last[2])
        trace = target[1] @ last[1] + target[2] @ last[2]
        cosine = 0.5 * (trace + target[3] @ last[3] - 1.0)
    sine = math.sqrt(ax * ax + ay * ay + az * az)
    angle = atan2(sine, cosine)
    scale = 0.0
    if angle <= limit:
        scale = 1.0 / period if sine < 1e-7 else angle / (sine * period)
    out[0], out[1], out[2] = scale * ax, scale * ay, scale * az


@kernel
def _along(pose: Rows3, tip: Array1D) -> tuple[float, float, float]:
    """Return the direction of a foot's line in the base's frame."""
    line = tip[3:6]
    return pose[1] @ line, pose[2] @ line, pose[3] @ line
