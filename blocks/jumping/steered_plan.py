"""Plays jumps one after the other, each of which is asked for when the one before has landed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ...mathematics.arrays import Array1D, Array2D, Flags1D
from ...mathematics.elementary import hypot, sincos
from ...mathematics.interpolation import lengthen, minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.rotations import mean_heading, pattern_turn, turn_about_vertical, wrap
from ...planner.library.jump_table import (
    FlightRotation,
    TableRows,
    fed_forward,
    integrate_rows,
    row_dimensions,
)
from ...planner.online.hop_plans import level_reach, missing_plans, standing_row
from ...planner.online.hop_request import LEVEL
from ...robots.description import RobotDescription
from ...robots.foot_directions import standing_directions
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.context import Clock
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import (
    CourseGoal,
    DelayEstimate,
    DynamicsTerms,
    JumpCommand,
    JumpFrame,
    JumpReference,
    Phase,
    PhaseState,
    PlanOutcome,
    PlanPart,
    PlanRequest,
)
from ..signals.steering import PART_ROWS, PLAN_ROWS, PlanRows
from .plan_progress import PlanProgress, ProgressConstants, ProgressParameters, follow_plan

NEVER = 1e6
"""The time [s] of a lift-off that is not planned."""
DIRECTED = 0.05
"""A jump is one ahead or back from that distance on [m]."""
MOST_BIAS = 0.02
"""The largest error of place [m] that is taken for the robot's own, and not for a push."""
HARDEST = 1.875
"""The largest rate of ``minimum_jerk``."""
SAME_TURN = 0.02
"""A difference of heading [rad] that is none."""
BEHIND = 10.0
"""Rows behind the last one of a plan repeat it, so far apart [s]."""


class ReceivedPlan(PlanRows):
    """The plan that is handed over, row by row."""

    parts = Field(dtype="int64", text="parts that have come")
    whole = Field(dtype="bool", text="whether all have come")


class FollowedPlan(PlanRows):
    """The plan that is followed."""

    sums = Field((PLAN_ROWS, "plan_width"), text="integrals of the columns")
    touchdowns = Field(1, unit="s", text="when landing begins")
    began = Field(unit="s", text="time of the run at which it began")


class SteeringState(Signal):
    """What ``SteeredPlan`` remembers besides its plans."""

    started = Field(dtype="bool", text="whether the first tick is over")
    start = Field(2, unit="m", frame="world", text="middle of the feet when it first stood")
    start_heading = Field(unit="rad", frame="world", text="their heading then")
    origin = Field(3, unit="m", frame="world", text="origin of the jump's frame")
    heading = Field(unit="rad", frame="world", text="heading of that frame")
    goal = Field(2, unit="m", frame="world", text="where the middle of the feet should be")
    goal_heading = Field(unit="rad", frame="world", text="their heading there")
    bias = Field(
        (3, 2),
        unit="m",
        text="by how much landings go too far ahead and aside: of jumps ahead, back and others",
    )
    kind = Field(dtype="int64", text="the row of the last request")
    level = Field(unit="m", text="height of the ground there, above that where it first stood")
    before = Field(2, unit="m", frame="world", text="the goal before the command that waits")
    before_heading = Field(unit="rad", frame="world", text="the heading there")
    before_level = Field(unit="m", text="the height there")
    taken = Field(dtype="int64", text="number of the last command that was taken")
    requests = Field(dtype="int64", text="requests so far")
    asked = Field(4, text="the last request: ahead, aside [m], turn [rad] and up [m]")
    jumps = Field(dtype="int64", text="plans begun so far")
    waits = Field(dtype="bool", text="whether a plan was asked for that has not begun")
    shift = Field(3, unit="m", text="what the jump under way goes too short, in its frame")
    shift_time = Field(
        unit="s", text="how long before lift-off that begins to be changed; zero: nothing is"
    )


