"""Computes from the momentum in flight where the feet should land."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import pydantic

from ...mathematics.arrays import Vector3
from ...mathematics.compiling.expressions import cross
from ...mathematics.constants import GRAVITY
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.landing_law import (
    apply_lead,
    heading_matrix,
    keep_within,
    landing_position,
    lowest_height,
    retraction,
    swing,
    turn_places,
)
from ...mathematics.rotations import (
    conjugate,
    exponential,
    from_matrix,
    logarithm,
    multiply,
    to_matrix,
    yaw,
)
from ...robots.kinematics import foot_sides, standing_feet
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, TwoNumbers, live_parameter, parameter
from ...runtime.language.signals import Field
from ..signals import DynamicsTerms, FootTarget, JumpReference, Phase, PhaseState
from .landing_prediction import (
    LAST,
    MOST_LEAD,
    PredictionConstants,
    PredictionGains,
    PredictionMemory,
    PredictionProgram,
    PredictionScratch,
    choose_shift_of_feet,
    describe_soles,
    prediction_program,
    scale_gains,
)

SLOWEST_DESCENT = 0.3
"""The least speed of descent [m/s] by which a change of the legs' length changes the time."""


def _three(value: object) -> object:
    """One number stands for all three axes."""
    return (value,) * 3 if isinstance(value, int | float) else value


Share = Annotated[float, pydantic.Field(ge=0.0, le=1.0)]
if TYPE_CHECKING:  # in a kernel this is an array
    Shares: TypeAlias = Any
else:
    Shares = Annotated[tuple[Share, Share, Share], pydantic.BeforeValidator(_three)]


class LandingParams(PredictionGains):
    """The parameters of ``LandingHeuristic``."""

    law: Literal["paper", "deviation", "predicted"] = parameter(
        "deviation",
        text="feed back the measured momentum, or its deviation from the plan; or predict",
    )
    w_l: TwoNumbers = live_parameter(
        (0.03, 0.04), unit="s/kg", text="W_l: metres per linear momentum along x and y"
    )
    w_k: TwoNumbers = live_parameter(
        (0.0, 0.0), unit="s/(kg m)", text="W_k: metres per angular momentum about y and x"
    )
    w_c: float = live_parameter(
        0.04, unit="s/kg", ge=0.0, text="W_c: sideways clearance per lateral momentum"
    )
    p_max: TwoNumbers = live_parameter(
        (0.15, 0.16), unit="m", text="farthest places ahead and aside the leg can reach"
    )
    limits_about: Literal["com", "stance"] = parameter(
        "com", text="the centre of the limits p_max: the centre of mass, or each foot's stance"
    )
    alpha: Shares = live_parameter(
        (1.0, 1.0, 1.0),
        text="share of the torso's rotation about x, y and z that the legs compensate",
    )
    toes_alpha: Shares = live_parameter(
        (0.8, 0.8, 0.8),
        text="the same share where the plan lands on the toes first",
    )
    reach_share: float = live_parameter(
        0.7, gt=0.0, le=1.0, text="share of the predicted flight by which the feet are there"
    )
    retraction: float = live_parameter(
        0.3, unit="m/s", ge=0.0, le=2.0, text="upward speed of the feet at touchdown"
    )
    retraction_time: float = live_parameter(
        0.06, unit="s", gt=0.0, text="time from its begin to touchdown"
    )


class LandingMemory(PredictionMemory):
    """The state of ``LandingHeuristic``."""

    flying = Field(dtype="bool", text="the robot flew at the last tick")
    offset = Field(
        ("n_feet", 3), unit="m", frame="world", text="feet at lift-off, measured minus planned"
    )
    goal = Field(("n_feet", 3), unit="m", frame="world", text="last aim of the feet")
    swing = Field(("n_feet", 3), unit="m/s", frame="world", text="their planned speed from the com")
    linear = Field(3, unit="kg m/s", frame="world", text="planned linear momentum")
    angular = Field(3, unit="N m s", frame="world", text="planned angular momentum")
    started = Field(dtype="bool", text="the plan's place in the world is known")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    lift_off_time = Field(unit="s", text="planned lift-off of the flight under way or next")


