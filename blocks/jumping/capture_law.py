"""What ``CaptureStep`` does in every tick, as kernels: whether, where and how a foot steps."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array,
    Array0D,
    Array1D,
    Array2D,
    Array3D,
    Flags,
    Flags1D,
    Indices,
    Indices0D,
    Indices1D,
    Rows3,
    Vector3,
)
from ...mathematics.capture_step import (
    capture_point,
    choose_foothold,
    farthest_foot,
    limit_foothold,
    spread_to_feet,
    support_margin,
    swing_points,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import mean_heading
from ..signals import Phase

_EARLIEST, _LATEST = 0.6, 1.5
"""The share of a step's duration after which a contact ends it, and that at which it ends anyway."""
_AIMED = 0.25
"""The last share of a step in which the foothold stays as it is."""
_NEARER = 0.005
"""A foot is preferred if it comes nearer to its foothold by more than this [m]."""
_LANDING, _RECOVER = int(Phase.LANDING), int(Phase.RECOVER)


class PhaseFields(NamedTuple):
    """The fields of ``PhaseState``."""

    phase: Indices0D
    time_in_phase: Array0D
    time_to_touchdown: Array0D
    time_since_touchdown: Array0D
    stance: Flags1D
    stepping: Flags1D
    step_acceleration: Rows3


class Terms(NamedTuple):
    """The fields of ``DynamicsTerms`` that tell how the robot moves and where its feet are."""

    com: Vector3
    com_velocity: Vector3
    angular_momentum: Vector3
    mass_matrix: Array2D
    contact_position: Rows3
    contact_velocity: Rows3
    foot_position: Rows3
    foot_rotation: Array3D


class Memory(NamedTuple):
    """The fields of ``StepMemory``."""

    foot: Indices0D
    elapsed: Array0D
    taken: Indices0D
    outside: Array0D
    last: Array0D
    ground: Array0D
    heading: Array0D
    foothold: Rows3


class Settings(NamedTuple):
    """The parameters of ``CaptureStep``: arrays of one element, ``apart`` of two."""

    steps: Indices1D
    margin: Array1D
    confirmation: Array1D
    after: Array1D
    turn: Array1D
    duration: Array1D
    height: Array1D
    beyond: Array1D
    reach: Array1D
    apart: Array1D
    settle: Array1D
    flat: Array1D


class Feet(NamedTuple):
    """The robot's feet.

    ``foot_of_point`` (n_contacts,); the ``side`` of each foot, 1, -1 or 0, and its distance ``apart`` from
    the others in standing [m], (n_feet,); the points from their soles, ``offset`` (n_contacts, 3) [m];
    the ``mass`` of the description [kg], and the ``period`` of a tick [s].
    """

    foot_of_point: Indices1D
    side: Array1D
    apart: Array1D
    offset: Rows3
    mass: float
    period: float


class Scratch(NamedTuple):
    """``capture``, ``nearest`` and ``other`` (2,), ``middle`` (3,), ``standing`` (n_contacts,), and ``all``
    (n_feet,), which is true."""

    capture: Array1D
    nearest: Array1D
    other: Array1D
    middle: Array1D
    standing: Flags1D
    all: Flags1D


@kernel
def take_steps(
    before: PhaseFields,
    time: Array0D,
    lift_off_time: Array0D,
    terms: Terms,
    settings: Settings,
    feet: Feet,
    memory: Memory,
    out: PhaseFields,
    scratch: Scratch,
) -> None:
    """One tick of ``CaptureStep``; ``time`` () and ``lift_off_time`` () are the plan's [s]."""
    phase = before.phase[()]
    out.phase[()] = phase
    out.time_in_phase[()] = before.time_in_phase[()]
    out.time_to_touchdown[()] = before.time_to_touchdown[()]
    out.time_since_touchdown[()] = before.time_since_touchdown[()]
    for i in range(before.stance.shape[0]):
        out.stance[i] = before.stance[i]
        out.stepping[i] = False
        out.step_acceleration[i, :] = 0.0
    lands = phase in (_LANDING, _RECOVER)
    goes_on = lift_off_time[()] > time[()]
    if not lands or goes_on or feet.side.shape[0] < 2:
        memory.foot[()] = 0
        memory.taken[()] = 0
        memory.outside[()] = 0.0
        return
    rate = find_capture_point(before, terms, settings, feet, memory, scratch)
    if memory.foot[()] == 0:
        judge_support(before, terms, settings, feet, memory, scratch, rate)
    if memory.foot[()] > 0:
        swing_foot(before, terms, settings, feet, memory, out, scratch, rate)
    hold_low(before, settings, memory, out, phase)


@kernel
def find_capture_point(
    before: PhaseFields,
    terms: Terms,
    settings: Settings,
    feet: Feet,
    memory: Memory,
    scratch: Scratch,
) -> float:
    """Compute the capture point; returns the pendulum's frequency [1/s]."""
    any_stance = False
    for i in range(before.stance.shape[0]):
        any_stance = any_stance or bool(before.stance[i])
    ground, count = 0.0, 0
    for i in range(before.stance.shape[0]):
        if before.stance[i] or not any_stance:
            ground += terms.contact_position[i, 2]
            count += 1
    ground /= count
    if memory.foot[()] == 0:
        memory.ground[()] = ground
    mass = terms.mass_matrix[0, 0]
    return capture_point(
        terms.com, terms.com_velocity, terms.angular_momentum,
        mass if mass != 0.0 else feet.mass, float(terms.com[2]) - ground,
        float(settings.turn[0]), scratch.capture,
    )  # fmt: skip