class SteeringConstants(ProgressConstants):
    """What follows from the parameters and the robot's stored plans."""

    ahead = Field(unit="m", text="the farthest jump ahead")
    back = Field(unit="m", text="the farthest back")
    aside = Field(unit="m", text="the farthest to a side")
    of_points = Field(dtype="bool", text="no foot has a direction of its own")


class SteeredPlan(Block):
    """Asks for the next jump where a command has come, and follows its plan.

    The robot stands, jumps, lands and stands. While it stands, and from ``ask_time`` after a touchdown, a
    command with a greater number than the last one is taken: the place and heading where the feet should
    be move on by it, or to it where it is ``placed``. Until the plan begins a command that
    ``replaces`` takes the place of the one that was taken, and the jump is asked for anew. The ``request`` is the way from where the feet *are* to that goal, so a
    landing that missed its place is corrected by the next jump. ``OnlinePlanner``, which works in the
    background, answers with the ``part``s of a plan. When all have come, and the robot has stood up for
    ``rest_time``, the plan begins at the measured place and heading of the feet. The plan of a jump
    that cannot be done goes to the nearest place that can; from then on the goal is there.

    A command that ``replaces`` still moves the landing of the jump under way, until ``retarget_time`` before lift-off. Over the
    last T_p of the thrust, at most ``retarget_window``, the plan's centre of mass gains the velocity that moves the
    touchdown by d (``lengthen``), and feet follow it in flight. It accelerates by at most a = ``retarget_acceleration``,
    or ``retarget_braking`` backwards, so

        |d| <= a T_p (T_f + T_p / 2) / 1.875,

    ahead and aside, and within ``retarget_limit``. What goes beyond that or beyond the reach, and changes of turn and height, are left out: the goal is the nearest place, and
    ``goal.outcome`` is NEAREST. A jump is moved once; a command that comes later waits for the next jump.

    Reference and ``terms`` are in the frame of the jump, which ``frame`` tells ``StartFrame``: its origin is the middle of the
    feet before the jump, with x ahead. It moves when a plan begins. Ahead is where the feet point, or, for feet that are points,
    how all of them together are turned from where they are as the robot stands (as in ``BalanceTarget``). The reference's time is that of the run. Until the first plan begins the robot
    stands; after a plan the reference stays at its end. How a plan is kept in time with the robot is
    told at ``JumpPlan``: by the speed and height that the thrust has reached.

    Each robot lands a little beside its plans, and jumps ahead, back or others always to the same side, as its masses are not
    exactly those of the description. So a ``learning`` share of the last error is added to a bias of that kind
    of jump, which its requests are shortened by.

    The ground has the height that the commands say, and a robot that stands is taken to stand on it: ``up`` is
    the difference between the ground of two commands and never measured.

    The places are those of the estimator, which drifts by a few millimetres a jump; ``goal`` tells where the feet should
    be by all commands, relative to where they stood when the run began.
    """

    class Params(ProgressParameters):
        lead: float | None = parameter(
            None, unit="s", ge=0.0, le=0.02,
            text="delay from sensing to torque that is compensated; none: the one at `delay`",
        )  # fmt: skip
        settle_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing at the start, before a command is taken"
        )
        ask_time: float = parameter(
            0.15, unit="s", ge=0.0, text="how long after touchdown a command is taken"
        )
        rest_time: float = parameter(
            0.3, unit="s", ge=0.0, text="how long it rises and stands before the next plan begins"
        )

        retarget_time: float = parameter(
            0.1, unit="s", ge=0.02, le=1.0,
            text="how long before lift-off the landing of a jump may still be moved",
        )  # fmt: skip
        retarget_window: float = parameter(
            0.3, unit="s", gt=0.0, le=1.0, text="how long before lift-off that begins, at most"
        )
        retarget_acceleration: float = parameter(
            3.0, unit="m/s^2", ge=0.0, le=20.0,
            text="of the centre of mass for it, ahead and aside at most",
        )  # fmt: skip
        retarget_braking: float = parameter(
            1.0, unit="m/s^2", ge=0.0, le=20.0,
            text="the same backwards; at the end of a thrust there are only the toes to brake with",
        )  # fmt: skip
        retarget_limit: float = parameter(
            0.05,
            unit="m",
            ge=0.0,
            le=0.3,
            text="how far a landing is moved ahead and aside at most",
        )
        learning: float = parameter(
            0.5, ge=0.0, le=1.0,
            text="share of the last landing's error of place that later jumps are aimed against",
        )  # fmt: skip

    class Scratch(Signal):
        """Room for a step."""

        values = Field("plan_width", text="columns of an instant")
        middle = Field(3, unit="m", frame="world", text="of the feet, in the estimator's world")
        vector = Field(3, unit="m", text="the same in the jump's frame")
        origin = Field(
            3, unit="m", text="zeros, where the middle of the feet is as the robot stands"
        )

    Constants = SteeringConstants
    needs = ("floating base", "feet")
    params: Params
    constants: SteeringConstants
    command = Input(JumpCommand, text="the next jump")
    part = Input(PlanPart, text="the planner's answer")
    phase = Input(PhaseState, text="the phase; wire it with a delay of 1")
    terms = Input(DynamicsTerms, text="the measured motion")
    delay = Input(DelayEstimate, default={"delay": 0.002}, text="the delay that is compensated")
    reference = Output(JumpReference, text="the plan at the present instant")
    request = Output(PlanRequest, text="the jump that should be planned")
    frame = Output(JumpFrame, text="where the jump begins in the estimator's world")
    goal = Output(CourseGoal, text="where the feet should be by all commands so far")
    received = State(ReceivedPlan, text="the next plan")
    followed = State(FollowedPlan, text="the plan that is followed")
    memory = State(SteeringState, text="the goal, and what was asked for")
    progress = State(PlanProgress, text="how late the plan is")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """The width of a plan's rows."""
        return row_dimensions(robot)

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a robot that has no stored plans."""
        assert context.robot is not None
        return missing_plans(context.robot)

    def setup(self) -> None:
        followed, feet = self.followed, len(self.robot.feet)
        self.table = TableRows(
            followed.time, followed.rows, followed.sums, fed_forward(feet, len(self.robot.joints)),
            followed.marks, followed.jumps, followed.touchdowns, followed.toes_first,
            followed.contact, self.scratch.values,
        )  # fmt: skip
        self.rotation = FlightRotation(*(np.zeros(size) for size in (1, 1, 1, 4)))
        self.directions, points = standing_directions(self.robot)
        self.counted = ~points
        self.constants.of_points = bool(points.all())
        reach = level_reach(self.robot.name)
        self.constants.ahead, self.constants.back = reach.ahead, reach.back
        self.constants.aside = reach.aside
        self.constants.lead = -1.0 if self.params.lead is None else self.params.lead
        self.constants.follows_motion = self.params.by == "progress"
        self.constants.period = self.period
        self.constants.foot_of_point[:] = self.robot.foot_of_contact()

    def start(self) -> None:
        """The robot stands until the first plan begins."""
        followed = self.followed
        followed.rows[:] = standing_row(self.robot)
        followed.time[:] = BEHIND * np.arange(PLAN_ROWS)
        followed.contact[:] = True
        followed.marks[:] = followed.jumps[:] = followed.touchdowns[:] = NEVER

    @kernel
    @staticmethod
    def step(
        command: JumpCommand,
        part: PlanPart,
        phase: PhaseState,
        terms: DynamicsTerms,
        delay: DelayEstimate,
        reference: JumpReference,
        request: PlanRequest,
        frame: JumpFrame,
        goal: CourseGoal,
        received: ReceivedPlan,
        followed: FollowedPlan,
        memory: SteeringState,
        progress: PlanProgress,
        table: TableRows,
        rotation: FlightRotation,
        directions: Array2D,
        counted: Flags1D,
        params: Params,
        constants: SteeringConstants,
        scratch: Scratch,
        clock: Clock,
    ) -> None:
        now = clock.base_period * clock.tick
        middle_of(terms.foot_position, scratch.vector)
        turn_about_vertical(scratch.vector, memory.heading, scratch.middle)
        scratch.middle[:] = scratch.middle + memory.origin
        heading = memory.heading + (
            pattern_turn(directions, scratch.origin, terms.foot_position, scratch.vector)
            if constants.of_points
            else mean_heading(terms.foot_rotation, counted)
        )
        stands = phase.phase == Phase.STAND and now >= params.settle_time
        if stands and not memory.started:
            begin(scratch.middle, heading, memory)
        if memory.waits:
            receive(part, memory.requests, received)
        landed = phase.phase == Phase.LANDING and phase.time_since_touchdown >= params.ask_time
        rests = phase.phase == Phase.RECOVER
        free = not memory.waits or command.replaces
        if (stands or landed or rests) and free and command.number > memory.taken:
            if not memory.waits and memory.jumps > 0:
                learn(scratch.middle, heading, params.learning, memory)
            ask(command, scratch.middle, heading, memory)
            received.parts = 0
            received.whole = False
        rested = stands or (rests and phase.time_in_phase >= params.rest_time)
        if memory.waits and received.whole and rested:
            follow(received, followed, memory)
            followed.began = now
            memory.origin[:] = scratch.middle
            memory.heading = heading
            integrate_rows(table)
            if followed.outcome != PlanOutcome.PLANNED:
                memory.goal[:] = scratch.middle[:2]
                memory.goal_heading = heading
                memory.level = memory.before_level
                land_at(followed.done, memory)
            progress.late = 0.0
        follow_plan(
            now - followed.began, terms, delay, reference, progress, table, rotation, params, constants
        )  # fmt: skip
        thrusts = phase.phase == Phase.SQUAT or phase.phase == Phase.THRUST
        if thrusts and not memory.waits and command.replaces and command.number > memory.taken:
            left = reference.lift_off_time - reference.time
            if memory.shift_time == 0.0 and left >= params.retarget_time:
                retarget(command, reference, left, params, constants, followed, memory)
        if memory.shift_time > 0.0:
            shift_landing(reference, memory)
        if memory.jumps > 0:
            reference.time += followed.began
            reference.lift_off_time += followed.began
            reference.touchdown_time += followed.began
        frame.origin[:] = memory.origin
        frame.heading = memory.heading
        tell_request(memory, request)
        tell_goal(memory, followed.outcome, goal)


@kernel
def middle_of(points: Array2D, out: Array1D) -> None:
    """The mean of points (n, 3)."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        out[:] += points[i] / points.shape[0]


