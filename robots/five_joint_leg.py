"""The closed form of a leg of five joints: hip yaw, pitch and roll, knee and ankle, line foot.

The three hip axes meet in the hip centre; knee and ankle turn about the axis the hip roll leaves
horizontal, so thigh, calf and sole lie in one plane, the leg plane. With five joints a foot can
reach a sole position and a direction of its line from heel to toe; its roll about that line
follows. Canonical angles are yaw about +z, pitch about -y (thigh forward), roll about +x, knee and
ankle about -y; a robot whose axes point the other way has a sign of -1 there.

Inside the leg plane a vector is (x, z) of the thigh's frame at zero pose, and a positive knee or
ankle angle turns it from x to z. Everything is in the base's frame, in m and rad. The functions
are pure, allocate nothing and return finite numbers for all finite arguments.

A target beyond reach is moved into reach in the plane of its sole, and a leg that stretches is slowed down.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..mathematics.arrays import Array1D, Array2D, Indices1D, Matrix3, Vector3
from ..mathematics.elementary import acos, atan2, cos, exp, sin, sincos
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import multiply_matrices, solve_damped
from ..mathematics.rotations import unit, wrap
from .limb import FootKind, chain_to, foot_shape
from .robot_description import RobotDescription

_AXES = ("yaw", 2), ("pitch", 1), ("roll", 0), ("knee", 1), ("ankle", 1)
_CANONICAL = np.array([1.0, -1.0, 1.0, -1.0, -1.0])
_FAR = 10.0
"""Targets are limited to this distance [m]: no square overflows."""
_SLANT = 1e-3
"""Sine of the angle between the foot's line and the line from hip to sole below which the leg plane is undefined and
blends into the upright one.
"""
LEVEL = 1e-3
"""The least ``level`` of ``inverse``: nearer to gimbal lock the exact yaw would be noise."""


class Leg(NamedTuple):
    """The geometry of one leg.

    Attributes:
        joints: the indices of yaw, pitch, roll, knee and ankle among the robot's joints, (5,).
        hip: the hip centre [m, base frame], (3,).
        plane: hip to knee, knee to ankle, ankle to sole centre [m], rows of (x, z).
        signs: the robot's angle = sign times the canonical one, (5,).
        limits: lower and upper limits of the robot's angles [rad], (5, 2).
    """

    joints: Indices1D
    hip: Vector3
    plane: Array2D
    signs: Array1D
    limits: Array2D


def read_leg(robot: RobotDescription, foot: int) -> Leg:
    """Return the leg that ends in foot number ``foot``.

    Raises:
        ValueError: the chain from base to foot is not a leg of the kind described above.
    """
    chain = chain_to(robot, robot.feet[foot].link)
    mismatch = _mismatch(robot, foot, chain)
    if mismatch:
        raise ValueError(
            f"foot {robot.feet[foot].name}: {mismatch}; this inverse kinematics is for legs of hip "
            "yaw (z), pitch (y) and roll (x) with intersecting axes, then knee (y) and ankle (y) in "
            "one plane, that end in a line foot"
        )
    joints = [robot.joints[i] for i in chain]
    offsets = np.array([joints[3].origin, joints[4].origin, robot.feet[foot].sole])
    signs = [joint.axis[k] * c for joint, (_, k), c in zip(joints, _AXES, _CANONICAL, strict=True)]
    return Leg(
        joints=np.array(chain),
        hip=np.array(joints[0].origin),
        plane=np.ascontiguousarray(offsets[:, ::2]),
        signs=np.array(signs),
        limits=robot.joint_limits[list(chain)].copy(),
    )


def find_leg(robot: RobotDescription, foot: int) -> Leg | None:
    """Return the leg that ends in foot number ``foot``, or ``None`` where it is of another kind."""
    if _mismatch(robot, foot, chain_to(robot, robot.feet[foot].link)):
        return None
    return read_leg(robot, foot)


def _mismatch(robot: RobotDescription, foot: int, chain: tuple[int, ...]) -> str:
    """Return the reason why a chain of joints is no leg of this kind; empty if it is one."""
    joints = [robot.joints[i] for i in chain]
    if len(joints) != len(_AXES):
        return f"expected 5 joints from {robot.base}, found {len(joints)}"
    for joint, (kind, axis) in zip(joints, _AXES, strict=True):
        if joint.kind != "hinge" or abs(abs(joint.axis[axis]) - 1.0) > 1e-9:
            return f"joint {joint.name} should turn about {'xyz'[axis]} ({kind})"
        if joint.limits is None:
            return f"joint {joint.name} has no limits"
        if joint.name in robot.held:
            return f"joint {joint.name} is held"
    if any(joint.origin != (0.0, 0.0, 0.0) for joint in joints[1:3]):
        return "the hip axes do not meet in one point"
    if any(
        place[1] != 0.0 for place in (joints[3].origin, joints[4].origin, robot.feet[foot].sole)
    ):
        return "knee, ankle or sole lies beside the leg plane"
    shape, line = foot_shape(robot, foot)
    if shape != FootKind.LINE or abs(float(line[0]) - 1.0) > 1e-9:
        return "its contact points are not in a line along x"
    return ""


@kernel
def forward(leg: Leg, angles: Array1D, position: Vector3, rotation: Matrix3) -> None:
    """Compute the sole centre (3,) and the foot's rotation (3, 3) to the base from the joint angles."""
    hip, plane = leg.hip, leg.plane
    a, b, c, k, n = _canonical(leg.signs, angles)
    _thigh_rotation(a, b, c, rotation)
    (sin_k, cos_k), (sin_f, cos_f) = sincos(k), sincos(k + n)
    calf_x, calf_z = plane[1, 0], plane[1, 1]
    sole_x, sole_z = plane[2, 0], plane[2, 1]
    x = plane[0, 0] + calf_x * cos_k - calf_z * sin_k + sole_x * cos_f - sole_z * sin_f
    z = plane[0, 1] + calf_x * sin_k + calf_z * cos_k + sole_x * sin_f + sole_z * cos_f
    for i in range(3):
        thigh_x, thigh_z = rotation[i, 0], rotation[i, 2]
        position[i] = hip[i] + x * thigh_x + z * thigh_z
        rotation[i, 0] = cos_f * thigh_x + sin_f * thigh_z
        rotation[i, 2] = cos_f * thigh_z - sin_f * thigh_x


