"""One tick of a leg that follows its foot's target: joint positions and velocities.

A five-joint leg is solved in closed form (``robots/five_joint_leg``), any other leg by damped least squares
(``robots/limb_inverse``). A leg is two calls: the first finds how fast the target turns, the second solves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Flags0D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from ...mathematics.elementary import cos
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.five_joint_leg import (
    Leg,
    VelocityScratch,
    forward,
    inverse,
    inverse_velocity,
    jacobian,
    keep_along,
    line_rate,
    pitched_line,
    slide,
    slow_stretch,
    velocity_scratch,
    yaw_share,
)
from ...robots.kinematics import ball_feet
from ...robots.limb import FootKind, aim, read_limb, turning
from ...robots.limb_inverse import REACHED, approach, limb_scratch, limb_velocity, reach
from ...runtime.language.signals import Field, Signal
from ..signals import FootTarget, JointState, JointTarget, JumpReference

_FASTEST = 100.0
"""Foot velocities [m/s] and measured joints [rad or m] are limited to this, so that no square overflows."""
_JUMP = 0.1
"""A target that rotates by more than this [rad] in a tick is a new target, not a motion."""
_STEPS = 24
"""The largest number of least-squares steps from each starting point."""
_LOOSE = 0.1
"""Weight of those errors that matter less for a target out of reach; the others have weight 1."""
_POINT = int(FootKind.POINT)


class LegMemory(Signal):
    """The feet's targets and the joints' solution of the last tick."""

    direction = Field(("n_feet", 3), unit="", frame="body", text="heel to toe, of unit length")
    known = Field(dtype="bool", text="there was a last tick")
    target = Field(("n_feet", 4, 3), frame="body", text="place [m] and rows of the rotation matrix")
    position = Field("n_joints", unit="rad", text="joint positions found")
    flew = Field(dtype="bool", text="the plan has flown and was followed")
    flown_time = Field(unit="s", text="the plan's time in the last tick of its flight")
    flown_position = Field("n_joints", unit="rad", text="the joints' targets then")
    flown_velocity = Field("n_joints", unit="rad/s", text="their velocities")
    flown_acceleration = Field("n_joints", unit="rad/s^2", text="their planned accelerations")


class LegSettings(NamedTuple):
    """Settings that may change during a run, each an array without a dimension.

    ``softness`` [m], ``turn_length`` [m] and ``damping`` [m] are those of ``inverse`` and
    ``inverse_velocity``; ``level`` is the place where the hip's yaw is kept; ``speed_limit`` [rad/s] limits
    the joints' velocities; ``slides`` is true if a foot out of reach slides in the plane of its
    sole first.
    """

    softness: Array0D
    turn_length: Array0D
    damping: Array0D
    level: Array0D
    speed_limit: Array0D
    slides: Flags0D


# Legs in closed form


class LegScratch(NamedTuple):
    """Memory for intermediate results; ``line`` and ``rate`` lead from one kernel to the other."""

    least_squares: VelocityScratch
    line: Vector3
    rate: Vector3
    angles: Array1D
    speeds: Array1D
    sole: Vector3
    turn: Matrix3
    velocity: Vector3
    place: Vector3
    jacobian: Array2D


def with_margin(leg: Leg, margin: float) -> Leg:
    """Return a leg whose joints stay ``margin`` [rad] inside their limits."""
    return leg._replace(limits=leg.limits + np.array([margin, -margin]))


def leg_scratch() -> LegScratch:
    """Zero memory for one leg."""
    shapes = (3, 3, 5, 5, 3, (3, 3), 3, 3, (6, 5))
    return LegScratch(velocity_scratch(), *(np.zeros(shape) for shape in shapes))


@kernel
def watch_line(
    number: int,
    feet: FootTarget,
    reference: JumpReference,
    pitched: bool,
    period: float,
    memory: LegMemory,
    scratch: LegScratch,
) -> None:
    """Track the desired direction of a foot's line, and its rate.

    Args:
        number: the foot's.
        pitched: whether the line has the foot's pitch in the plan.
        period: between two ticks [s].
    """
    rotation = feet.rotation[number]
    scratch.line[:] = rotation[:, 0]
    if pitched:
        pitched_line(rotation, reference.foot_pitch[number], scratch.line)
    line_rate(scratch.line, memory.direction[number], period, bool(memory.known), scratch.rate)


@kernel
def follow_foot(
    leg: Leg,
    number: int,
    feet: FootTarget,
    reference: JumpReference,
    settings: LegSettings,
    scratch: LegScratch,
    target: JointTarget,
) -> None:
    """Compute the angles and velocities of a leg's joints for its foot's target (paper, V).

    Args:
        number: the foot's.
        reference: its hip yaw takes over where the thigh is level.
        scratch: with the line and its rate from ``watch_line``.
        target: out; only the leg's joints are written.
    """
    angles, speeds, turn, velocity = scratch.angles, scratch.speeds, scratch.turn, scratch.velocity
    softness, level = settings.softness, settings.level
    position, rotation = feet.position[number], feet.rotation[number]
    yaw = reference.joint_position[leg.joints[0]]
    yaw_rate = reference.joint_velocity[leg.joints[0]]
    inside, share = inverse(leg, position, scratch.line, softness, yaw, level, angles)
    target.reachable[number] = inside
    velocity[:] = min(max(feet.velocity[number], -_FASTEST), _FASTEST)  # of each element
    if settings.slides and not inside:
        slid, slid_share = slide(
            leg, position, rotation, softness, yaw, level, scratch.place, angles
        )
        if slid:
            share = slid_share
            keep_along(rotation[:, 2], velocity)
    forward(leg, angles, scratch.sole, turn)
    jacobian(leg.plane, leg.signs, angles, scratch.jacobian)
    slow_stretch(leg, scratch.sole, turn, share, velocity)
    yaw_held = 1.0 - yaw_share(cos(angles[1]), level)
    inverse_velocity(
        scratch.jacobian, turn, velocity, scratch.rate, settings.turn_length,
        settings.damping, yaw_held, yaw_rate, scratch.least_squares, speeds,
    )  # fmt: skip
    limit = settings.speed_limit
    for i in range(5):
        joint, angle, speed = leg.joints[i], angles[i], speeds[i]
        held = angle <= leg.limits[i, 0] or angle >= leg.limits[i, 1]
        target.position[joint] = angle
        target.velocity[joint] = 0.0 if held else min(max(speed, -limit), limit)


# Legs by least squares


class LimbGeometry(NamedTuple):
    """A ``Limb`` as arrays.

    Attributes:
        joints: their indices among the robot's, (n,).
        links, tip, limits: of the ``Limb``; the foot of a ball is the ball's centre.
        standing: the joints' standing angles [rad or m], (n,).
        radius: of the ball that the foot is [m], or zero.
    """

    joints: Indices1D
    links: Array2D
    tip: Array1D
    limits: Array2D
    standing: Array1D
    radius: float


class LimbScratch(NamedTuple):
    """Memory for intermediate results; ``target`` and ``twist`` lead from one kernel to the other."""

    target: Rows3
    twist: Array1D
    rotation: Matrix3
    line: Vector3
    place: Vector3
    weights: Vector3
    starts: Array2D
    work: Array2D
    angles: Array1D
    speeds: Array1D


def limb_geometry(robot: RobotDescription, foot: int, margin: float) -> LimbGeometry:
    """Return the limb that ends in foot number ``foot``; its joints stay ``margin`` inside their limits.

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
    number: int,
    feet: FootTarget,
    reference: JumpReference,
    pitched: bool,
    period: float,
    memory: LegMemory,
    scratch: LimbScratch,
) -> None:
    """Track the target of the limb, and its rate.

    Args:
        number: the foot's.
        pitched: whether the foot has its pitch in the plan.
        period: between two ticks [s].
    """
    rotation, twist, last = scratch.rotation, scratch.twist, memory.target[number]
    rotation[:, :] = feet.rotation[number]
    if pitched:
        pitched_line(rotation, reference.foot_pitch[number], scratch.line)
        rotation[:, 0] = scratch.line
    # A ball's centre is its radius above the ground, whichever way the leg comes.
    scratch.place[:] = feet.rotation[number, :, 2] * limb.radius + feet.position[number]
    aim(scratch.place, rotation, scratch.target)
    for k in range(3, 6):
        twist[k] = 0.0
    if memory.known:
        turning(limb.tip, last, scratch.target, period, _JUMP, twist[3:])
    for i in range(4):
        last[i, :] = scratch.target[i]


