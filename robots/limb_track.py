"""One tick of a limb of any joints that follows a foot's target: joint angles and velocities.

The kernels here put those of ``limb_error`` and ``limb_inverse`` in order for a tick, as those of
``five_joint_track`` do for legs that are solved in closed form.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..mathematics.arrays import Array, Flags, Indices
from ..mathematics.kernel import kernel
from .ball_feet import ball_feet
from .description import RobotDescription
from .five_joint_reach import pitched_line
from .five_joint_track import FootMotion, LegSettings, LegTargets
from .limb import FootKind, read_limb
from .limb_error import aim, turning
from .limb_inverse import REACHED, approach, limb_scratch, limb_velocity, reach

_FASTEST = 100.0
"""Foot velocities [m/s] and measured joints [rad or m] are limited to this, so that no square overflows."""
_JUMP = 0.1
"""A target that rotates by more than this [rad] in a tick is a new target, not a motion."""
_STEPS = 24
"""The largest number of least-squares steps from each starting point."""
_LOOSE = 0.1
"""Weight of those errors that matter less for a target out of reach; the others have weight 1."""
_POINT = int(FootKind.POINT)


class LimbGeometry(NamedTuple):
    """A ``Limb`` as arrays.

    Attributes:
        joints: their indices among the robot's, (n,).
        links, tip, limits: of the ``Limb``; the foot of a ball is the ball's centre.
        standing: the joints' standing angles [rad or m], (n,).
        radius: of the ball that the foot is [m], or zero.
    """

    joints: Indices
    links: Array
    tip: Array
    limits: Array
    standing: Array
    radius: float


class LimbScratch(NamedTuple):
    """Memory for intermediate results; ``target`` and ``twist`` lead from one kernel to the other."""

    target: Array
    twist: Array
    rotation: Array
    line: Array
    place: Array
    weights: Array
    starts: Array
    work: Array
    angles: Array
    speeds: Array


def limb_geometry(robot: RobotDescription, foot: int, margin: float) -> LimbGeometry:
    """The limb that ends in foot number ``foot``; its joints stay ``margin`` inside their limits.

    Raises:
        ValueError: no chain of joints leads from the base to the foot.
    """
    limb, radius = read_limb(robot, foot, margin), 0.0
    for ball in ball_feet(robot):
        if ball.foot == foot:
            radius = float(ball.radius)
            limb.tip[:3] = ball.centre
    return LimbGeometry(
        np.array(limb.joints, dtype=np.int64), limb.links, limb.tip, limb.limits,
        robot.standing_position[list(limb.joints)], radius,
    )  # fmt: skip


def limb_memory(joints: int) -> LimbScratch:
    """Zero memory for a limb with that many joints."""
    n = joints
    return LimbScratch(
        np.zeros((4, 3)), np.zeros(6), np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.ones(3),
        np.zeros((3, n + 1)), limb_scratch(n), np.zeros(n), np.zeros(n),
    )  # fmt: skip


@kernel
def watch_foot(
    limb: LimbGeometry,
    foot: FootMotion,
    pitched: bool,
    pitch: Array,
    period: float,
    known: Flags,
    last: Array,
    scratch: LimbScratch,
) -> None:
    """The target of the limb, and how fast it turns.

    Args:
        pitched: whether the foot's x axis is turned by ``pitch`` [rad], of shape (), about its y axis.
        period: between two ticks [s].
        known: whether ``last`` (4, 3) is the target of the last tick, of shape (); it is updated.
    """
    rotation, twist = scratch.rotation, scratch.twist
    for i in range(3):
        for k in range(3):
            rotation[i, k] = foot.rotation[i, k]
    if pitched:
        pitched_line(rotation, float(pitch[()]), scratch.line)
        for i in range(3):
            rotation[i, 0] = scratch.line[i]
    # A ball's centre is its radius above the ground, whichever way the leg comes.
    for k in range(3):
        above = float(foot.rotation[k, 2]) * limb.radius
        scratch.place[k] = above + float(foot.position[k])
    aim(scratch.place, rotation, scratch.target)
    for k in range(3, 6):
        twist[k] = 0.0
    if known[()]:
        turning(limb.tip, last, scratch.target, period, _JUMP, twist[3:])
    for i in range(4):
        for k in range(3):
            last[i, k] = scratch.target[i, k]


@kernel
def follow_limb(
    limb: LimbGeometry,
    number: int,
    foot: FootMotion,
    measured: Array,
    known: Flags,
    found: Array,
    settings: LegSettings,
    scratch: LimbScratch,
    target: LegTargets,
) -> None:
    """The positions and velocities of a limb's joints for its foot's target, by least squares.

    Args:
        number: the foot's.
        measured: positions of all joints [rad or m], (n_joints,).
        known: whether ``found``, (n_joints,), is the solution of the last tick, of shape ().
        scratch: with the target and its rotation from ``watch_foot``.
        target: out; only the limb's joints are written.
    """
    weights, starts, angles, twist = scratch.weights, scratch.starts, scratch.angles, scratch.twist
    n, slides = limb.joints.shape[0], bool(settings.slides[0])
    for i in range(n):
        joint = int(limb.joints[i])
        felt = min(max(float(measured[joint]), -_FASTEST), _FASTEST)
        starts[0, i] = float(found[joint]) if known[()] else felt
        starts[1, i] = felt
        starts[2, i] = limb.standing[i]
    weights[0], weights[1], weights[2] = 1.0, 1.0, float(settings.turn_length[0])
    square = reach(
        limb.links, limb.tip, limb.limits, scratch.target, weights, starts, 3, _STEPS,
        scratch.work, angles,
    )  # fmt: skip
    target.reachable[number] = square <= REACHED
    if square > REACHED and (slides or int(limb.tip[6]) != _POINT):
        loose = 0 if slides else 2
        weights[loose] = float(weights[loose]) * _LOOSE
        approach(
            limb.links, limb.tip, limb.limits, scratch.target, weights, _STEPS, scratch.work,
            angles,
        )  # fmt: skip
    for k in range(3):
        twist[k] = min(max(float(foot.velocity[k]), -_FASTEST), _FASTEST)
    limb_velocity(
        limb.links, limb.tip, limb.limits, scratch.target, weights, angles, twist,
        float(settings.damping[0]), scratch.work, scratch.speeds,
    )  # fmt: skip
    limit = float(settings.speed_limit[0])
    for i in range(n):
        joint, speed = int(limb.joints[i]), float(scratch.speeds[i])
        target.position[joint] = angles[i]
        target.velocity[joint] = min(max(speed, -limit), limit)
