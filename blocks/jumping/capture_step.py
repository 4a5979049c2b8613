"""Steps after touchdown, where the feet no longer support the robot."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.arrays import Array1D, Array2D, Flags1D, Indices1D
from ...mathematics.capture_step import (
    approach,
    capture_point,
    farthest_foot,
    limit_foothold,
    nearest_in_foot,
    spread_to_feet,
    support_margin,
)
from ...mathematics.elementary import exp, sincos
from ...mathematics.kernel import kernel
from ...mathematics.rotations import mean_heading
from ...mathematics.stance_feet import has_contact
from ...robots.kinematics import foot_sides, standing_feet
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, Phase, PhaseState

_EARLIEST, _LATEST = 0.6, 1.5
"""The share of a step's duration after which a contact ends it, and that at which it ends anyway."""
_AIMED = 0.25
"""The last share of a step in which the foothold stays as it is."""
_NEARER = 0.005
"""A foot is preferred if it comes nearer to its foothold by more than this [m]."""
_SHORTEST = 0.03
"""The motion of a foot counts on at least this much time [s], which limits its feedback gains."""
LATE_STIFFNESS, LATE_DAMPING = 3000.0, 110.0
"""Gains [1/s^2, 1/s] of a foot that the plan lands after others, towards the plan; those of points without load of the
whole-body controller (``ContactGains``)."""


class StepParams(Parameters):
    """The parameters of ``CaptureStep``."""

    steps: int = live_parameter(0, ge=0, le=20, text="the most steps it takes; 0: it only stands")
    margin: float = live_parameter(
        0.015,
        unit="m",
        ge=0.0,
        text="least distance of the capture point outside the support for a step",
    )
    confirmation: float = live_parameter(
        0.006, unit="s", ge=0.0, text="time for which it must be there"
    )
    after: float = live_parameter(
        0.08, unit="s", ge=0.0, text="time after touchdown before which no foot steps"
    )
    turn: float = live_parameter(
        1.0, ge=0.0, le=1.0, text="share of the angular momentum that counts"
    )
    duration: float = live_parameter(0.13, unit="s", gt=0.04, le=1.0, text="of a step")
    height: float = live_parameter(
        0.015, unit="m", gt=0.0, le=0.2, text="height to which the foot is lifted"
    )
    beyond: float = live_parameter(
        0.1, ge=0.0, le=1.0, text="share by which the foot goes farther than the capture point"
    )
    reach: float = live_parameter(
        0.2, unit="m", gt=0.0, text="farthest place ahead of or behind the other feet"
    )
    apart: tuple[float, float] = live_parameter(
        (0.6, 1.8), text="least and largest distance aside, in distances of the standing feet"
    )
    settle: float = live_parameter(
        0.35, unit="s", ge=0.0, text="time from a step until the robot rises again"
    )
    flat: float = live_parameter(
        0.0005,
        unit="m",
        ge=0.0,
        text="height up to which the other points of a foot carry load while another foot steps",
    )
    seek_speed: float = live_parameter(
        1.0, unit="m/s", ge=0.0, le=2.0,
        text="downward speed of a foot that has not touched after the touchdown of another; 0: it is "
        "left to its inverse kinematics",
    )  # fmt: skip
    seek_damping: float = live_parameter(
        20.0, unit="1/s", ge=0.0, le=500.0, text="gain on the error of that speed"
    )


class StepMemory(Signal):
    """The state of ``CaptureStep``."""

    foot = Field(dtype="int64", text="the foot that steps, counted from 1; 0 for none")
    elapsed = Field(unit="s", text="duration of the step so far")
    taken = Field(dtype="int64", text="steps taken so far")
    outside = Field(unit="s", text="time since the capture point left the support")
    last = Field(unit="s", text="time after touchdown at which the last step ended")
    ground = Field(unit="m", frame="world", text="height of the ground under the stepping foot")
    heading = Field(
        unit="rad", frame="world", text="mean heading of the feet before the first step"
    )
    foothold = Field(("n_feet", 3), unit="m", frame="world", text="last foothold of each foot")


