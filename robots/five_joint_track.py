"""One tick of a five-joint leg that follows a foot's target: joint angles and velocities.

The kernels here put those of ``five_joint_leg`` in order for a tick, so
that a leg is one call.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Flags0D,
    Flags1D,
    Indices1D,
    Matrix3,
    Vector3,
)
from ..mathematics.kernel import kernel
from .five_joint_leg import (
    Leg,
    forward,
    inverse,
    inverse_velocity,
    jacobian,
    keep_along,
    line_rate,
    pitched_line,
    slide,
    slow_stretch,
    yaw_share,
)

_FASTEST = 100.0
"""Foot velocities are limited to this [m/s], so that no square overflows."""


class LegGeometry(NamedTuple):
    """A ``Leg`` as arrays; ``joints`` (5,) are its joints' indices."""

    joints: Indices1D
    hip: Vector3
    plane: Array2D
    signs: Array1D
    limits: Array2D


class FootMotion(NamedTuple):
    """A foot's target in the base's frame: place (3,) [m], velocity (3,) [m/s], rotation (3, 3)."""

    position: Vector3
    velocity: Vector3
    rotation: Matrix3


class LegTargets(NamedTuple):
    """What a robot's joints shall do: (n_joints,) twice; and whether each foot is reached."""

    position: Array1D
    velocity: Array1D
    reachable: Flags1D


class LegScratch(NamedTuple):
    """Memory for intermediate results; ``line`` and ``rate`` lead from one kernel to the other."""

    line: Vector3
    rate: Vector3
    angles: Array1D
    speeds: Array1D
    sole: Vector3
    turn: Matrix3
    velocity: Vector3
    place: Vector3
    jacobian: Array2D
    rows: Array2D
    turns: Array2D
    normal: Array2D


class LegSettings(NamedTuple):
    """Settings that may change during a run, each an array without a dimension.

    ``softness`` [m], ``turn_length`` [m] and ``damping`` [m] are those of ``inverse`` and
    ``inverse_velocity``; ``level`` says where the hip's yaw is kept; ``speed_limit`` [rad/s] limits
    the joints' velocities; ``slides`` says whether a foot out of reach slides in the plane of its
    sole first.
    """

    softness: Array0D
    turn_length: Array0D
    damping: Array0D
    level: Array0D
    speed_limit: Array0D
    slides: Flags0D


def leg_geometry(leg: Leg, margin: float) -> LegGeometry:
    """A leg whose joints stay ``margin`` [rad] inside their limits."""
    limits = leg.limits + np.array([margin, -margin])
    return LegGeometry(np.array(leg.joints), leg.hip, leg.plane, leg.signs, limits)


def leg_scratch() -> LegScratch:
    """Zero memory for one leg."""
    shapes = (3, 3, 5, 5, 3, (3, 3), 3, 3, (6, 5), (6, 5), (3, 5), (5, 5))
    return LegScratch(*(np.zeros(shape) for shape in shapes))


@kernel
def watch_line(
    rotation: Matrix3,
    pitched: bool,
    pitch: Array0D,
    period: float,
    known: Flags0D,
    direction: Vector3,
    scratch: LegScratch,
) -> None:
    """The direction of the foot's line that is wanted, and how fast it turns.

    Args:
        rotation: of the foot's target, (3, 3).
        pitched: whether the line is turned by ``pitch`` [rad], of shape (), about the foot's y axis.
        period: between two ticks [s].
        known: whether ``direction`` (3,) is that of the last tick, of shape (); it is updated.
    """
    scratch.line[:] = rotation[:, 0]
    if pitched:
        pitched_line(rotation, pitch[()], scratch.line)
    line_rate(scratch.line, direction, period, bool(known[()]), scratch.rate)


@kernel
def follow_foot(
    leg: LegGeometry,
    number: int,
    foot: FootMotion,
    kept: Array1D,
    kept_rates: Array1D,
    settings: LegSettings,
    scratch: LegScratch,
    target: LegTargets,
) -> None:
    """The angles and velocities of a leg's joints for its foot's target (paper, V).

    Args:
        number: the foot's.
        kept, kept_rates: angles [rad] and velocities [rad/s] of all joints, (n_joints,), of which the
            hip's yaw takes over those of its joint where the thigh is level.
        scratch: with the line and its rate from ``watch_line``.
        target: out; only the leg's joints are written.
    """
    angles, speeds, turn, velocity = scratch.angles, scratch.speeds, scratch.turn, scratch.velocity
    softness, level = settings.softness, settings.level
    yaw, yaw_rate = kept[leg.joints[0]], kept_rates[leg.joints[0]]
    inside, share = inverse(
        leg.hip,
        leg.plane,
        leg.signs,
        leg.limits,
        foot.position,
        scratch.line,
        softness,
        yaw,
        level,
        angles,
    )
    target.reachable[number] = inside
    velocity[:] = min(max(foot.velocity, -_FASTEST), _FASTEST)  # type: ignore[assignment]  # of each element
    if settings.slides and not inside:
        slid, slid_share = slide(
            leg.hip, leg.plane, leg.signs, leg.limits, foot.position, foot.rotation, softness, yaw,
            level, scratch.place, angles,
        )  # fmt: skip
        if slid:
            share = slid_share
            keep_along(foot.rotation[:, 2], velocity)
    forward(leg.hip, leg.plane, leg.signs, angles, scratch.sole, turn)
    jacobian(leg.plane, leg.signs, angles, scratch.jacobian)
    slow_stretch(leg.hip, leg.plane, scratch.sole, turn, share, velocity)
    yaw_held = 1.0 - yaw_share(math.cos(angles[1]), level)
    inverse_velocity(
        scratch.jacobian, turn, velocity, scratch.rate, settings.turn_length,
        settings.damping, yaw_held, yaw_rate, scratch.rows, scratch.turns, scratch.normal, speeds,
    )  # fmt: skip
    limit = settings.speed_limit
    for i in range(5):
        joint, angle, speed = leg.joints[i], angles[i], speeds[i]
        held = angle <= leg.limits[i, 0] or angle >= leg.limits[i, 1]
        target.position[joint] = angle
        target.velocity[joint] = 0.0 if held else min(max(speed, -limit), limit)