@kernel
def judge_support(
    before: PhaseFields,
    terms: Terms,
    settings: Settings,
    feet: Feet,
    memory: Memory,
    scratch: Scratch,
    rate: float,
) -> None:
    """Begin a step where the capture point has been outside the support for long enough."""
    n_feet = feet.side.shape[0]
    stands = spread_to_feet(before.stance, feet.foot_of_point, n_feet, scratch.standing)
    margin = support_margin(
        terms.contact_position, scratch.standing, scratch.capture[0],
        scratch.capture[1],
    )  # fmt: skip
    since = before.time_since_touchdown[()]
    if stands < n_feet or since < settings.after[0] or margin > -settings.margin[0]:
        memory.outside[()] = 0.0
        return
    memory.outside[()] = memory.outside[()] + feet.period
    short = memory.outside[()] < settings.confirmation[0]
    if memory.taken[()] >= settings.steps[0] or short:
        return
    if memory.taken[()] == 0:
        memory.heading[()] = mean_heading(terms.foot_rotation, scratch.all)
    memory.foot[()] = 1 + best_foot(terms, settings, feet, memory, scratch, rate)
    memory.elapsed[()] = 0.0
    memory.outside[()] = 0.0


@kernel
def best_foot(
    terms: Terms, settings: Settings, feet: Feet, memory: Memory, scratch: Scratch, rate: float
) -> int:
    """The foot that comes nearest to its foothold; of equals the one that carries least."""
    n_feet, best, least = feet.side.shape[0], 0, math.inf
    first = farthest_foot(
        terms.contact_position, feet.foot_of_point, n_feet, scratch.capture, scratch.other
    )
    for number in range(n_feet):
        foot = (first + number) % n_feet
        left = settings.duration[0]
        missing = aim_step(terms, settings, feet, memory, scratch, foot, rate, left)
        if missing < least - _NEARER:
            best, least = foot, missing
    return best


@kernel
def aim_step(
    terms: Terms,
    settings: Settings,
    feet: Feet,
    memory: Memory,
    scratch: Scratch,
    foot: int,
    rate: float,
    left: float,
) -> float:
    """Choose the foothold of a foot that has ``left`` seconds to go; returns how far it is from where
    it should be [m]."""
    place, n_feet, middle = memory.foothold[foot], feet.side.shape[0], scratch.middle
    choose_foothold(
        scratch.capture, rate, left, settings.beyond[0], terms.contact_position,
        feet.foot_of_point, foot, n_feet, scratch.nearest, scratch.other, place,
    )  # fmt: skip
    wanted_x, wanted_y = place[0], place[1]
    for k in range(3):
        middle[k] = 0.0
        for other in range(n_feet):
            if other != foot:
                middle[k] = middle[k] + terms.foot_position[other, k] / (n_feet - 1)
    apart = feet.apart[foot]
    limit_foothold(
        middle, memory.heading[()], feet.side[foot], settings.reach[0],
        settings.apart[0] * apart, settings.apart[1] * apart, place,
    )  # fmt: skip
    x, y = place[0] - wanted_x, place[1] - wanted_y
    return math.sqrt(x * x + y * y)


@kernel
def swing_foot(
    before: PhaseFields,
    terms: Terms,
    settings: Settings,
    feet: Feet,
    memory: Memory,
    out: PhaseFields,
    scratch: Scratch,
    rate: float,
) -> None:
    """Move the foot of the step under way, or end the step."""
    foot, duration = memory.foot[()] - 1, settings.duration[0]
    elapsed = memory.elapsed[()] + feet.period
    memory.elapsed[()] = elapsed
    left = duration - elapsed
    touched = False
    for i in range(before.stance.shape[0]):
        if feet.foot_of_point[i] == foot and before.stance[i]:
            touched = True
    if (touched and elapsed > _EARLIEST * duration) or elapsed > _LATEST * duration:
        memory.foot[()] = 0
        memory.taken[()] = memory.taken[()] + 1
        memory.last[()] = before.time_since_touchdown[()]
        return
    if left > _AIMED * duration:
        aim_step(terms, settings, feet, memory, scratch, foot, rate, left)
    place = memory.foothold[foot]
    place[2] = memory.ground[()]
    swing_points(
        foot, feet.foot_of_point, feet.offset, place, memory.heading[()], elapsed, duration,
        settings.height[0], terms.contact_position, terms.contact_velocity, out.stance,
        out.stepping, out.step_acceleration,
    )  # fmt: skip
    leave_hovering(
        terms.contact_position, feet.foot_of_point, settings.flat[0], out.stance,
        scratch.standing,
    )  # fmt: skip


@kernel
def leave_hovering(
    position: Array, foot_of_point: Indices, flat: float, stance: Flags, standing: Flags
) -> None:
    """Take points out of the ``stance`` that are higher than the lowest point of their foot in it by
    more than ``flat`` [m]; ``standing`` is scratch, and all are (n_contacts,)."""
    n = stance.shape[0]
    for i in range(n):
        standing[i] = stance[i]
        for j in range(n):
            if foot_of_point[j] == foot_of_point[i] and stance[j]:
                low = float(position[j, 2])
                standing[i] = standing[i] and float(position[i, 2]) <= low + flat
    for i in range(n):
        stance[i] = standing[i]


@kernel
def hold_low(
    before: PhaseFields, settings: Settings, memory: Memory, out: PhaseFields, phase: int
) -> None:
    """Stay in LANDING while the robot steps and until it has settled."""
    stepping = memory.foot[()] > 0
    if (not stepping and memory.taken[()] == 0) or phase != _RECOVER:
        return
    since = before.time_since_touchdown[()]
    risen = since - memory.last[()] - settings.settle[0]
    if stepping or risen < 0.0:
        out.phase[()] = _LANDING
        out.time_in_phase[()] = since
    else:
        out.time_in_phase[()] = min(before.time_in_phase[()], risen)
