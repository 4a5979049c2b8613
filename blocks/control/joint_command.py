"""What ``JointPD`` does in every tick, as one kernel: the command of all joints."""

from __future__ import annotations

from typing import NamedTuple

from ...mathematics.arrays import (
    Array1D,
    Flags0D,
    Flags1D,
    Indices0D,
    Indices1D,
)
from ...mathematics.joint_feedback import (
    Feedback,
    Motion,
    SoftStops,
    add_friction,
    add_soft_stops,
    blend_feedback,
    integrate_accelerations,
)
from ...mathematics.kernel import kernel
from ..signals import CommandMode, Phase

MEASURED, ACCELERATION, LEGS = 0, 1, 2
"""Kinds of targets of the stance gains."""

# What a compiled kernel can read.
_ACTIVE, _FLIGHT, _LANDING = int(CommandMode.ACTIVE), int(Phase.FLIGHT), int(Phase.LANDING)


class Legs(NamedTuple):
    """Which joints belong to which leg.

    ``foot_of_point`` (n_contacts,) and ``foot_of_joint`` (n_joints,), where -1 stands for a joint that
    is held or belongs to no leg; ``held`` (n_joints,) and its ``angle`` (n_joints,) [rad]; and
    ``free`` (n_joints,), the joints that are neither held nor in a leg.
    """

    foot_of_point: Indices1D
    foot_of_joint: Indices1D
    held: Flags1D
    angle: Array1D
    free: Flags1D


class Inputs(NamedTuple):
    """What the command follows: fields of ``PhaseState``, ``WholeBodyCommand`` and ``JumpReference``.

    ``measured`` are the joints, ``legs`` and ``planned`` the targets of the joints in a leg and of the
    free ones, and ``acceleration`` (n_joints,) those of the whole-body controller [rad/s^2].
    """

    phase: Indices0D
    stance: Flags1D
    stepping: Flags1D
    torque: Array1D
    acceleration: Array1D
    measured: Motion
    legs: Motion
    planned: Motion
    planned_phase: Indices0D
    planned_torque: Array1D


class Numbers(NamedTuple):
    """Parameters that may change during a run.

    Each is an array of one element, but for ``friction`` [N m] and ``damping`` [N m s/rad] of all
    joints (n_joints,). ``rate`` is the change of a weight in a tick, ``compensates`` says whether there
    is any friction to compensate.
    """

    rate: Array1D
    feedforward: Array1D
    leak: Array1D
    friction: Array1D
    damping: Array1D
    speed: Array1D
    compensates: Flags1D


class Following(NamedTuple):
    """The fields of ``JointFollower``."""

    airborne: Array1D
    targets: Motion
    started: Flags0D


class Joints(NamedTuple):
    """Memory: the weight of the flight gains of every joint (n_joints,), and both sets of gains."""

    airborne: Array1D
    flight: Feedback
    stance: Feedback


@kernel
def command_joints(
    period: float,
    kind: int,
    legs: Legs,
    inputs: Inputs,
    numbers: Numbers,
    stops: SoftStops,
    following: Following,
    joints: Joints,
    mode: Indices0D,
    torque: Array1D,
    out: Feedback,
) -> None:
    """Write the command: ``mode`` (), ``torque`` (n_joints,) [N m] and the feedback ``out``.

    Args:
        period: of a tick [s].
        kind: of the stance gains' targets.
    """
    blend_legs(legs, inputs, numbers, following, joints.airborne)
    find_stance_targets(period, kind, legs, inputs, numbers, following, joints.stance)
    find_flight_targets(legs, inputs, joints.flight)
    mode[()] = _ACTIVE
    flies = inputs.phase[()] == _FLIGHT and inputs.planned_phase[()] == _FLIGHT
    for i in range(torque.shape[0]):
        airborne = joints.airborne[i]
        torque[i] = (1.0 - airborne) * inputs.torque[i]
        if flies:
            planned = airborne * inputs.planned_torque[i] * numbers.feedforward[0]
            torque[i] = torque[i] + planned
    if numbers.compensates[0]:
        add_friction(
            inputs.measured.velocity, numbers.friction, numbers.damping, numbers.speed[0],
            torque,
        )  # fmt: skip
    blend_feedback(joints.airborne, joints.flight, joints.stance, inputs.measured, out)
    if stops.gain[0] > 0.0:
        add_soft_stops(inputs.measured.position, stops, out)


@kernel
def blend_legs(
    legs: Legs, inputs: Inputs, numbers: Numbers, following: Following, airborne: Array1D
) -> None:
    """Change the weight of each leg's flight gains: up where no point of it is in stance.

    A joint of no leg, or one that is held, has the least weight of all legs.
    """
    phase, rate = inputs.phase[()], numbers.rate[0]
    least = 1.0 if following.airborne.shape[0] > 0 else 0.0
    for foot in range(following.airborne.shape[0]):
        swings = phase in (_FLIGHT, _LANDING)
        for point in range(legs.foot_of_point.shape[0]):
            held = inputs.stance[point] or inputs.stepping[point]
            if legs.foot_of_point[point] == foot and held:
                swings = False
        weight = following.airborne[foot] + (rate if swings else -rate)
        weight = min(max(weight, 0.0), 1.0)
        following.airborne[foot] = weight
        least = min(least, weight)
    for joint in range(airborne.shape[0]):
        foot = legs.foot_of_joint[joint]
        airborne[joint] = least if foot < 0 else following.airborne[foot]


@kernel
def find_stance_targets(
    period: float,
    kind: int,
    legs: Legs,
    inputs: Inputs,
    numbers: Numbers,
    following: Following,
    stance: Feedback,
) -> None:
    """The measured joints at rest, the legs' targets, or integrated accelerations."""
    measured, targets = inputs.measured, following.targets
    if kind == ACCELERATION:
        if not following.started[()]:
            for i in range(legs.held.shape[0]):
                targets.position[i] = measured.position[i]
                targets.velocity[i] = measured.velocity[i]
            following.started[()] = True
        integrate_accelerations(period, numbers.leak[0], inputs.acceleration, measured, targets)
    for i in range(legs.held.shape[0]):
        if legs.held[i]:
            stance.position[i], stance.velocity[i] = legs.angle[i], 0.0
        elif kind == MEASURED:
            stance.position[i], stance.velocity[i] = measured.position[i], 0.0
        elif kind == LEGS:
            stance.position[i] = inputs.legs.position[i]
            stance.velocity[i] = inputs.legs.velocity[i]
        else:
            stance.position[i], stance.velocity[i] = targets.position[i], targets.velocity[i]


@kernel
def find_flight_targets(legs: Legs, inputs: Inputs, flight: Feedback) -> None:
    """The legs' targets, the held angles, and the plan for joints that belong to no leg."""
    for i in range(legs.held.shape[0]):
        if legs.held[i]:
            flight.position[i], flight.velocity[i] = legs.angle[i], 0.0
        elif legs.free[i]:
            flight.position[i] = inputs.planned.position[i]
            flight.velocity[i] = inputs.planned.velocity[i]
        else:
            flight.position[i] = inputs.legs.position[i]
            flight.velocity[i] = inputs.legs.velocity[i]
