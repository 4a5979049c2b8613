"""What ``LandingHeuristic`` does in every tick, as kernels: where the feet land, and their way."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Array3D,
    Flags0D,
    Indices0D,
    Matrix3,
    Rows3,
    Vector2,
    Vector3,
    Vector4,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.landing_law import (
    apply_lead,
    heading_matrix,
    keep_within,
    landing_place,
    lowest_height,
    retraction,
    swing,
    turn_places,
)
from ...mathematics.linear_algebra import multiply_matrices, multiply_vector
from ...mathematics.rotations import (
    conjugate,
    cross,
    exponential,
    from_matrix,
    logarithm,
    multiply,
    to_matrix,
    yaw,
)
from ..signals import Phase
from .landing_prediction import LAST, Prediction, Terms, choose_shift_of_feet

_SLOWEST = 0.3
"""The least speed of descent [m/s] by which a change of the legs' length changes the time."""
_FLIGHT, _LANDING = int(Phase.FLIGHT), int(Phase.LANDING)


class Now(NamedTuple):
    """The fields of ``PhaseState`` that the law takes."""

    phase: Indices0D
    time_in_phase: Array0D
    time_to_touchdown: Array0D


class Plan(NamedTuple):
    """The fields of ``JumpReference`` that the law takes."""

    time: Array0D
    phase: Indices0D
    lift_off_time: Array0D
    touchdown_time: Array0D
    com: Vector3
    com_velocity: Vector3
    orientation: Vector4
    angular_velocity: Vector3
    angular_momentum: Vector3
    foot_position: Rows3
    foot_velocity: Rows3
    foot_yaw: Array1D
    toes_first: Flags0D


class Memory(NamedTuple):
    """The fields of ``LandingMemory``."""

    flying: Flags0D
    offset: Rows3
    goal: Rows3
    planned: Rows3
    swing: Rows3
    linear: Vector3
    angular: Vector3
    orientation: Vector4
    shift: Vector4
    started: Flags0D
    origin: Vector3
    lift_off_time: Array0D
    wished: Vector3
    due: Array0D


class Targets(NamedTuple):
    """The fields of ``FootTarget``."""

    position: Array2D
    velocity: Array2D
    rotation: Array3D
    landing: Rows3


class Law(NamedTuple):
    """What is fixed for a run.

    ``predicts`` and ``deviates`` say which law it is (neither: the paper's), ``turned`` that the limits
    are about the feet's places in standing: ``stance`` (n_feet, 3) [m]. ``side`` (n_feet,) is 1, -1 or 0,
    ``mass`` that of the description [kg], and ``period`` that of a tick [s].
    """

    predicts: bool
    deviates: bool
    turned: bool
    side: Array1D
    stance: Rows3
    mass: float
    period: float


class Settings(NamedTuple):
    """Live parameters: arrays of two elements, the alphas of three, from ``w_c`` on of one."""

    w_l: Vector2
    w_k: Vector2
    p_max: Vector2
    alpha: Vector3
    toes_alpha: Vector3
    w_c: Array1D
    reach_share: Array1D
    retraction: Array1D
    retraction_time: Array1D
    lead_time: Array1D


class Scratch(NamedTuple):
    """``place`` and ``centre`` (n_feet, 3), quaternions (4,), matrices (3, 3), vectors (3,).

    ``linear`` and ``angular`` are the momenta fed back; ``rotation`` is the frame that the targets are
    fixed in and ``rate`` its angular velocity; ``com_body`` is the centre of mass from the base, in its
    axes; ``speed`` is that of the foot in hand.
    """

    place: Rows3
    centre: Rows3
    quaternion: Vector4
    turn: Vector4
    rotation: Matrix3
    heading: Matrix3
    linear: Vector3
    angular: Vector3
    miss: Vector3
    vector: Vector3
    com_body: Vector3
    rate: Vector3
    speed: Vector3
    spare: Vector3


