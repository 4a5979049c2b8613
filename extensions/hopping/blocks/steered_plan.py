"""Jumps one after the other, each requested when the one before has landed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from ....blocks.jumping.plan_progress import (
    PlanProgress,
    ProgressConstants,
    ProgressParameters,
    keep_in_time,
    read_plan,
)
from ....blocks.jumping.table_reading import integrate_rows
from ....blocks.signals import DelayEstimate, DynamicsTerms, JumpReference, Phase, PhaseState
from ....mathematics.arrays import Array1D, Array2D, Flags1D
from ....mathematics.constants import GRAVITY
from ....mathematics.elementary import hypot, sincos
from ....mathematics.kernel import kernel
from ....mathematics.rotations import (
    mean_heading,
    pattern_turn,
    turn_about_vertical,
    wrap,
)
from ....planner.library.jump_table import (
    FlightRotation,
    TableRows,
    fed_forward,
    row_dimensions,
)
from ....robots.description import RobotDescription
from ....robots.kinematics import standing_directions
from ....runtime.language.block import (
    Block,
    Context,
    Input,
    Metric,
    Output,
    State,
    UnmetRequirement,
)
from ....runtime.language.context import Clock
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from ..planner.hop_plans import level_reach, missing_plans, standing_row
from ..planner.hop_request import LEVEL
from ..planner.plan_outcome import PlanOutcome
from ..signals import (
    PLAN_ROWS,
    CourseGoal,
    JumpCommand,
    JumpFrame,
    PlanRequest,
    PlanSegment,
)
from .moved_landing import (
    AHEAD,
    ASIDE,
    TURN,
    UP,
    MotionScratch,
    MovedLanding,
    RetargetParameters,
    add_velocity_change,
    begin_swing,
    middle_of,
    move_footholds,
    move_landing,
)
from .received_plan import BEHIND, FollowedPlan, ReceivedPlan, receive

NEVER = 1e6
"""The time [s] of a lift-off that is not planned."""
DIRECTED = 0.05
"""A jump is one ahead or back from that distance on [m]."""
MOST_BIAS = 0.02
"""The largest error of place [m] that is taken for the robot's own, and not for a push."""
SAME_TURN = 0.02
"""A difference of heading [rad] that is none."""
MOVED_TURN = 0.05
"""Turn of the feet [rad] from which a jump is requested anew."""


class SteeringState(Signal):
    """Memory of ``SteeredPlan`` besides its plans."""

    started = Field(dtype="bool", text="the first tick is over")
    start = Field(2, unit="m", frame="world", text="middle of the feet when it first stood")
    start_heading = Field(unit="rad", frame="world", text="their heading then")
    origin = Field(3, unit="m", frame="world", text="origin of the jump's frame")
    heading = Field(unit="rad", frame="world", text="heading of that frame")
    goal = Field(2, unit="m", frame="world", text="goal of the middle of the feet")
    goal_heading = Field(unit="rad", frame="world", text="their heading there")
    bias = Field(
        (3, 2),
        unit="m",
        text="error of landings ahead and aside: of jumps ahead, back and others",
    )
    kind = Field(dtype="int64", text="the row of the last request")
    level = Field(unit="m", text="height of the ground there, above that where it first stood")
    before = Field(2, unit="m", frame="world", text="the goal before the command that waits")
    before_heading = Field(unit="rad", frame="world", text="the heading there")
    before_level = Field(unit="m", text="the height there")
    taken = Field(dtype="int64", text="number of the last command that was taken")
    requests = Field(dtype="int64", text="requests so far")
    asked_from = Field(2, unit="m", frame="world", text="place of the feet at the last request")
    asked_heading = Field(unit="rad", frame="world", text="their heading then")
    asked = Field(4, text="the last request: ahead, aside [m], turn [rad] and up [m]")
    jumps = Field(dtype="int64", text="plans begun so far")
    changed = Field(dtype="int64", text="commands that moved the landing of a jump under way")
    nearest = Field(dtype="int64", text="those of them that only the nearest was done of")
    waits = Field(dtype="bool", text="a plan was requested and has not begun")