@kernel
def begin(middle: Array1D, heading: float, memory: SteeringState) -> None:
    """Note where the robot stands: there is the first goal."""
    memory.start[:] = middle[:2]
    memory.goal[:] = middle[:2]
    memory.start_heading = heading
    memory.goal_heading = heading
    memory.started = True


@kernel
def learn(middle: Array1D, heading: float, share: float, memory: SteeringState) -> None:
    """Take a share of how far the feet are from their goal, in their own axes, for the robot's own error."""
    x, y = middle[0] - memory.goal[0], middle[1] - memory.goal[1]
    sine, cosine = sincos(heading)
    ahead, aside = cosine * x + sine * y, cosine * y - sine * x
    bias = memory.bias[memory.kind]
    bias[0] += share * min(max(ahead, -MOST_BIAS), MOST_BIAS)
    bias[1] += share * min(max(aside, -MOST_BIAS), MOST_BIAS)
    bias[0] = min(max(bias[0], -MOST_BIAS), MOST_BIAS)
    bias[1] = min(max(bias[1], -MOST_BIAS), MOST_BIAS)


@kernel
def ask(command: JumpCommand, middle: Array1D, heading: float, memory: SteeringState) -> None:
    """Move the goal on by a command, and ask for the jump from the feet's place to it."""
    if memory.waits:  # this command takes the place of the one before
        memory.goal[:] = memory.before
        memory.goal_heading, memory.level = memory.before_heading, memory.before_level
    memory.before[:] = memory.goal
    memory.before_heading, memory.before_level = memory.goal_heading, memory.level
    if command.placed:
        memory.goal[0], memory.goal[1] = command.ahead, command.aside
        memory.goal_heading, memory.level = command.turn, command.up
    else:
        move(memory, command.ahead, command.aside, command.turn, command.up)
    memory.taken = command.number
    memory.requests += 1
    memory.waits = True
    x, y = memory.goal[0] - middle[0], memory.goal[1] - middle[1]
    sine, cosine = sincos(heading)
    turn = memory.goal_heading - heading
    ahead, aside = cosine * x + sine * y, cosine * y - sine * x
    memory.kind = 2
    if abs(ahead) >= DIRECTED:
        memory.kind = 0 if ahead > 0.0 else 1
    memory.asked[0] = ahead - memory.bias[memory.kind, 0]
    memory.asked[1] = aside - memory.bias[memory.kind, 1]
    memory.asked[2] = wrap(turn)
    memory.asked[3] = memory.level - memory.before_level