@kernel
def jacobian(plane: Array2D, signs: Array1D, angles: Array1D, out: Array2D) -> None:
    """Compute the sole's linear (rows 0-2) and angular (rows 3-5) velocity per joint velocity, (6, 5)."""
    a, b, c, k, n = _canonical(signs, angles)
    (sin_a, cos_a), (sin_b, cos_b) = sincos(a), sincos(b)
    sin_c, cos_c = sincos(c)
    (sin_k, cos_k), (sin_f, cos_f) = sincos(k), sincos(k + n)
    calf_x, calf_z = plane[1, 0], plane[1, 1]
    sole_x, sole_z = plane[2, 0], plane[2, 1]
    # From the ankle, from the knee and from the hip to the sole, in the leg plane.
    ankle_x, ankle_z = sole_x * cos_f - sole_z * sin_f, sole_x * sin_f + sole_z * cos_f
    knee_x = ankle_x + calf_x * cos_k - calf_z * sin_k
    knee_z = ankle_z + calf_x * sin_k + calf_z * cos_k
    x, z = knee_x + plane[0, 0], knee_z + plane[0, 1]
    # The thigh's x, y and z axes in the base's frame.
    xx, xy, xz = cos_a * cos_b, sin_a * cos_b, sin_b
    yx = -sin_a * cos_c - cos_a * sin_b * sin_c
    yy = cos_a * cos_c - sin_a * sin_b * sin_c
    yz = cos_b * sin_c
    zx = sin_a * sin_c - cos_a * sin_b * cos_c
    zy = -cos_a * sin_c - sin_a * sin_b * cos_c
    zz = cos_b * cos_c
    px, py, pz = x * xx + z * zx, x * xy + z * zy, x * xz + z * zz
    # Each column: axis cross lever, then the axis.
    out[0, 0], out[1, 0], out[2, 0] = -py, px, 0.0
    out[3, 0], out[4, 0], out[5, 0] = 0.0, 0.0, 1.0
    out[0, 1], out[1, 1], out[2, 1] = -cos_a * pz, -sin_a * pz, sin_a * py + cos_a * px
    out[3, 1], out[4, 1], out[5, 1] = sin_a, -cos_a, 0.0
    out[0, 2], out[1, 2], out[2, 2] = xy * pz - xz * py, xz * px - xx * pz, xx * py - xy * px
    out[3, 2], out[4, 2], out[5, 2] = xx, xy, xz
    out[0, 3], out[1, 3] = knee_x * zx - knee_z * xx, knee_x * zy - knee_z * xy
    out[2, 3] = knee_x * zz - knee_z * xz
    out[0, 4], out[1, 4] = ankle_x * zx - ankle_z * xx, ankle_x * zy - ankle_z * xy
    out[2, 4] = ankle_x * zz - ankle_z * xz
    out[3, 3], out[4, 3], out[5, 3] = -yx, -yy, -yz
    out[3, 4], out[4, 4], out[5, 4] = -yx, -yy, -yz
    for j in range(5):
        sign = signs[j]
        for i in range(6):
            out[i, j] *= sign