class SteeringConstants(ProgressConstants):
    """Constants derived from the parameters and the robot's stored plans."""

    ahead = Field(unit="m", text="the farthest jump ahead")
    back = Field(unit="m", text="the farthest back")
    aside = Field(unit="m", text="the farthest to a side")
    turn = Field(unit="rad", text="the largest turn")
    of_points = Field(dtype="bool", text="no foot has a direction of its own")


class SteeredPlan(Block):
    """Requests the next jump when a command has come, and follows its plan.

    The robot stands, jumps, lands and stands. While it stands, and from ``ask_time`` after a touchdown, a
    command with a greater number than the last one is taken: the place and heading where the feet should
    be move on by it, or to it where it is ``placed``. Until the plan begins a command that
    ``replaces`` takes the place of the one that was taken, and the jump is requested anew. The ``request`` is the way from where the feet *are* to that goal, so a
    landing that missed its place is corrected by the next jump. ``OnlinePlanner``, which works in the
    background, answers with the ``segment``s of a plan. When all have come, and the robot has stood up for
    ``rest_time`` and is at rest, the plan begins at the measured place and heading of the feet. It is at rest where its capture
    point c + c' / w, seen from the middle of the feet, is within ``rest_offset`` of where the plan has it; for that it waits by ``rest_limit`` at
    most. A robot that has taken a step, or slid by ``ask_again``, since the request makes a new one. The plan of a jump
    that cannot be done goes to the nearest place that can; from then on the goal is there.

    A command that ``replaces`` still moves the landing of the jump under way (``moved_landing``), as often as it likes. Until ``retarget_time`` before lift-off
    place, height and heading move: over what is left of the thrust, T_p, at most ``retarget_window``, the body gains
    the velocity, or the rate of turn, that moves its touchdown by d, and the feet follow in flight. With x and v
    what earlier commands have changed so far, and a like them,

        v_d = (d - x - T_p v / 2 - T_p^2 a / 12) / (T_f + T_p / 2)

    is reached at lift-off by a cubic in time, which stays below ``retarget_acceleration``, backwards ``retarget_braking``, and in turning
    ``retarget_spin``; in all a landing moves by at most ``retarget_limit``, ``retarget_height`` and ``retarget_turn``. In flight, until
    ``foothold_time`` before touchdown, only the feet can move: by at most ``foothold_limit`` and ``foothold_turn`` from
    where the body needs them. What goes beyond that or beyond the reach is left out: the goal is the nearest place, and
    ``goal.outcome`` is NEAREST. A command that comes between the two waits for the flight, and one that comes later for the
    next jump.

    Reference and ``terms`` are in the frame of the jump, which ``frame`` tells ``StartFrame``: its origin is the middle of the
    feet before the jump, with x ahead. It moves when a plan begins. Ahead is where the feet point, or, for feet that are points,
    how all of them together are turned from where they are as the robot stands (as in ``BalanceTarget``). The reference's time is that of the run. Until the first plan begins the robot
    stands; after a plan the reference stays at its end. How a plan is kept in time with the robot is
    told at ``JumpPlan``: by the speed and height that the thrust has reached.

    Each robot lands a little beside its plans, and jumps ahead, back or others always to the same side, as its masses are not
    exactly those of the description. So a ``learning`` share of the last error is added to a bias of that kind
    of jump, which its requests are shortened by.

    The ground has the height that the commands give, and a robot that stands is taken to stand on it: ``up`` is
    the difference between the ground of two commands and never measured.

    The places are those of the estimator, which drifts by a few millimetres a jump; ``goal`` tells where the feet should
    be by all commands, relative to where they stood when the run began.
    """

    class Params(ProgressParameters, RetargetParameters):
        lead: float | None = parameter(
            None, unit="s", ge=0.0, le=0.02,
            text="delay from sensing to torque that is compensated; none: the one at `delay`",
        )  # fmt: skip
        settle_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing at the start, before a command is taken"
        )
        ask_time: float = parameter(
            0.15, unit="s", ge=0.0, text="time after touchdown from which a command is taken"
        )
        rest_time: float = parameter(
            0.3,
            unit="s",
            ge=0.0,
            text="time in which it rises and stands before the next plan begins",
        )
        rest_offset: float = parameter(
            0.05, gt=0.0,
            text="a plan begins when the capture point is so near to the feet's planned middle, in heights of "
            "the centre of mass",
        )  # fmt: skip
        rest_limit: float = parameter(
            2.0, unit="s", ge=0.0, text="longest wait for that beyond `rest_time`"
        )
        ask_again: float = parameter(
            0.01, unit="m", gt=0.0,
            text="shift of the feet from which a jump is requested anew; a turn by 0.05 rad counts too",
        )  # fmt: skip
        learning: float = parameter(
            0.5, ge=0.0, le=1.0,
            text="share of the last landing's error of place that later jumps are aimed against",
        )  # fmt: skip

    class Scratch(MotionScratch):
        """Scratch memory of one step."""

        values = Field("plan_width", text="columns of an instant")
        place = Field(
            3, unit="m", frame="world", text="middle of the feet, in the estimator's world"
        )
        vector = Field(3, unit="m", text="the same in the jump's frame")
        origin = Field(
            3, unit="m", text="zeros, where the middle of the feet is as the robot stands"
        )

    Constants = SteeringConstants
    needs = ("floating base", "feet")
    params: Params
    constants: SteeringConstants
    command = Input(JumpCommand, text="the next jump")
    segment = Input(PlanSegment, text="the planner's answer")
    phase = Input(PhaseState, text="the phase, with steps; wire it with a delay of 1")
    terms = Input(DynamicsTerms, text="the measured motion")
    delay = Input(DelayEstimate, default={"delay": 0.002}, text="the delay that is compensated")
    reference = Output(JumpReference, text="the plan at the present instant")
    request = Output(PlanRequest, text="the jump that should be planned")
    frame = Output(JumpFrame, text="start of the jump in the estimator's world")
    goal = Output(CourseGoal, text="goal of the feet by all commands so far")
    received = State(ReceivedPlan, text="the next plan")
    followed = State(FollowedPlan, text="the plan that is followed")
    memory = State(SteeringState, text="the goal and the last request")
    progress = State(PlanProgress, text="delay of the plan")
    moved = State(MovedLanding, text="shift of the landing of the jump under way")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the width of a plan's rows."""
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
        reach = level_reach(self.robot)
        self.constants.ahead, self.constants.back = reach.ahead, reach.back
        self.constants.aside, self.constants.turn = reach.aside, reach.turn
        self.constants.lead = -1.0 if self.params.lead is None else self.params.lead
        self.constants.follows_motion = self.params.by == "progress"
        self.constants.period = self.period
        self.constants.foot_of_point[:] = self.robot.foot_of_contact()

    def start(self) -> None:
        """Stand until the first plan begins."""
        followed = self.followed
        followed.rows[:] = standing_row(self.robot)
        followed.time[:] = BEHIND * np.arange(PLAN_ROWS)
        followed.contact[:] = True
        followed.marks[:] = followed.jumps[:] = followed.touchdowns[:] = NEVER

    @kernel
    @staticmethod
    def step(
        command: JumpCommand,
        segment: PlanSegment,
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
        moved: MovedLanding,
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
        turn_about_vertical(scratch.vector, memory.heading, scratch.place)
        scratch.place[:] = scratch.place + memory.origin
        heading = memory.heading + (
            pattern_turn(directions, scratch.origin, terms.foot_position, scratch.vector)
            if constants.of_points
            else mean_heading(terms.foot_rotation, counted)
        )
        stands = phase.phase == Phase.STAND and now >= params.settle_time
        if stands and not memory.started:
            begin(scratch.place, heading, memory)
        if memory.waits:
            receive(segment, memory.requests, received)
        landed = phase.phase == Phase.LANDING and phase.time_since_touchdown >= params.ask_time
        rests = phase.phase == Phase.RECOVER
        free = not memory.waits or command.replaces
        if (stands or landed or rests) and free and command.number > memory.taken:
            if not memory.waits and memory.jumps > 0:
                learn(scratch.place, heading, params.learning, memory)
            ask(command, scratch.place, heading, memory)
            received.segments = 0
            received.whole = False
        elif rests and memory.waits and has_moved(scratch.place, heading, params.ask_again, memory):
            request_way(scratch.place, heading, memory)
            received.segments = 0
            received.whole = False
        rested = stands
        if rests and phase.time_in_phase >= params.rest_time:
            rested = phase.time_in_phase >= params.rest_time + params.rest_limit
            rested = rested or is_at_rest(terms, reference, params.rest_offset, scratch)
        if memory.waits and received.whole and rested:
            follow(received, followed, memory)
            moved.moves = 0
            followed.began = now
            memory.origin[:] = scratch.place
            memory.heading = heading
            integrate_rows(table)
            if followed.outcome != PlanOutcome.PLANNED:
                memory.goal[:] = scratch.place[:2]
                memory.goal_heading = heading
                memory.level = memory.before_level
                move_goal_by_plan(followed.done, memory)
            progress.late = 0.0
        time = read_plan(now - followed.began, delay, reference, progress, table, constants)
        if not memory.waits and command.replaces and command.number > memory.taken:
            retarget(command, phase, reference, params, constants, followed, memory, moved)
        if moved.moves > 0:
            move_landing(reference, terms, moved, scratch)
        keep_in_time(time, terms, reference, progress, rotation, params, constants)
        if memory.jumps > 0:
            reference.time += followed.began
            reference.lift_off_time += followed.began
            reference.touchdown_time += followed.began
        frame.origin[:] = memory.origin
        frame.heading = memory.heading
        tell_request(memory, request)
        tell_goal(memory, followed.outcome, goal)

    def metrics(self) -> Mapping[str, Metric]:
        """Return how many targets changed after their jump had begun, and of how many the nearest was done."""
        return {
            "targets_changed": int(self.memory.changed),
            "targets_not_reached": int(self.memory.nearest),
        }


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
    memory.waits = True
    request_way(middle, heading, memory)


@kernel
def request_way(middle: Array1D, heading: float, memory: SteeringState) -> None:
    """Ask for the jump from the feet's place to the goal."""
    memory.requests += 1
    memory.asked_from[:] = middle[:2]
    memory.asked_heading = heading
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
def has_moved(middle: Array1D, heading: float, way: float, memory: SteeringState) -> bool:
    """Check whether the feet have moved since the jump was requested: by a step, or by sliding."""
    x, y = middle[0] - memory.asked_from[0], middle[1] - memory.asked_from[1]
    return hypot(x, y) > way or abs(wrap(heading - memory.asked_heading)) > MOVED_TURN


@kernel
def is_at_rest(
    terms: DynamicsTerms, reference: JumpReference, offset: float, scratch: SteeredPlan.Scratch
) -> bool:
    """Check that the capture point is within ``offset`` of the plan's, in heights of the centre of mass."""
    middle_of(reference.foot_position, scratch.middle)
    middle_of(terms.foot_position, scratch.middle_rate)
    height = terms.com[2] - scratch.middle_rate[2]
    rate = math.sqrt(GRAVITY / max(height, 0.05))
    off = scratch.vector
    off[:] = terms.com - scratch.middle_rate + terms.com_velocity / rate
    off[:] = off - (reference.com - scratch.middle)
    distance = float(hypot(off[0], off[1]))
    return distance <= float(offset * height)


@kernel
def retarget(
    command: JumpCommand,
    phase: PhaseState,
    reference: JumpReference,
    params: SteeredPlan.Params,
    constants: SteeringConstants,
    followed: FollowedPlan,
    memory: SteeringState,
    moved: MovedLanding,
) -> None:
    """Move the landing of the jump under way as near to the command's place as that still goes."""
    left = reference.lift_off_time - reference.time
    thrusts = phase.phase == Phase.SQUAT or phase.phase == Phase.THRUST
    thrusts = thrusts and left >= params.retarget_time
    falls = reference.touchdown_time - reference.time
    flies = phase.phase == Phase.FLIGHT and reference.phase == Phase.FLIGHT
    flies = flies and falls >= params.foothold_time
    if not thrusts and not flies:
        return
    x, y, heading, level = memory.goal[0], memory.goal[1], memory.goal_heading, memory.level
    memory.goal[:] = memory.before
    memory.goal_heading, memory.level = memory.before_heading, memory.before_level
    if command.placed:
        memory.goal[0], memory.goal[1] = command.ahead, command.aside
        memory.goal_heading, memory.level = command.turn, command.up
    else:
        move(memory, command.ahead, command.aside, command.turn, command.up)
    if moved.moves == 0:
        moved.landing[:] = 0.0
        moved.thrown[:] = 0.0
    sine, cosine = sincos(memory.heading)
    u, v = memory.goal[0] - x, memory.goal[1] - y
    ahead = moved.landing[AHEAD] + cosine * u + sine * v
    aside = moved.landing[ASIDE] + cosine * v - sine * u
    up = moved.landing[UP] + memory.level - level
    turn = moved.landing[TURN] + wrap(memory.goal_heading - heading)
    before_ahead, before_aside = moved.landing[AHEAD], moved.landing[ASIDE]
    before_up, before_turn = moved.landing[UP], moved.landing[TURN]
    asked = memory.asked
    within_ahead = min(max(ahead, -constants.back - asked[0]), constants.ahead - asked[0])
    within_aside = min(max(aside, -constants.aside - asked[1]), constants.aside - asked[1])
    within_turn = min(max(turn, -constants.turn - asked[2]), constants.turn - asked[2])
    if thrusts:
        most = params.retarget_limit
        add_velocity_change(moved, AHEAD, within_ahead, reference, params, most)
        add_velocity_change(moved, ASIDE, within_aside, reference, params, most)
        add_velocity_change(moved, UP, up, reference, params, params.retarget_height)
        add_velocity_change(moved, TURN, within_turn, reference, params, params.retarget_turn)
    else:
        begin_swing(moved, reference)
        most = params.foothold_limit
        move_footholds(moved, AHEAD, within_ahead, most)
        move_footholds(moved, ASIDE, within_aside, most)
        move_footholds(moved, TURN, within_turn, params.foothold_turn)
    moved.moves += 1
    u, v = moved.landing[AHEAD] - before_ahead, moved.landing[ASIDE] - before_aside
    memory.goal[0], memory.goal[1] = x + cosine * u - sine * v, y + sine * u + cosine * v
    memory.goal_heading = heading + moved.landing[TURN] - before_turn
    memory.level = level + moved.landing[UP] - before_up
    memory.taken = command.number
    off_place = hypot(ahead - moved.landing[AHEAD], aside - moved.landing[ASIDE])
    reached = off_place <= LEVEL and abs(up - moved.landing[UP]) <= LEVEL
    memory.changed += 1
    if not reached or abs(turn - moved.landing[TURN]) > SAME_TURN:
        memory.nearest += 1
        followed.outcome = PlanOutcome.NEAREST
    elif followed.outcome == PlanOutcome.NEAREST:
        followed.outcome = PlanOutcome.PLANNED


@kernel
def tell_request(memory: SteeringState, request: PlanRequest) -> None:
    """Write the last request."""
    request.ahead, request.aside = memory.asked[0], memory.asked[1]
    request.turn, request.up = memory.asked[2], memory.asked[3]
    request.command = memory.taken
    request.waits = memory.waits
    request.number = memory.requests


@kernel
def move_goal_by_plan(done: Array1D, memory: SteeringState) -> None:
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
    memory.jumps += 1


@kernel
def tell_goal(memory: SteeringState, outcome: int, goal: CourseGoal) -> None:
    """Write the ``goal`` relative to the feet's place at the start."""
    x, y = memory.goal[0] - memory.start[0], memory.goal[1] - memory.start[1]
    sine, cosine = sincos(memory.start_heading)
    goal.position[0] = cosine * x + sine * y
    goal.position[1] = cosine * y - sine * x
    goal.heading = memory.goal_heading - memory.start_heading
    goal.height = memory.level
    goal.number = memory.jumps
    goal.outcome = outcome