@kernel
def retarget(
    command: JumpCommand,
    reference: JumpReference,
    left: float,
    params: SteeredPlan.Params,
    constants: SteeringConstants,
    followed: FollowedPlan,
    memory: SteeringState,
) -> None:
    """Move the landing of the jump under way, ``left`` [s] before lift-off, as near to the command's place as that goes."""
    x, y, heading, level = memory.goal[0], memory.goal[1], memory.goal_heading, memory.level
    memory.goal[:] = memory.before
    memory.goal_heading, memory.level = memory.before_heading, memory.before_level
    if command.placed:
        memory.goal[0], memory.goal[1] = command.ahead, command.aside
        memory.goal_heading, memory.level = command.turn, command.up
    else:
        move(memory, command.ahead, command.aside, command.turn, command.up)
    whole = abs(wrap(memory.goal_heading - heading)) < SAME_TURN
    whole = whole and abs(memory.level - level) < LEVEL
    sine, cosine = sincos(memory.heading)
    u, v = memory.goal[0] - x, memory.goal[1] - y
    wanted_ahead, wanted_aside = cosine * u + sine * v, cosine * v - sine * u
    ahead = min(
        max(wanted_ahead, -constants.back - memory.asked[0]), constants.ahead - memory.asked[0]
    )
    aside = min(
        max(wanted_aside, -constants.aside - memory.asked[1]), constants.aside - memory.asked[1]
    )
    memory.shift_time = min(left, params.retarget_window)
    flight = reference.touchdown_time - reference.lift_off_time
    gained = memory.shift_time / HARDEST * (flight + 0.5 * memory.shift_time)
    most = min(params.retarget_acceleration * gained, params.retarget_limit)
    ahead = min(max(ahead, -min(params.retarget_braking * gained, most)), most)
    aside = min(max(aside, -most), most)
    memory.shift[0], memory.shift[1], memory.shift[2] = -ahead, -aside, 0.0
    memory.goal[0], memory.goal[1] = (
        x + cosine * ahead - sine * aside,
        y + sine * ahead + cosine * aside,
    )
    memory.goal_heading, memory.level = heading, level
    memory.taken = command.number
    if not whole or hypot(wanted_ahead - ahead, wanted_aside - aside) > LEVEL:
        followed.outcome = PlanOutcome.NEAREST