@kernel
def inverse(
    leg: Leg,
    sole: Array1D,
    line: Array1D,
    softness: float,
    kept_yaw: float,
    level: float,
    out: Array1D,
) -> tuple[bool, float]:
    """Return the joint angles (5,) that bring the sole centre to ``sole`` and its line along ``line``.

    The leg plane contains the hip, the sole and the line; in it the knee follows from the law of
    cosines and the ankle from the line's slope. For a target out of reach errors are allowed in
    this order: of the line's slope (the ankle stays at its limit, the sole is still exact), then of
    the distance from the hip (of the ankle, or of the sole; its direction is still exact), then
    those that the hip's limits cause. The knee of a leg that stretches at a steady speed becomes
    ever faster; therefore, within ``softness`` of the full length d, the distance approaches d as
    d - softness exp(-(x - d + softness) / softness).

    Where the thigh is level, hip yaw and roll turn about one axis (gimbal lock): a foot that is a
    few millimetres beside its planned place would ask for any yaw, and for the opposite one as soon
    as the thigh is past that pose. Therefore, where the cosine of the hip's pitch is less than
    ``level``, the yaw goes over to ``kept_yaw`` and the roll takes up the rest. The thigh then points
    past its place by at most ``level`` times the yaw that is left out.

    Args:
        leg: its limits with any margin already taken off.
        sole: where the sole centre should be [m, base frame].
        line: the direction from heel to toe [base frame], of any length.
        softness: see above [m]; zero for none.
        kept_yaw: the robot's hip yaw that is kept in gimbal lock [rad].
        level: see above; at least 1e-3, with which the answer is exact to 1e-3 of gimbal lock.
        out: the robot's angles [rad].

    Returns:
        Whether the target is met without touching a limit, and how much the foot moves away from
        the hip per movement of the target: one, or less where the leg is stretched.
    """
    hip, plane, signs, limits = leg.hip, leg.plane, leg.signs, leg.limits
    px = min(max(sole[0] - hip[0], -_FAR), _FAR)
    py = min(max(sole[1] - hip[1], -_FAR), _FAR)
    pz = min(max(sole[2] - hip[2], -_FAR), _FAR)
    fx, fy, fz = unit(line[0], line[1], line[2], 1.0, 0.0, 0.0)
    # The plane's normal, which becomes the thigh's y axis.
    nx, ny, nz = fy * pz - fz * py, fz * px - fx * pz, fx * py - fy * px
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    slant = _SLANT * math.sqrt(px * px + py * py + pz * pz)
    exact = size >= slant and size > 0.0
    if not exact:
        fill = slant - size if size > 0.0 else 1.0
        nx, ny, nz = nx - fill * fy * fx, ny + fill * (1.0 - fy * fy), nz - fill * fy * fz
    nx, ny, nz = unit(nx, ny, nz, 0.0, 1.0, 0.0)
    # The line's direction and this one, at right angles to it, span the plane.
    ux, uy, uz = fy * nz - fz * ny, fz * nx - fx * nz, fx * ny - fy * nx
    x, z = px * fx + py * fy + pz * fz, px * ux + py * uy + pz * uz

    # In the plane, with the ankle as the target: knee, thigh, then the ankle's own angle.
    knee, thigh, share, near = _two_links(
        plane[0, 0], plane[0, 1], plane[1, 0], plane[1, 1],
        x - plane[2, 0], z - plane[2, 1], signs[3],
        limits[3, 0], limits[3, 1], softness,
    )  # fmt: skip
    ankle = wrap(-thigh - knee)
    sign = signs[4]
    held = min(max(ankle * sign, limits[4, 0]), limits[4, 1]) * sign
    if held != ankle:
        # The ankle keeps its angle, calf and foot become one link, the sole is the target.
        ankle, exact = held, False
        sin_n, cos_n = sincos(ankle)
        sole_x, sole_z = plane[2, 0], plane[2, 1]
        knee, thigh, share, near = _two_links(
            plane[0, 0], plane[0, 1],
            plane[1, 0] + cos_n * sole_x - sin_n * sole_z,
            plane[1, 1] + sin_n * sole_x + cos_n * sole_z,
            x, z, signs[3], limits[3, 0], limits[3, 1], softness,
        )  # fmt: skip
    sin_t, cos_t = sincos(thigh)
    xx, xy, xz = cos_t * fx + sin_t * ux, cos_t * fy + sin_t * uy, cos_t * fz + sin_t * uz
    zx, zy = cos_t * ux - sin_t * fx, cos_t * uy - sin_t * fy

    # The thigh's axes are yaw, then pitch, then roll. Of the two answers for yaw the one with the
    # roll below a right angle; in gimbal lock the kept yaw, and roll takes up the rest.
    flat = math.sqrt(xx * xx + xy * xy)
    yaw = atan2(xy, xx)
    if ny * cos(yaw) - nx * sin(yaw) < 0.0:
        yaw = wrap(yaw + math.pi)
    share_of_yaw = yaw_share(flat, level)
    if share_of_yaw < 1.0:
        kept = wrap(kept_yaw * signs[0])
        yaw = kept + share_of_yaw * wrap(yaw - kept)
    sin_y, cos_y = sincos(yaw)
    out[0] = yaw
    out[1] = atan2(xz, cos_y * xx + sin_y * xy)
    out[2] = atan2(sin_y * zx - cos_y * zy, cos_y * ny - sin_y * nx)
    out[3] = knee
    out[4] = ankle
    inside = exact and near
    for i in range(5):
        angle = out[i] * signs[i]
        lower, upper = limits[i, 0], limits[i, 1]
        inside = inside and lower <= angle <= upper
        out[i] = min(max(angle, lower), upper)
    return inside, share