class StepConstants(Signal):
    """Data of the robot that steps depend on."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    side = Field("n_feet", unit="", text="1: the foot is on the left, -1: right, 0: in the middle")
    apart = Field("n_feet", unit="m", text="distance aside from the other feet in standing")
    offset = Field(("n_contacts", 3), unit="m", frame="body", text="the points from their soles")
    all = Field("n_feet", dtype="bool", text="true")
    mass = Field(unit="kg", text="that of the description")
    period = Field(unit="s", text="of a tick")


class StepScratch(Signal):
    """Intermediate values of a tick."""

    capture = Field(2, unit="m", frame="world", text="the capture point")
    nearest = Field(2, unit="m", frame="world", text="nearest point of the other feet")
    other = Field(2, unit="m", frame="world", text="for a moment")
    middle = Field(3, unit="m", frame="world", text="of the other feet")
    standing = Field("n_contacts", dtype="bool", text="points of feet that stand")


class CaptureStep(Block):
    """Takes a step after touchdown, or several, where the feet can no longer hold the robot.

    It passes the phase on unchanged unless a foot steps. After the last planned touchdown it
    computes in every tick the capture point xi of the linear inverted pendulum
    (``mathematics/capture_step``)::

        xi = c + c' / w + turn (k_y, -k_x) w / (m g),    w^2 = g / (c_z - ground)

    A foot steps where xi has been outside the support polygon by more than ``margin`` for
    ``confirmation``, at the earliest ``after`` touchdown, while all feet stand, and ``steps`` times
    at most. The support polygon is that of all points of the feet.

    **Where.** While the foot is in the air the others push at p, where they are nearest to xi, and
    xi runs away from there. The foot goes to where xi will be as it lands, and a share farther::

        foothold = p + (1 + beyond) (xi - p) exp(w left)

    It stays within ``reach`` ahead of and behind the other feet and, in multiples of their distance
    in standing, within ``apart`` to its own side of them, so that the legs do not cross. The
    foothold is computed anew in every tick until the last quarter of the step. The foot that steps
    is the one for which these limits change the foothold least, so in a fall sideways the foot on
    that side, though it carries the robot; of equals it is the one farther from xi.

    **How.** The points of the foot leave the stance and get an acceleration, which is that of the
    motion of least mean square acceleration from where they are to their place, with a flat sole
    and the heading that the feet had before the first step. The whole-body controller follows it as
    a task and computes the torques of both legs (``ContactPoints``), so the leg's reaction on the
    body is taken into account. Of the feet that stand meanwhile, points more than ``flat`` above the
    lowest of their foot are not in stance: the controller would rely on the friction of a heel that
    hovers, and the foot would turn on its toe. The step ends with the first contact after 0.6 of ``duration``, or
    after 1.5 of it. The robot stays in LANDING, low, until ``settle`` after the last step, and then
    recovers.

    **Seeking the ground.** With ``seek_speed`` v a foot without a point in stance in LANDING, while others
    stand, goes on down: its points get the acceleration d (-v e_z - p'), with d the ``seek_damping`` and p'
    their velocity. It is a task of the whole-body controller, like a step: driven by its joints alone the
    leg turns the torso by 20 degrees where one foot lands 2 cm higher than the other. It counts as no step.
    A foot that the plan lands after others follows the plan until then: its velocity, and its height above the
    lowest point that stands.

    The block plans one step at a time, on level ground, and does not return the feet to where they
    stood. A robot with a single foot takes none.
    """

    Params = StepParams
    Constants = StepConstants
    Scratch = StepScratch
    needs = ("feet",)
    params: StepParams
    constants: StepConstants
    before = Input(PhaseState, text="the phase and the stance points by plan and contacts")
    reference = Input(JumpReference, text="the plan, for whether another jump follows")
    terms = Input(DynamicsTerms, text="the present state")
    phase = Output(PhaseState, text="the same, with the steps")
    memory = State(StepMemory, text="the step under way, and those taken")

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        stance = standing_feet(robot)
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.side[:] = foot_sides(stance)
        constants.all[:] = True
        constants.mass, constants.period = robot.total_mass, self.period
        for foot, place in enumerate(stance):
            others = np.delete(stance, foot, axis=0)
            if len(others):
                constants.apart[foot] = abs(float(place[1]) - float(others[:, 1].mean()))
        for k, (point, foot) in enumerate(
            zip(robot.contacts, robot.foot_of_contact(), strict=True)
        ):
            constants.offset[k] = np.array(point.position) - np.array(robot.feet[foot].sole)

    @kernel
    @staticmethod
    def step(
        before: PhaseState,
        reference: JumpReference,
        terms: DynamicsTerms,
        phase: PhaseState,
        memory: StepMemory,
        params: StepParams,
        constants: StepConstants,
        scratch: StepScratch,
    ) -> None:
        phase.phase = before.phase
        phase.time_in_phase = before.time_in_phase
        phase.time_to_touchdown = before.time_to_touchdown
        phase.time_since_touchdown = before.time_since_touchdown
        phase.stance[:] = before.stance
        phase.stepping[:] = False
        phase.step_acceleration[:] = 0.0
        lands = before.phase == Phase.LANDING or before.phase == Phase.RECOVER
        goes_on = reference.lift_off_time > reference.time
        if params.seek_speed > 0.0 and before.phase == Phase.LANDING:
            seek_ground(before, reference, terms, params, constants, phase)
        if not lands or goes_on or constants.side.shape[0] < 2:
            memory.foot = 0
            memory.taken = 0
            memory.outside = 0.0
            return
        rate = find_capture_point(before, terms, params, constants, memory, scratch)
        if memory.foot == 0:
            judge_support(before, terms, params, constants, memory, scratch, rate)
        if memory.foot > 0:
            swing_foot(before, terms, params, constants, memory, phase, scratch, rate)
        hold_low(before, params, memory, phase, before.phase)


@kernel
def seek_ground(
    before: PhaseState,
    reference: JumpReference,
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    out: PhaseState,
) -> None:
    """Move the feet down that have not touched yet, while another one stands; as in the plan while that lands them later.

    As tasks of the whole-body controller, so that it knows how the moving leg pushes the torso.
    """
    count, any_stance, any_planned = constants.foot_of_point.shape[0], False, False
    ground, planned_ground = math.inf, math.inf
    for i in range(count):
        if before.stance[i]:
            any_stance, ground = True, min(ground, terms.contact_position[i, 2])
        if reference.contact[i]:
            place = reference.foot_position[constants.foot_of_point[i], 2]
            any_planned, planned_ground = True, min(planned_ground, place)
    for i in range(count):
        foot = constants.foot_of_point[i]
        if not any_stance or has_contact(before.stance, constants.foot_of_point, foot):
            continue
        out.stepping[i] = True
        if any_planned and not has_contact(reference.contact, constants.foot_of_point, foot):
            for k in range(3):
                error = reference.foot_velocity[foot, k] - terms.contact_velocity[i, k]
                out.step_acceleration[i, k] = LATE_DAMPING * error
            height = reference.foot_position[foot, 2] - planned_ground
            height -= terms.contact_position[i, 2] - ground
            out.step_acceleration[i, 2] += LATE_STIFFNESS * height
            continue
        for k in range(3):
            speed = terms.contact_velocity[i, k]
            if k == 2:
                speed += params.seek_speed
            out.step_acceleration[i, k] = -params.seek_damping * speed


@kernel
def find_capture_point(
    before: PhaseState,
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    scratch: StepScratch,
) -> float:
    """Compute the capture point; returns the pendulum's frequency [1/s]."""
    any_stance = False
    for i in range(before.stance.shape[0]):
        any_stance = any_stance or before.stance[i]
    ground, count = 0.0, 0
    for i in range(before.stance.shape[0]):
        if before.stance[i] or not any_stance:
            ground += terms.contact_position[i, 2]
            count += 1
    ground /= count
    if memory.foot == 0:
        memory.ground = ground
    mass = terms.mass_matrix[0, 0]
    return capture_point(
        terms.com, terms.com_velocity, terms.angular_momentum,
        mass if mass != 0.0 else constants.mass, terms.com[2] - ground,
        params.turn, scratch.capture,
    )  # fmt: skip


@kernel
def judge_support(
    before: PhaseState,
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    scratch: StepScratch,
    rate: float,
) -> None:
    """Begin a step where the capture point has been outside the support for long enough."""
    n_feet = constants.side.shape[0]
    stands = spread_to_feet(before.stance, constants.foot_of_point, n_feet, scratch.standing)
    margin = support_margin(
        terms.contact_position, scratch.standing, scratch.capture[0],
        scratch.capture[1],
    )  # fmt: skip
    since = before.time_since_touchdown
    if stands < n_feet or since < params.after or margin > -params.margin:
        memory.outside = 0.0
        return
    memory.outside = memory.outside + constants.period
    short = memory.outside < params.confirmation
    if memory.taken >= params.steps or short:
        return
    if memory.taken == 0:
        memory.heading = mean_heading(terms.foot_rotation, constants.all)
    memory.foot = 1 + best_foot(terms, params, constants, memory, scratch, rate)
    memory.elapsed = 0.0
    memory.outside = 0.0


@kernel
def best_foot(
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    scratch: StepScratch,
    rate: float,
) -> int:
    """Return the foot that comes nearest to its foothold; of equals the one that carries least."""
    n_feet, best, least = constants.side.shape[0], 0, math.inf
    first = farthest_foot(
        terms.contact_position, constants.foot_of_point, n_feet, scratch.capture, scratch.other
    )
    for number in range(n_feet):
        foot = (first + number) % n_feet
        left = params.duration
        missing = aim_step(terms, params, constants, memory, scratch, foot, rate, left)
        if missing < least - _NEARER:
            best, least = foot, missing
    return best


@kernel
def aim_step(
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    scratch: StepScratch,
    foot: int,
    rate: float,
    left: float,
) -> float:
    """Choose the foothold of a foot that has ``left`` seconds to go; returns how far it is from where
    it should be [m]."""
    place, n_feet, middle = memory.foothold[foot], constants.side.shape[0], scratch.middle
    choose_foothold(terms, params, constants, scratch, foot, rate, left, place)
    chosen_x, chosen_y = place[0], place[1]
    for k in range(3):
        middle[k] = 0.0
        for other in range(n_feet):
            if other != foot:
                middle[k] = middle[k] + terms.foot_position[other, k] / (n_feet - 1)
    apart = constants.apart[foot]
    limit_foothold(
        middle, memory.heading, constants.side[foot], params.reach,
        params.apart[0] * apart, params.apart[1] * apart, place,
    )  # fmt: skip
    x, y = place[0] - chosen_x, place[1] - chosen_y
    return math.sqrt(x * x + y * y)


@kernel
def choose_foothold(
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    scratch: StepScratch,
    foot: int,
    rate: float,
    left: float,
    out: Array1D,
) -> None:
    """Find where a foot should land: at the capture point of that instant, and ``beyond``.

    The force is taken to act where the other feet are nearest to the capture point.

    Args:
        rate: the pendulum's frequency [1/s].
        left: time until the foot lands [s].
        out: becomes the foothold; its height stays, (3,).
    """
    capture, nearest, other = scratch.capture, scratch.nearest, scratch.other
    least = math.inf
    for standing in range(constants.side.shape[0]):
        if standing == foot:
            continue
        distance = nearest_in_foot(
            terms.contact_position, constants.foot_of_point, standing, capture, other
        )
        if distance < least:
            least = distance
            nearest[:] = other
    grown = (1.0 + params.beyond) * exp(rate * left)
    for k in range(2):
        out[k] = nearest[k] + grown * (capture[k] - nearest[k])


@kernel
def swing_foot(
    before: PhaseState,
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    out: PhaseState,
    scratch: StepScratch,
    rate: float,
) -> None:
    """Move the foot of the step under way, or end the step."""
    foot, duration = memory.foot - 1, params.duration
    elapsed = memory.elapsed + constants.period
    memory.elapsed = elapsed
    left = duration - elapsed
    touched = False
    for i in range(before.stance.shape[0]):
        if constants.foot_of_point[i] == foot and before.stance[i]:
            touched = True
    if (touched and elapsed > _EARLIEST * duration) or elapsed > _LATEST * duration:
        memory.foot = 0
        memory.taken = memory.taken + 1
        memory.last = before.time_since_touchdown
        return
    if left > _AIMED * duration:
        aim_step(terms, params, constants, memory, scratch, foot, rate, left)
    memory.foothold[foot, 2] = memory.ground
    swing_points(terms, params, constants, memory, out, foot)
    leave_hovering(
        terms.contact_position, constants.foot_of_point, params.flat, out.stance,
        scratch.standing,
    )  # fmt: skip


@kernel
def swing_points(
    terms: DynamicsTerms,
    params: StepParams,
    constants: StepConstants,
    memory: StepMemory,
    out: PhaseState,
    foot: int,
) -> None:
    """Accelerate the points of a foot towards its foothold, with a flat sole.

    In the first half of the step the sole rises by ``height``. In the second it comes down as if the
    ground were lower by that, so it is still moving when it meets the ground.
    """
    sine, cosine = sincos(memory.heading)
    elapsed, duration, height = memory.elapsed, params.duration, params.height
    left = max(duration - elapsed, _SHORTEST)
    rises = elapsed < 0.5 * duration
    place, acceleration = memory.foothold[foot], out.step_acceleration
    position, velocity, offset = terms.contact_position, terms.contact_velocity, constants.offset
    for i in range(constants.foot_of_point.shape[0]):
        if constants.foot_of_point[i] != foot:
            continue
        out.stance[i], out.stepping[i] = False, True
        x = place[0] + cosine * offset[i, 0] - sine * offset[i, 1]
        y = place[1] + sine * offset[i, 0] + cosine * offset[i, 1]
        z, until = place[2] - height, left
        if rises:
            z = place[2] + height
            until = max(0.5 * duration - elapsed, _SHORTEST)
        acceleration[i, 0] = approach(position[i, 0], velocity[i, 0], x, left)
        acceleration[i, 1] = approach(position[i, 1], velocity[i, 1], y, left)
        acceleration[i, 2] = approach(position[i, 2], velocity[i, 2], z, until)


@kernel
def leave_hovering(
    position: Array2D, foot_of_point: Indices1D, flat: float, stance: Flags1D, standing: Flags1D
) -> None:
    """Take points out of the ``stance`` that are higher than the lowest point of their foot in it by
    more than ``flat`` [m]; ``standing`` is scratch, and all are (n_contacts,)."""
    n = stance.shape[0]
    for i in range(n):
        standing[i] = stance[i]
        for j in range(n):
            if foot_of_point[j] == foot_of_point[i] and stance[j]:
                low = position[j, 2]
                standing[i] = standing[i] and position[i, 2] <= low + flat
    for i in range(n):
        stance[i] = standing[i]


@kernel
def hold_low(
    before: PhaseState, params: StepParams, memory: StepMemory, out: PhaseState, phase: int
) -> None:
    """Stay in LANDING while the robot steps and until it has settled."""
    stepping = memory.foot > 0
    if (not stepping and memory.taken == 0) or phase != Phase.RECOVER:
        return
    since = before.time_since_touchdown
    risen = since - memory.last - params.settle
    if stepping or risen < 0.0:
        out.phase = Phase.LANDING
        out.time_in_phase = since
    else:
        out.time_in_phase = min(before.time_in_phase, risen)