@kernel
def shift_landing(reference: JumpReference, memory: SteeringState) -> None:
    """Move the plan at this instant, so that it lands elsewhere: its centre of mass before and its feet behind lift-off."""
    since = reference.time - reference.lift_off_time
    flight = reference.touchdown_time - reference.lift_off_time
    share = 1.0 + since / memory.shift_time
    if share <= 0.0:
        return
    lengthen(
        memory.shift, 1.0, 1.0, flight, memory.shift_time, share,
        reference.com, reference.com_velocity, reference.com_acceleration,
    )  # fmt: skip
    flown = min(max(since, 0.0), flight)
    grown, rate, _ = minimum_jerk(flown / flight)
    for axis in range(2):
        speed = -memory.shift[axis] / (flight + 0.5 * memory.shift_time)
        reference.com[axis] += speed * flown
        if since > flight:
            reference.com_velocity[axis] -= speed
        for foot in range(reference.foot_position.shape[0]):
            reference.foot_position[foot, axis] -= memory.shift[axis] * grown
            reference.foot_velocity[foot, axis] -= memory.shift[axis] * rate / flight


@kernel
def tell_request(memory: SteeringState, request: PlanRequest) -> None:
    """Write the last request."""
    request.ahead, request.aside = memory.asked[0], memory.asked[1]
    request.turn, request.up = memory.asked[2], memory.asked[3]
    request.command = memory.taken
    request.waits = memory.waits
    request.number = memory.requests