@kernel
def follow_limb(
    limb: LimbGeometry,
    number: int,
    feet: FootTarget,
    joints: JointState,
    memory: LegMemory,
    settings: LegSettings,
    scratch: LimbScratch,
    target: JointTarget,
) -> None:
    """Compute the positions and velocities of a limb's joints for its foot's target, by least squares.

    Args:
        number: the foot's.
        scratch: with the target and its rotation from ``watch_foot``.
        target: out; only the limb's joints are written.
    """
    weights, starts, angles, twist = scratch.weights, scratch.starts, scratch.angles, scratch.twist
    n, slides = limb.joints.shape[0], settings.slides
    for i in range(n):
        joint = limb.joints[i]
        felt = min(max(joints.position[joint], -_FASTEST), _FASTEST)
        starts[0, i] = memory.position[joint] if memory.known else felt
        starts[1, i] = felt
        starts[2, i] = limb.standing[i]
    weights[0], weights[1], weights[2] = 1.0, 1.0, settings.turn_length
    square = reach(
        limb.links, limb.tip, limb.limits, scratch.target, weights, starts, 3, _STEPS,
        scratch.work, angles,
    )  # fmt: skip
    target.reachable[number] = square <= REACHED
    if square > REACHED and (slides or int(limb.tip[6]) != _POINT):
        loose = 0 if slides else 2
        weights[loose] = weights[loose] * _LOOSE
        approach(
            limb.links, limb.tip, limb.limits, scratch.target, weights, _STEPS, scratch.work,
            angles,
        )  # fmt: skip
    for k in range(3):
        twist[k] = min(max(feet.velocity[number, k], -_FASTEST), _FASTEST)
    limb_velocity(
        limb.links, limb.tip, limb.limits, scratch.target, weights, angles, twist,
        settings.damping, scratch.work, scratch.speeds,
    )  # fmt: skip
    limit = settings.speed_limit
    for i in range(n):
        joint, speed = limb.joints[i], scratch.speeds[i]
        target.position[joint] = angles[i]
        target.velocity[joint] = min(max(speed, -limit), limit)