class LandingConstants(PredictionConstants):
    """Data of the robot that the law depends on."""

    side = Field("n_feet", unit="", text="1: the foot is on the left, -1: right, 0: in the middle")
    stance = Field(("n_feet", 3), unit="m", frame="body", text="feet from the com in standing")


class LandingScratch(PredictionScratch):
    """Intermediate values of the law."""

    place = Field(("n_feet", 3), unit="m", frame="world", text="of each foot from the com")
    centre = Field(("n_feet", 3), unit="m", frame="world", text="of the limits p_max, from the com")
    speed = Field(3, unit="m/s", frame="world", text="of the foot in hand from the com")
    turn = Field(4, unit="", text="of the frame in which the targets are fixed")
    rotation = Field((3, 3), unit="", text="the same as a matrix")
    rate = Field(3, unit="rad/s", text="angular velocity of that frame")
    com_body = Field(3, unit="m", frame="body", text="the com from the base")


class LandingHeuristic(Block):
    """Foot targets in flight from momentum feedback (paper, IV).

    All places are relative to the centre of mass, in world axes. The law, for each of any number
    of feet, with p_nom the planned foot and its side s = 1 on the left of the base, -1 on the
    right and 0 in the middle (the paper's (-1)^i):

        p^x = p_nom^x + W_l^x l^x + W_k^x k^y
        p^y = p_nom^y + W_l^y l^y + W_k^y k^x
        Delta y = W_c |l^y|
        p_des^x = p^x                   where |p^x - c^x| <= p_max^x, else at that limit
        p_des^y = p^y + s Delta y       likewise, of the sum, with p_max^y

    The limits are centred at c: the centre of mass with ``limits_about: com``, as in the paper;
    the foot's place below a standing robot with ``limits_about: stance``, for robots whose feet
    stand far from the centre of mass, such as quadrupeds.

    With ``law: paper`` l and k are the measured momenta. With ``law: deviation`` they are the
    measured momenta minus the planned ones: the planned footholds already fit the planned momentum,
    so feeding back the whole momentum of a forward jump would count it twice.

    With ``law: predicted`` the landing place is chosen anew in every tick: all feet are shifted ahead,
    to the left, apart and upwards by what costs least, counting the distance from the capture point,
    the change of the legs' length, and the tilt of the torso at touchdown that the momenta lead to.
    ``docs/landing.md`` has this law in full. p_max applies as above, but holds no foot back from its planned place:
    feet of a quadruped swing farther in a long jump, and the plan knows how far its legs reach.

    With ``lead_by: fall`` feet are ahead of their planned way by as much as the soles come down sooner than
    planned: a robot that lifts off too slowly, or whose toes point up, otherwise lands while its feet are still on
    the way to their place.

    The foot moves there from its position at lift-off, along x and y with minimum jerk over
    ``reach_share`` of the predicted flight. Its height follows the plan (paper, V), and near
    touchdown the foot moves upwards at the speed ``retraction``, to land softly.

    The target is rotated into the body's frame by R_ref Exp(alpha Log(R_ref' R)). With ``alpha`` 1
    it is fixed in the world, whatever the torso does; with 0 it is fixed in the planned body, as in
    the paper. The target of the sole is flat, with the planned heading.

    A plan that lands on the toes first (``reference.toes_first``) draws the feet in by itself, by a fast
    turn of torso against thighs. There is then no ``retraction``, and instead of ``alpha`` the legs
    compensate the share ``toes_alpha``: with all of it the legs would work against that turn whenever
    the torso is some milliseconds ahead of the plan or behind it.

    With z up a push along +x gives l^x > 0 and k^y > 0, and along +y l^y > 0 and k^x < 0, so the
    stabilising signs are W_l > 0, W_k^x > 0 and W_k^y < 0. In LANDING a foot that is still in the
    air moves on to its last target, at the height of the lowest sole; otherwise the target is the
    plan. In a flight that is longer than planned the plan stays at its last instant before
    touchdown. Whether a leg can reach the target is left to its inverse kinematics.
    """

    Params = LandingParams
    Constants = LandingConstants
    Scratch = LandingScratch
    needs = ("feet",)
    params: LandingParams
    constants: LandingConstants
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase and the time to touchdown")
    terms = Input(DynamicsTerms, text="the present state")
    feet = Output(FootTarget, text="targets of the feet, now and at touchdown")
    memory = State(LandingMemory, text="lift-off, and the plan as long as it lasts")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report limits within which the robot cannot stand."""
        robot = context.robot
        assert isinstance(params, LandingParams) and robot is not None
        if params.limits_about == "stance":
            return
        for foot, place in zip(robot.feet, standing_feet(robot), strict=True):
            x, y = abs(float(place[0])), abs(float(place[1]))
            if x > params.p_max[0] or y > params.p_max[1]:
                yield UnmetRequirement(
                    f"{foot.name} of {robot.name} stands {x:.3f} m ahead or behind and {y:.3f} m "
                    "beside the centre of mass, which is beyond p_max",
                    parameter="p_max",
                    expected="limits within which every foot stands",
                    found=f"({params.p_max[0]} m, {params.p_max[1]} m)",
                    fix="limits_about: stance",
                )
                return

    def setup(self) -> None:
        robot, stance = self.robot, standing_feet(self.robot)
        sides = foot_sides(stance)
        self.constants.side[:], self.constants.stance[:] = sides, stance
        self._height = -float(stance[:, 2].mean())
        self.program = prediction_program(robot)
        describe_soles(robot, sides, self.constants)

    def prepare(self) -> None:
        scale_gains(self.params, self._height, self.constants, self.program.cost)

    @kernel
    @staticmethod
    def step(
        phase: PhaseState,
        reference: JumpReference,
        terms: DynamicsTerms,
        feet: FootTarget,
        memory: LandingMemory,
        params: LandingParams,
        constants: LandingConstants,
        scratch: LandingScratch,
        program: PredictionProgram,
        period: float,
    ) -> None:
        flying, landing = phase.phase == Phase.FLIGHT, phase.phase == Phase.LANDING
        if not memory.started or reference.time < 0.0:  # the plan has not begun
            find_origin(reference, terms, memory)
        remember_touchdown(reference, flying, memory)
        overdue = flying and reference.phase > Phase.FLIGHT
        if not overdue:
            remember_plan(reference, terms, constants, memory)
        feed_back(terms, params, memory, scratch)
        if flying and not memory.flying:
            lift_off(terms, memory)
        memory.flying = flying
        elapsed, left = phase.time_in_phase, phase.time_to_touchdown
        if flying and params.law == "predicted":
            left = predict(reference, terms, phase, memory, params, constants, scratch, program)
        reach = params.reach_share * max(elapsed + left, period)
        share, rate, _ = minimum_jerk(elapsed / reach)
        drawn_in = params.retraction
        if reference.toes_first:
            drawn_in = 0.0  # the plan itself draws the feet in
        lift, lift_rate = retraction(left, drawn_in, params.retraction_time)
        lowest, lead = lowest_height(terms.foot_position), params.lead_time
        if params.lead_by == "fall":
            if flying and params.law == "predicted" and not overdue:
                memory.early = early_touchdown_offset(reference, terms, left, memory, scratch)
            lead += memory.early
        turn_frame(reference, terms, params, overdue, memory, scratch)
        if params.limits_about == "stance":
            turn_places(constants.stance, yaw(memory.orientation), scratch.centre)
        for foot in range(constants.side.shape[0]):
            place, speed = scratch.place[foot], scratch.speed
            choose_landing_position(foot, params, constants, memory, feet.landing[foot], scratch)
            speed[:] = reference.foot_velocity[foot] - reference.com_velocity
            if overdue:
                speed[:] = 0.0
            else:
                memory.swing[foot, :] = speed
            if flying:
                swing(
                    memory.planned[foot], feet.landing[foot], memory.offset[foot], share,
                    rate / reach, place, speed,
                )  # fmt: skip
                if params.law == "predicted":
                    apply_lead(memory.swing[foot], lead * share, lead * rate / reach, place, speed)
                place[2] += lift
                speed[2] += lift_rate
                memory.goal[foot, :] = terms.com + feet.landing[foot]
            elif landing:
                place[:2] = memory.goal[foot, :2] - terms.com[:2]
                place[2] = lowest - terms.com[2]
                speed[:] = -terms.com_velocity
            else:
                place[:] = memory.planned[foot]
            convert_to_body(foot, reference.foot_yaw[foot], terms, feet, scratch)


@kernel
def find_origin(plan: JumpReference, terms: DynamicsTerms, memory: LandingMemory) -> None:
    """Note the place of the plan in the world, by the middle of the feet."""
    n = memory.offset.shape[0]
    for foot in range(n):
        memory.origin[:] += (terms.foot_position[foot] - plan.foot_position[foot]) / n
    memory.started = True


@kernel
def remember_touchdown(plan: JumpReference, flying: bool, memory: LandingMemory) -> None:
    """Keep where the centre of mass should touch down, before the plan names the next jump."""
    if not flying:
        memory.lift_off_time = plan.lift_off_time
    elif plan.lift_off_time != memory.lift_off_time:
        return
    fall = plan.touchdown_time - plan.time
    if flying and fall < 0.0:
        return
    memory.planned_touchdown[:] = plan.com_velocity * fall + plan.com + memory.origin


@kernel
def remember_plan(
    plan: JumpReference, terms: DynamicsTerms, constants: LandingConstants, memory: LandingMemory
) -> None:
    """Keep the plan of this instant."""
    mass = terms.mass_matrix[0, 0]
    if mass == 0.0:
        mass = constants.mass
    memory.linear[:] = plan.com_velocity * mass
    memory.angular[:] = plan.angular_momentum * (mass / constants.mass)
    memory.planned[:] = plan.foot_position - plan.com
    memory.orientation[:] = plan.orientation


@kernel
def feed_back(
    terms: DynamicsTerms, params: LandingParams, memory: LandingMemory, scratch: LandingScratch
) -> None:
    """Compute the momenta that the law feeds back."""
    scratch.linear[:] = terms.linear_momentum
    scratch.angular[:] = terms.angular_momentum
    if params.law != "paper":
        scratch.linear[:] -= memory.linear
        scratch.angular[:] -= memory.angular


@kernel
def lift_off(terms: DynamicsTerms, memory: LandingMemory) -> None:
    """Begin a flight: note how far the feet are from their plan."""
    memory.flight_time = 0.0
    memory.early = 0.0
    memory.shift[:] = 0.0
    memory.offset[:] = terms.foot_position - terms.com - memory.planned


@kernel
def predict(
    plan: JumpReference,
    terms: DynamicsTerms,
    phase: PhaseState,
    memory: LandingMemory,
    params: LandingParams,
    constants: LandingConstants,
    scratch: LandingScratch,
    program: PredictionProgram,
) -> float:
    """Choose the shift; returns the time [s] to a touchdown with the legs that much shorter.

    The time to touchdown in ``phase`` is that with the planned legs, which ends at zero. Shorter legs
    fall on.
    """
    elapsed: float = phase.time_in_phase
    left: float = phase.time_to_touchdown
    if left > 0.0:
        memory.flight_time = elapsed + left
    left = memory.flight_time - elapsed
    scratch.miss[:] = terms.com_velocity * left + terms.com - memory.planned_touchdown
    speed = max(GRAVITY * left - terms.com_velocity[2], SLOWEST_DESCENT)
    scratch.fall_speed = speed
    later = fall_time(speed, memory.shift[3])
    if left + later >= LAST:
        choose_shift_of_feet(plan, terms, left, memory, params, constants, scratch, program)
        later = fall_time(speed, memory.shift[3])
    return max(left + later, 0.0)


@kernel
def early_touchdown_offset(
    plan: JumpReference,
    terms: DynamicsTerms,
    left: float,
    memory: LandingMemory,
    scratch: LandingScratch,
) -> float:
    """Return the lead of the soles' lowest point over its planned touchdown [s], at most ``MOST_LEAD``.

    ``left`` [s] is the time until soles that are level touch. The point of a sole that is not level is lower than
    its centre, by what the fall takes some milliseconds for.
    """
    if plan.lift_off_time != memory.lift_off_time:
        return float(memory.early)
    drop = lowest_height(terms.foot_position) - lowest_height(terms.contact_position)
    early = plan.touchdown_time - plan.time - left + drop / scratch.fall_speed
    return float(min(max(early, 0.0), MOST_LEAD))


@kernel
def fall_time(speed: float, height: float) -> float:
    """Return the time [s] in which a body falls by ``height`` [m] from the downward ``speed`` [m/s].

    For a negative height it is that since the body was so much higher, at the latest its apex.
    """
    square = speed * speed + 2.0 * GRAVITY * height
    return (math.sqrt(max(square, 0.0)) - speed) / GRAVITY


@kernel
def choose_landing_position(
    foot: int,
    params: LandingParams,
    constants: LandingConstants,
    memory: LandingMemory,
    place: Vector3,
    scratch: LandingScratch,
) -> None:
    """Choose the landing ``place`` (3,) of a foot from the centre of mass, by the law."""
    planned, side = memory.planned[foot], constants.side[foot]
    if params.law == "predicted":
        shift = memory.shift
        place[0] = planned[0] + shift[0]
        place[1] = planned[1] + (shift[1] + side * shift[2])
        place[2] = planned[2] + shift[3]
        keep_within(params.p_max, scratch.centre[foot], planned, place)
        return
    landing_position(
        planned, side, scratch.linear, scratch.angular, params.w_l, params.w_k,
        params.w_c, params.p_max, scratch.centre[foot], place,
    )  # fmt: skip


@kernel
def turn_frame(
    plan: JumpReference,
    terms: DynamicsTerms,
    params: LandingParams,
    overdue: bool,
    memory: LandingMemory,
    scratch: LandingScratch,
) -> None:
    """Compute the frame that the targets are fixed in, its rate, and the CoM in the body."""
    alpha = params.alpha
    if plan.toes_first:
        alpha = params.toes_alpha
    planned, turn, vector = memory.orientation, scratch.turn, scratch.vector
    from_matrix(terms.base_rotation, scratch.quaternion)
    conjugate(planned, turn)
    multiply(turn, scratch.quaternion, turn)
    logarithm(turn, vector)
    vector[:] = vector * alpha
    exponential(vector, turn)
    multiply(planned, turn, turn)
    to_matrix(turn, scratch.rotation)
    scratch.rate[:] = terms.velocity[3:6] * alpha
    if not overdue:
        scratch.rate[:] += plan.angular_velocity * (1.0 - alpha)
    vector[:] = terms.com - terms.base_position
    scratch.com_body[:] = terms.base_rotation.T @ vector


@kernel
def convert_to_body(
    foot: int, heading: float, terms: DynamicsTerms, feet: FootTarget, scratch: LandingScratch
) -> None:
    """Convert place and speed relative to the CoM into those relative to the base; turn the sole."""
    turn, vector = scratch.rotation.T, scratch.vector
    vector[:] = turn @ scratch.place[foot]
    feet.position[foot, :] = scratch.com_body + vector
    feet.velocity[foot, :] = (
        turn @ scratch.speed
        - cross(scratch.rate, vector)
        + terms.base_rotation.T @ terms.com_velocity
        - terms.velocity[:3]
        - cross(terms.velocity[3:6], scratch.com_body)
    )
    heading_matrix(heading, scratch.heading)
    feet.rotation[foot, :, :] = turn @ scratch.heading