@kernel
def yaw_share(flat: float, level: float) -> float:
    """Return the share of the hip's exact yaw that counts where ``flat`` is the cosine of its pitch: all of it from
    ``level`` on, nothing in gimbal lock, and between them 3 s^2 - 2 s^3 with s = flat / level.
    """
    part = min(abs(flat) / max(level, LEVEL), 1.0)
    return part * part * (3.0 - 2.0 * part)


@kernel
def _canonical(signs: Array1D, angles: Array1D) -> tuple[float, float, float, float, float]:
    return (
        signs[0] * angles[0], signs[1] * angles[1], signs[2] * angles[2], signs[3] * angles[3],
        signs[4] * angles[4],
    )  # fmt: skip


@kernel
def _thigh_rotation(a: float, b: float, c: float, out: Array2D) -> None:
    """Compute the rotation by yaw ``a`` about z, then pitch ``b`` about -y, then roll ``c`` about x."""
    (sin_a, cos_a), (sin_b, cos_b) = sincos(a), sincos(b)
    sin_c, cos_c = sincos(c)
    out[0, 0], out[1, 0], out[2, 0] = cos_a * cos_b, sin_a * cos_b, sin_b
    out[0, 1] = -sin_a * cos_c - cos_a * sin_b * sin_c
    out[1, 1] = cos_a * cos_c - sin_a * sin_b * sin_c
    out[2, 1] = cos_b * sin_c
    out[0, 2] = sin_a * sin_c - cos_a * sin_b * cos_c
    out[1, 2] = -cos_a * sin_c - sin_a * sin_b * cos_c
    out[2, 2] = cos_b * cos_c