@kernel
def land_at(done: Array1D, memory: SteeringState) -> None:
    """Move the goal to where a plan lands, with the robot's own error."""
    ahead = done[0] + memory.bias[memory.kind, 0]
    aside = done[1] + memory.bias[memory.kind, 1]
    move(memory, ahead, aside, done[2], done[3])


@kernel
def move(memory: SteeringState, ahead: float, aside: float, turn: float, up: float) -> None:
    """Move the goal by a jump."""
    sine, cosine = sincos(memory.goal_heading)
    memory.goal[0] += cosine * ahead - sine * aside
    memory.goal[1] += sine * ahead + cosine * aside
    memory.goal_heading += turn
    memory.level += up


@kernel
def receive(part: PlanPart, number: int, received: ReceivedPlan) -> None:
    """Copy the part of the plan that comes next, if it is there."""
    if received.whole or part.number != number or part.part != received.parts:
        return
    first = part.part * PART_ROWS
    for row in range(PART_ROWS):
        received.time[first + row] = part.time[row]
        received.rows[first + row, :] = part.rows[row]
        for point in range(part.contact.shape[1]):
            received.contact[first + row, point] = part.contact[row, point]
    received.parts += 1
    if received.parts < part.parts:
        return
    last = received.parts * PART_ROWS - 1
    for row in range(last + 1, received.time.shape[0]):
        received.time[row] = received.time[row - 1] + BEHIND
        received.rows[row, :] = received.rows[last]
        for point in range(part.contact.shape[1]):
            received.contact[row, point] = received.contact[last, point]
    received.marks[:] = part.marks
    received.jumps[0, :] = part.jump
    received.toes_first[0] = part.toes_first
    received.outcome = part.outcome
    received.done[0], received.done[1] = part.ahead, part.aside
    received.done[2], received.done[3] = part.turn, part.up
    received.whole = True


@kernel
def follow(received: ReceivedPlan, followed: FollowedPlan, memory: SteeringState) -> None:
    """Make the plan that has come the one that is followed."""
    followed.time[:] = received.time
    for row in range(received.time.shape[0]):
        followed.rows[row, :] = received.rows[row]
        for point in range(received.contact.shape[1]):
            followed.contact[row, point] = received.contact[row, point]
    followed.marks[:] = received.marks
    followed.jumps[0, :] = received.jumps[0]
    followed.touchdowns[0] = received.jumps[0, 2]
    followed.toes_first[0] = received.toes_first[0]
    followed.outcome = received.outcome
    followed.done[:] = received.done
    memory.waits = False
    memory.shift_time = 0.0
    memory.jumps += 1


@kernel
def tell_goal(memory: SteeringState, outcome: int, goal: CourseGoal) -> None:
    """The goal from where the robot stood at the start."""
    x, y = memory.goal[0] - memory.start[0], memory.goal[1] - memory.start[1]
    sine, cosine = sincos(memory.start_heading)
    goal.position[0] = cosine * x + sine * y
    goal.position[1] = cosine * y - sine * x
    goal.heading = memory.goal_heading - memory.start_heading
    goal.height = memory.level
    goal.number = memory.jumps
    goal.outcome = outcome