@kernel
def aim_feet(
    now: Now,
    plan: Plan,
    terms: Terms,
    law: Law,
    settings: Settings,
    prediction: Prediction,
    memory: Memory,
    targets: Targets,
    scratch: Scratch,
) -> None:
    """One tick of ``LandingHeuristic``."""
    phase = int(now.phase[()])
    flying, landing = phase == _FLIGHT, phase == _LANDING
    if not memory.started[()]:
        find_origin(plan, terms, memory)
    remember_landing(plan, flying, memory)
    overdue = flying and int(plan.phase[()]) > _FLIGHT
    if not overdue:
        remember_plan(plan, terms, law, memory)
    feed_back(terms, law, memory, scratch)
    if flying and not memory.flying[()]:
        lift_off(terms, memory)
    memory.flying[()] = flying
    elapsed, left = float(now.time_in_phase[()]), float(now.time_to_touchdown[()])
    if law.predicts and flying:
        left = predict(plan, terms, elapsed, left, prediction, memory, scratch)
    reach = float(settings.reach_share[0]) * max(elapsed + left, law.period)
    share, rate, _ = minimum_jerk(elapsed / reach)
    drawn_in = float(settings.retraction[0])
    if plan.toes_first[()]:
        drawn_in = 0.0  # the plan itself draws the feet in
    lift, lift_rate = retraction(left, drawn_in, float(settings.retraction_time[0]))
    lowest, lead = lowest_height(terms.foot_position), float(settings.lead_time[0])
    turn_frame(plan, terms, settings, overdue, memory, scratch)
    if law.turned:
        turn_places(law.stance, yaw(memory.orientation), scratch.centre)
    for foot in range(law.side.shape[0]):
        place, speed = scratch.place[foot], scratch.speed
        choose_place(foot, law, settings, memory, targets.landing[foot], scratch)
        for k in range(3):
            speed[k] = float(plan.foot_velocity[foot, k]) - float(plan.com_velocity[k])
            if overdue:
                speed[k] = 0.0
            else:
                memory.swing[foot, k] = speed[k]
        if flying:
            swing(
                memory.planned[foot], targets.landing[foot], memory.offset[foot], share,
                rate / reach, place, speed,
            )  # fmt: skip
            if law.predicts:
                apply_lead(memory.swing[foot], lead * share, lead * rate / reach, place, speed)
            place[2] = float(place[2]) + lift
            speed[2] = float(speed[2]) + lift_rate
            for k in range(3):
                memory.goal[foot, k] = float(terms.com[k]) + float(targets.landing[foot, k])
        elif landing:
            for k in range(2):
                place[k] = float(memory.goal[foot, k]) - float(terms.com[k])
            place[2] = lowest - float(terms.com[2])
            for k in range(3):
                speed[k] = -float(terms.com_velocity[k])
        else:
            for k in range(3):
                place[k] = memory.planned[foot, k]
        convert_to_body(foot, float(plan.foot_yaw[foot]), terms, targets, scratch)


@kernel
def find_origin(plan: Plan, terms: Terms, memory: Memory) -> None:
    """Note the place of the plan in the world, by the middle of the feet."""
    n = memory.offset.shape[0]
    for k in range(3):
        for foot in range(n):
            off = float(terms.foot_position[foot, k]) - float(plan.foot_position[foot, k])
            memory.origin[k] = float(memory.origin[k]) + off / n
    memory.started[()] = True


@kernel
def remember_landing(plan: Plan, flying: bool, memory: Memory) -> None:
    """Keep where the centre of mass should touch down, before the plan names the next jump."""
    if not flying:
        memory.lift_off_time[()] = plan.lift_off_time[()]
    elif float(plan.lift_off_time[()]) != float(memory.lift_off_time[()]):
        return
    fall = float(plan.touchdown_time[()]) - float(plan.time[()])
    if flying and fall < 0.0:
        return
    for k in range(3):
        place = float(plan.com_velocity[k]) * fall + float(plan.com[k])
        memory.wished[k] = place + float(memory.origin[k])


@kernel
def remember_plan(plan: Plan, terms: Terms, law: Law, memory: Memory) -> None:
    """Keep the plan of this instant."""
    mass = float(terms.mass_matrix[0, 0])
    if mass == 0.0:
        mass = law.mass
    for k in range(3):
        memory.linear[k] = float(plan.com_velocity[k]) * mass
        memory.angular[k] = float(plan.angular_momentum[k]) * (mass / law.mass)
        for foot in range(memory.planned.shape[0]):
            memory.planned[foot, k] = float(plan.foot_position[foot, k]) - float(plan.com[k])
    for k in range(4):
        memory.orientation[k] = plan.orientation[k]


@kernel
def feed_back(terms: Terms, law: Law, memory: Memory, scratch: Scratch) -> None:
    """Compute the momenta that the law feeds back."""
    for k in range(3):
        scratch.linear[k] = terms.linear_momentum[k]
        scratch.angular[k] = terms.angular_momentum[k]
        if law.deviates:
            scratch.linear[k] = float(scratch.linear[k]) - float(memory.linear[k])
            scratch.angular[k] = float(scratch.angular[k]) - float(memory.angular[k])


@kernel
def lift_off(terms: Terms, memory: Memory) -> None:
    """Begin a flight: note how far the feet are from their plan."""
    memory.due[()] = 0.0
    for k in range(4):
        memory.shift[k] = 0.0
    for foot in range(memory.offset.shape[0]):
        for k in range(3):
            place = float(terms.foot_position[foot, k]) - float(terms.com[k])
            memory.offset[foot, k] = place - float(memory.planned[foot, k])