@kernel
def _two_links(
    first_x: float,
    first_z: float,
    second_x: float,
    second_z: float,
    x: float,
    z: float,
    sign: float,
    lower: float,
    upper: float,
    softness: float,
) -> tuple[float, float, float, bool]:
    """Return the knee's and the first link's angle that bring the end of two links to (x, z).

    Of the two solutions it is the one on the side of the middle of the robot's limits. Also returns
    how far the distance follows the target's (1, or less near full stretch), and whether the target
    is met.
    """
    first = math.sqrt(first_x * first_x + first_z * first_z)
    second = math.sqrt(second_x * second_x + second_z * second_z)
    straight = wrap(atan2(first_z, first_x) - atan2(second_z, second_x))
    straightest = min(max(straight * sign, lower), upper) * sign
    bent = cos(straightest - straight)
    farthest = math.sqrt(first * first + second * second + 2.0 * first * second * bent)
    distance, share = math.sqrt(x * x + z * z), 1.0
    if softness > 0.0 and distance > farthest - softness:
        share = exp((farthest - softness - distance) / softness)
        distance = farthest - softness * share
    elif distance > farthest:
        distance, share = farthest, 0.0
    cosine = (distance * distance - first * first - second * second) / (2.0 * first * second)
    bend = acos(min(max(cosine, -1.0), 1.0))
    knee = straight + bend if 0.5 * (lower + upper) * sign > straight else straight - bend
    held = min(max(knee * sign, lower), upper) * sign
    near = share == 1.0 and abs(held - knee) < 1e-9 and cosine <= 1.0
    sin_k, cos_k = sincos(held)
    end_x = first_x + cos_k * second_x - sin_k * second_z
    end_z = first_z + sin_k * second_x + cos_k * second_z
    return held, atan2(z, x) - atan2(end_z, end_x), share, near


_LEVEL = 0.3
"""A sole whose normal has less than this along the base's z axis does not slide."""
_HALVINGS = 8
"""The number of bisections: the place in reach is found to within a 256th of the way."""
_FARTHEST = 10.0
"""Places are limited to this distance [m] before they slide."""
_JUMP = 0.1
"""A line that rotates by more than this [rad] in a tick is a new target, not a motion."""


@kernel
def pitched_line(rotation: Matrix3, pitch: float, out: Vector3) -> None:
    """Compute the x axis of ``rotation`` (3, 3), turned by ``pitch`` [rad] about its y axis."""
    sine, cosine = sincos(pitch)
    out[:] = cosine * rotation[:, 0] - sine * rotation[:, 2]


@kernel
def slide(
    leg: Leg,
    sole: Array1D,
    rotation: Array2D,
    softness: float,
    kept_yaw: float,
    level: float,
    place: Array1D,
    angles: Array1D,
) -> tuple[bool, float]:
    """Move a ``sole`` out of reach, in its own plane, towards a place that is in reach.

    That place is the foot of the perpendicular from the hip to the plane of the sole, or if even
    this is out of reach the plane's point on the base's z axis through the hip, where every angle
    of the hip is small. The place in reach that is nearest to the target on the line between both
    is found by bisection, to within a 256th of their distance. Where a flat sole is out of reach at the end of
    that line, because the ankle would pass its limit, a sole that is not flat counts as in reach.

    Args:
        leg, softness, kept_yaw, level: as for ``inverse``.
        sole, rotation: the target's place and axes, of which the third is normal to the sole.
        place: scratch (3,).
        angles: out, the joint angles (5,) for that place; as they were where there is none.

    Returns:
        Whether there is such a place, and the second result of ``inverse`` for it.
    """
    nx, ny, nz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    if nz < _LEVEL or not abs(nx * nx + ny * ny + nz * nz - 1.0) < 0.1:
        return False, 1.0
    hx, hy, hz = leg.hip[0], leg.hip[1], leg.hip[2]
    sx = min(max(sole[0], -_FARTHEST), _FARTHEST)
    sy = min(max(sole[1], -_FARTHEST), _FARTHEST)
    sz = min(max(sole[2], -_FARTHEST), _FARTHEST)
    depth = nx * (hx - sx) + ny * (hy - sy) + nz * (hz - sz)
    line = rotation[:, 0]
    for attempt in range(4):
        ax, ay, az = hx - depth * nx, hy - depth * ny, hz - depth * nz
        if attempt > 1:
            ax, ay, az = hx, hy, hz - depth / nz
        near, far, share = 0.0, 1.0, 1.0
        for step in range(_HALVINGS + 2):
            # First the end of the way, whether it is in reach; halves of it; the answer again.
            last = step == _HALVINGS + 1
            part = near if step == 0 or last else 0.5 * (near + far)
            place[0] = ax + part * (sx - ax)
            place[1] = ay + part * (sy - ay)
            place[2] = az + part * (sz - az)
            inside, kept = inverse(leg, place, line, softness, kept_yaw, level, angles)
            if inside or (attempt % 2 == 1 and kept == 1.0 and within_limits(leg, angles)):
                near, share = part, kept
            elif step == 0:
                break
            else:
                far = part
            if last:
                return True, share
    inverse(leg, sole, line, softness, kept_yaw, level, angles)
    return False, 1.0


