"""How legs in flight follow a plan's joints, with regard to the base's attitude, as kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array3D,
    Flags0D,
    Indices0D,
    Indices1D,
)
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...robots.five_joint_track import LegTargets

BEFORE = 0.006
"""Accelerations are read ahead of time, so those of the last part [s] of a flight are of its landing."""


class PlannedJoints(NamedTuple):
    """The fields of ``JumpReference`` that say what the joints should do."""

    phase: Indices0D
    time: Array0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    orientation: Array1D
    joint_position: Array1D
    joint_velocity: Array1D
    joint_acceleration: Array1D


class Following(NamedTuple):
    """The parameters of ``LegInverseKinematics`` about a plan that is followed, (1,) each."""

    plan_lead: Array1D
    level_time: Array1D
    late_time: Array1D


class Flown(NamedTuple):
    """The targets in the last tick in which the plan flew: the plan's ``time`` [s], and the joints'
    ``position`` [rad], ``velocity`` [rad/s] and ``acceleration`` [rad/s^2]. Before a flight ``known`` is
    false."""

    known: Flags0D
    time: Array0D
    position: Array1D
    velocity: Array1D
    acceleration: Array1D


class Soles(NamedTuple):
    """What levels the soles.

    ``wanted`` (n_feet, 3, 3) are the axes of level soles in the base's. For every foot there is the
    number of the ``joint`` that turns it about its lateral axis, that ``axis``' component along the
    base's y axis, which is zero without such a joint, and the ``lowest`` and ``highest`` angle [rad].
    """

    wanted: Array3D
    joint: Indices1D
    axis: Array1D
    lowest: Array1D
    highest: Array1D


@kernel
def follow_plan(
    following: Following, soles: Soles, plan: PlannedJoints, flown: Flown, target: LegTargets
) -> None:
    """The plan's joints as the targets: of a later or earlier instant, and with level soles. They are
    remembered in ``flown``."""
    ahead = following.plan_lead[0] * share_of_lead(plan)
    pitch = planned_pitch(plan)
    if not keeps_acceleration(following, plan, flown):
        flown.acceleration[:] = plan.joint_acceleration
    for joint in range(plan.joint_position.shape[0]):
        speed = plan.joint_velocity[joint]
        change = flown.acceleration[joint] * ahead
        way = ahead * (speed + 0.5 * change)
        target.position[joint] = plan.joint_position[joint] + way
        target.velocity[joint] = speed + change
    for foot in range(target.reachable.shape[0]):
        target.reachable[foot] = True
        level_sole(foot, following.level_time[0], soles, plan, pitch, target)
    flown.known[()] = True
    flown.time[()] = plan.time[()]
    for joint in range(plan.joint_position.shape[0]):
        flown.position[joint] = target.position[joint]
        flown.velocity[joint] = target.velocity[joint]


@kernel
def keeps_acceleration(following: Following, plan: PlannedJoints, flown: Flown) -> bool:
    """Whether the accelerations of before count, because those of the plan may be of its landing.

    A ``touchdown_time`` that has long passed is that of the flight before.
    """
    if following.late_time[0] == 0.0 or not flown.known[()]:
        return False
    return abs(float(plan.touchdown_time[()]) - float(plan.time[()])) <= BEFORE


@kernel
def go_on(following: Following, plan: PlannedJoints, flown: Flown, target: LegTargets) -> None:
    """For ``late_time`` after the planned touchdown the joints move on as they did in the plan's flight.

    So the feet of a robot that lands late keep slowing down. After that the ``target`` stays as it is.
    """
    since = plan.time[()] - flown.time[()]
    if not flown.known[()] or since >= following.late_time[0]:
        return
    for joint in range(flown.position.shape[0]):
        change = flown.acceleration[joint] * since
        speed = flown.velocity[joint]
        target.position[joint] = flown.position[joint] + since * (speed + 0.5 * change)
        target.velocity[joint] = speed + change


@kernel
def share_of_lead(plan: PlannedJoints) -> float:
    """How much of the lead counts: it grows from 0 at lift-off to 1 in the middle of the flight.

    From its middle on the plan may name the times of the next flight already.
    """
    since = float(plan.time[()] - plan.lift_off_time[()])
    lasts = float(plan.touchdown_time[()] - plan.lift_off_time[()])
    if since < 0.0 or lasts <= 0.0:
        return 1.0
    return min(2.0 * since / lasts, 1.0)


@kernel
def planned_pitch(plan: PlannedJoints) -> float:
    """The angle [rad] by which the plan has turned the base about its y axis."""
    x, y = plan.orientation[0], plan.orientation[1]
    z, w = plan.orientation[2], plan.orientation[3]
    return math.atan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z))


@kernel
def turned_too_far(foot: int, soles: Soles, pitch: float) -> float:
    """By how much [rad] the base has turned further about its y axis than the plan's ``pitch`` [rad].

    It is the angle between a level sole in the base's axes as measured and as planned.
    """
    measured = math.atan2(soles.wanted[foot, 2, 0], soles.wanted[foot, 0, 0])
    error = measured - pitch
    return math.atan2(math.sin(error), math.cos(error))


@kernel
def level_sole(
    foot: int,
    level_time: float,
    soles: Soles,
    plan: PlannedJoints,
    pitch: float,
    target: LegTargets,
) -> None:
    """Turn a sole by its last joint against what the base has turned further than the plan's ``pitch``."""
    if level_time <= 0.0 or soles.axis[foot] == 0.0:
        return
    since = float(plan.time[()] - plan.touchdown_time[()] + level_time)
    share, _, _ = minimum_jerk(2.0 * since / level_time)
    joint, error = soles.joint[foot], turned_too_far(foot, soles, pitch)
    angle = target.position[joint] - share * soles.axis[foot] * error
    target.position[joint] = min(max(angle, soles.lowest[foot]), soles.highest[foot])