@kernel
def predict(
    plan: Plan,
    terms: Terms,
    elapsed: float,
    left: float,
    prediction: Prediction,
    memory: Memory,
    scratch: Scratch,
) -> float:
    """Choose the shift; returns the time [s] to a touchdown with the legs that much shorter.

    ``left`` is the time to touchdown with the planned legs, which ends at zero. Shorter legs fall on.
    """
    if left > 0.0:
        memory.due[()] = elapsed + left
    left = float(memory.due[()]) - elapsed
    for k in range(3):
        place = float(terms.com_velocity[k]) * left + float(terms.com[k])
        scratch.miss[k] = place - float(memory.wished[k])
    speed = max(GRAVITY * left - float(terms.com_velocity[2]), _SLOWEST)
    later = fall_time(speed, float(memory.shift[3]))
    if left + later >= LAST:
        choose_shift_of_feet(
            terms, plan.foot_yaw, memory.planned, memory.orientation, scratch.linear,
            scratch.angular, scratch.miss, left, float(memory.due[()]), speed, prediction,
            memory.shift,
        )  # fmt: skip
        later = fall_time(speed, float(memory.shift[3]))
    return max(left + later, 0.0)


@kernel
def fall_time(speed: float, height: float) -> float:
    """The time [s] in which a body falls by ``height`` [m] from the downward ``speed`` [m/s].

    For a negative height it is that since the body was so much higher, at the latest its apex.
    """
    square = speed * speed + 2.0 * GRAVITY * height
    return (math.sqrt(max(square, 0.0)) - speed) / GRAVITY


@kernel
def choose_place(
    foot: int, law: Law, settings: Settings, memory: Memory, place: Array1D, scratch: Scratch
) -> None:
    """The landing ``place`` (3,) of a foot from the centre of mass, by the law."""
    planned, side = memory.planned[foot], float(law.side[foot])
    if law.predicts:
        shift = memory.shift
        place[0] = float(planned[0]) + float(shift[0])
        place[1] = float(planned[1]) + (float(shift[1]) + side * float(shift[2]))
        place[2] = float(planned[2]) + float(shift[3])
        keep_within(settings.p_max, scratch.centre[foot], place)
        return
    landing_place(
        planned, side, scratch.linear, scratch.angular, settings.w_l, settings.w_k,
        float(settings.w_c[0]), settings.p_max, scratch.centre[foot], place,
    )  # fmt: skip


@kernel
def turn_frame(
    plan: Plan, terms: Terms, settings: Settings, overdue: bool, memory: Memory, scratch: Scratch
) -> None:
    """Compute the frame that the targets are fixed in, its rate, and the CoM in the body."""
    alpha = settings.alpha
    if plan.toes_first[()]:
        alpha = settings.toes_alpha
    planned, turn, vector = memory.orientation, scratch.turn, scratch.vector
    from_matrix(terms.base_rotation, scratch.quaternion)
    conjugate(planned, turn)
    multiply(turn, scratch.quaternion, turn)
    logarithm(turn, vector)
    for k in range(3):
        vector[k] = float(vector[k]) * float(alpha[k])
    exponential(vector, turn)
    multiply(planned, turn, turn)
    to_matrix(turn, scratch.rotation)
    for k in range(3):
        share = float(alpha[k])
        scratch.rate[k] = float(terms.velocity[3 + k]) * share
        if not overdue:
            kept = float(plan.angular_velocity[k]) * (1.0 - share)
            scratch.rate[k] = float(scratch.rate[k]) + kept
        vector[k] = float(terms.com[k]) - float(terms.base_position[k])
    multiply_vector(terms.base_rotation.T, vector, scratch.com_body)


@kernel
def convert_to_body(
    foot: int, heading: float, terms: Terms, targets: Targets, scratch: Scratch
) -> None:
    """Convert place and speed relative to the CoM into those relative to the base; turn the sole."""
    turn, velocity = scratch.rotation.T, targets.velocity[foot]
    vector, spare, com = scratch.vector, scratch.spare, scratch.com_body
    multiply_vector(turn, scratch.place[foot], vector)
    for k in range(3):
        targets.position[foot, k] = float(com[k]) + float(vector[k])
    multiply_vector(turn, scratch.speed, velocity)
    cross(scratch.rate, vector, spare)
    for k in range(3):
        velocity[k] = float(velocity[k]) - float(spare[k])
    multiply_vector(terms.base_rotation.T, terms.com_velocity, spare)
    for k in range(3):
        velocity[k] = float(velocity[k]) + float(spare[k]) - float(terms.velocity[k])
    cross(terms.velocity[3:6], com, spare)
    for k in range(3):
        velocity[k] = float(velocity[k]) - float(spare[k])
    heading_matrix(heading, scratch.heading)
    multiply_matrices(turn, scratch.heading, targets.rotation[foot])