@kernel
def within_limits(leg: Leg, angles: Array1D) -> bool:
    """Check that no joint above the ankle is at a limit."""
    inside = True
    for i in range(4):
        inside = inside and leg.limits[i, 0] < angles[i] < leg.limits[i, 1]
    return inside


@kernel
def keep_along(axis: Vector3, vector: Vector3) -> None:
    """Replace ``vector`` (3,) by its component along ``axis`` (3,), which has unit length."""
    part = 0.0
    for i in range(3):
        part += axis[i] * vector[i]
    vector[:] = part * axis


@kernel
def slow_stretch(
    leg: Leg, sole: Vector3, rotation: Matrix3, share: float, velocity: Vector3
) -> None:
    """Keep only a ``share`` of the velocity [m/s] that leads the ankle away from the hip.

    Args:
        sole, rotation: of the foot, from ``forward``.
    """
    if share == 1.0:
        return
    hip, plane = leg.hip, leg.plane
    square, along = 1e-9, 0.0
    for i in range(3):
        lever = plane[2, 0] * rotation[i, 0] + plane[2, 1] * rotation[i, 2]
        reach = sole[i] - lever - hip[i]
        square += reach * reach
        along += reach * velocity[i]
    scale = (1.0 - share) * along / square
    velocity[:] -= scale * (
        sole - (plane[2, 0] * rotation[:, 0] + plane[2, 1] * rotation[:, 2]) - hip
    )


@kernel
def line_rate(line: Array1D, last: Array1D, period: float, known: bool, out: Array1D) -> None:
    """Compute the time derivative (3,) of the direction of ``line`` [1/s]; updates ``last``."""
    x, y, z = line[0], line[1], line[2]
    largest = max(abs(x), abs(y), abs(z))
    if largest < 1e-300:
        x, y, z = 1.0, 0.0, 0.0
    else:
        x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    dx, dy, dz = x - last[0], y - last[1], z - last[2]
    jumped = dx * dx + dy * dy + dz * dz > _JUMP * _JUMP
    scale = 0.0 if jumped or not known else 1.0 / period
    out[0], out[1], out[2] = scale * dx, scale * dy, scale * dz
    last[0], last[1], last[2] = x, y, z


class VelocityScratch(NamedTuple):
    """Memory of ``inverse_velocity``."""

    rows: Array2D
    turns: Array2D
    normal: Array2D


def velocity_scratch() -> VelocityScratch:
    """Return zero memory for one leg."""
    return VelocityScratch(np.zeros((6, 5)), np.zeros((3, 5)), np.zeros((5, 5)))


@kernel
def inverse_velocity(
    sole_jacobian: Array2D,
    rotation: Matrix3,
    velocity: Vector3,
    line_rate: Vector3,
    length: float,
    damping: float,
    held: float,
    kept_rate: float,
    scratch: VelocityScratch,
    out: Array1D,
) -> None:
    """Compute the joint velocities (5,) for a sole velocity and a rate of the foot's line.

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
    """
    rows, turns = scratch.rows, scratch.turns
    multiply_matrices(rotation.T, sole_jacobian[3:6, :], turns)
    turn = nod = 0.0
    for i in range(3):
        turn += rotation[i, 1] * line_rate[i]
        nod -= rotation[i, 2] * line_rate[i]
    for j in range(5):
        for i in range(3):
            rows[i, j] = sole_jacobian[i, j]
        rows[3, j] = length * turns[2, j]
        rows[4, j] = length * turns[1, j]
        rows[5, j] = 0.0
    rows[5, 0] = held * length
    # With the task (velocity, length * turn, length * nod), whose product with the rows is:
    for j in range(5):
        value = length * (rows[3, j] * turn + rows[4, j] * nod)
        for i in range(3):
            value += rows[i, j] * velocity[i]
        out[j] = value + rows[5, j] * held * length * kept_rate
    solve_damped(rows, damping, scratch.normal, out)
