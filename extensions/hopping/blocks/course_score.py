"""The judge of courses: jumps one after the other to where they were commanded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum
from math import degrees, radians, sqrt

from ....blocks.scoring.footing import BallFeet, Footing, any_loaded
from ....blocks.scoring.standing import (
    NEVER,
    SETTLING,
    StandConstants,
    StandCriteria,
    StandRecord,
    Verdict,
    judge_machine,
    judge_rest,
    judge_safety,
    judgement_metrics,
    record_fall,
    record_rest,
    record_robot,
    rest_metrics,
)
from ....blocks.signals import RobotTruth, WholeBodyCommand
from ....mathematics.arrays import Array2D
from ....mathematics.elementary import atan2, sincos
from ....mathematics.kernel import kernel
from ....mathematics.rotations import wrap
from ....robots.kinematics import standing_directions
from ....runtime.language.block import Block, Input, Metric, State
from ....runtime.language.context import Clock
from ....runtime.language.parameters import parameter
from ....runtime.language.signals import Field, Signal
from ..signals import CourseGoal


class CourseRecord(StandRecord):
    """Record for the judgement of a course. Places are those of the middle of the feet."""

    middle = Field(2, unit="m", text="middle of the feet, when it was last found")
    heading = Field(unit="rad", text="their heading then")
    start = Field(2, unit="m", text="place before the first jump")
    start_heading = Field(unit="rad", text="its heading then")
    unloaded = Field(unit="s", text="time for which all points have been off the ground")
    flies = Field(dtype="bool", text="it flies")
    landed_time = Field(unit="s", text="of the last touchdown")
    measured = Field(dtype="bool", text="the place of that landing has been measured")
    jumps = Field(dtype="int64", text="landings whose place has been measured")
    target = Field(2, unit="m", text="goal of that landing")
    target_heading = Field(unit="rad", text="the heading there")
    off = Field(2, unit="m", text="way from the target, last landing")
    place_error = Field(unit="m", text="distance from the target, last landing")
    length_errors = Field(
        unit="m", text="sum of the differences of these ways from one landing to the next"
    )
    worst_place_error = Field(unit="m", text="the largest so far")
    place_errors = Field(unit="m", text="their sum")
    worst_turn_error = Field(unit="rad", text="the largest error of heading so far")


class CourseCriteria(StandCriteria):
    """The tolerances of a successful course."""

    jumps: int = parameter(0, ge=0, le=1000, text="after so many the course is over; 0: never")
    distance_tolerance: float = parameter(
        0.03, unit="m", gt=0, text="distance of the feet from where they should be, at each landing"
    )
    yaw_tolerance: float = parameter(
        radians(10), unit="rad", gt=0, text="the same for their heading"
    )
    flight_confirmation: float = parameter(
        0.06, unit="s", gt=0, text="all points must be off the ground for so long in a jump"
    )
    measure_time: float = parameter(
        0.35, unit="s", gt=0, text="time after touchdown at which the place is measured"
    )
    rest_time: float = parameter(
        1.5, unit="s", gt=0, text="time after the last touchdown at which the rest is judged"
    )


class CourseEnding(IntEnum):
    """Reason to end the run."""

    NONE = 0
    FELL = 1
    OVER = 2


class CourseEnd(Signal):
    """Result of a tick."""

    ending = Field(dtype="int64", values=CourseEnding, text="reason to end the run")


class CourseScore(Block):
    """Judges a course of jumps and ends the run. No controller sees it.

    A course is a success when all of these hold:

    1. Nothing but the contact points ever touches the ground, and no leg another; it does not fall; joints
       and motors stay within their limits (as ``JumpScore``).
    2. It has made all ``jumps``: in each, all points were off the ground for 60 ms.
    3. Each time, 0.35 s after touchdown, the middle of the feet is within 3 cm of where it should be by all
       commands so far (``goal``, relative to where the robot stood before the first jump), and their
       heading within 10 degrees. So errors of the estimated place add up, unless something measures it.
    4. 1.5 s after the last touchdown it stands still and upright on flat feet (as ``JumpScore``).

    With ``jumps: 0`` only 1 is judged, and the run ends when the robot falls or with its duration.
    """

    Params = CourseCriteria
    Constants = StandConstants
    Scratch = CourseEnd
    needs = ("floating base", "feet")
    params: CourseCriteria
    constants: StandConstants
    scratch: CourseEnd
    truth = Input(RobotTruth, reads_truth=True, text="true state of the robot")
    goal = Input(CourseGoal, text="goal of the feet by all commands so far")
    wbc = Input(WholeBodyCommand, default={}, text="the controller's answers, to count failures")
    record = State(CourseRecord, text="everything the judgement needs")

    def setup(self) -> None:
        footing = Footing(self.robot)
        self.balls = footing.ball_feet()
        self.directions, _ = standing_directions(self.robot)
        criteria = self.params.for_robot(footing)
        assert isinstance(criteria, CourseCriteria)
        self._criteria = criteria
        self.constants.fill(footing, criteria, SETTLING, self.period)

    @kernel
    @staticmethod
    def step(
        truth: RobotTruth,
        goal: CourseGoal,
        wbc: WholeBodyCommand,
        record: CourseRecord,
        balls: BallFeet,
        directions: Array2D,
        params: CourseCriteria,
        constants: StandConstants,
        scratch: CourseEnd,
        clock: Clock,
    ) -> bool:
        now = clock.base_period * clock.tick
        scratch.ending = CourseEnding.NONE
        record_robot(now, truth, wbc, record, balls, constants)
        if record.ticks == 1:
            record.landed_time = NEVER
        if record_fall(truth, record, params, constants):
            scratch.ending = CourseEnding.FELL
        if goal.number == 0:
            find_landing_position(record, directions)
            record.start[:] = record.middle
            record.start_heading = record.heading
        record_landings(truth, goal, record, directions, params, constants)
        over = params.jumps > 0 and record.jumps >= params.jumps
        rested = now - record.landed_time >= params.rest_time - 1e-9
        if over and rested and record.judged_time == NEVER:
            record_rest(truth, record, constants)
            scratch.ending = CourseEnding.OVER
        return bool(scratch.ending != CourseEnding.NONE)

    def on_event(self) -> None:
        """Ask for the end of the run."""
        fell = int(self.scratch.ending) == CourseEnding.FELL
        self.request_stop("the robot fell" if fell else f"{int(self.record.jumps)} jumps are over")

    def metrics(self) -> Mapping[str, Metric]:
        """Return the judgement and its figures."""
        r = self.record
        if r.ticks == 0:
            return {"success": False, "reason": "the run had no ticks"}
        failure = next((text for holds, text in self._judge() if not holds), None)
        values = judgement_metrics(r, failure) | {"jumps": int(r.jumps)}
        if r.jumps > 0:
            values |= {
                "mean_length_error_m": float(r.length_errors / r.jumps),
                "mean_place_error_m": float(r.place_errors / r.jumps),
                "worst_place_error_m": float(r.worst_place_error),
                "last_place_error_m": float(r.place_error),
                "worst_turn_error_deg": degrees(r.worst_turn_error),
            }
        if r.judged_time != NEVER:
            values |= rest_metrics(r)
        return values

    def _judge(self) -> Iterator[Verdict]:
        """Every criterion, in the order in which a failure explains those behind it."""
        r, c = self.record, self._criteria
        yield from judge_safety(r, c)
        yield from judge_machine(r, c)
        if c.jumps == 0:
            return
        yield r.jumps >= c.jumps, f"made {int(r.jumps)} of {c.jumps} jumps"
        yield (
            r.worst_place_error <= c.distance_tolerance,
            (
                f"landed {1e3 * r.worst_place_error:.1f} mm from its place, limit "
                f"{1e3 * c.distance_tolerance:.0f} mm"
            ),
        )
        yield (
            r.worst_turn_error <= c.yaw_tolerance,
            (
                f"landed {degrees(r.worst_turn_error):.1f} deg off its heading, limit "
                f"{degrees(c.yaw_tolerance):.0f} deg"
            ),
        )
        yield r.judged_time != NEVER, f"the run ended before {c.rest_time} s after touchdown"
        yield from judge_rest(r, c, "after touchdown")


@kernel
def find_landing_position(record: CourseRecord, directions: Array2D) -> None:
    """Find the middle of the feet and how they are turned from their ``directions`` as the robot stands."""
    record.middle[:] = 0.0
    x = y = 0.0
    feet = record.foot.shape[0]
    for foot in range(feet):
        record.middle[:] += record.foot[foot] / feet
        u, v = directions[foot, 0], directions[foot, 1]
        x += u * record.direction[foot, 0] + v * record.direction[foot, 1]
        y += u * record.direction[foot, 1] - v * record.direction[foot, 0]
    record.heading = atan2(y, x)


@kernel
def record_landings(
    truth: RobotTruth,
    goal: CourseGoal,
    record: CourseRecord,
    directions: Array2D,
    params: CourseCriteria,
    constants: StandConstants,
) -> None:
    """Find flights and landings, and measure the place of each landing."""
    if any_loaded(truth.contact_touched):
        record.unloaded = 0.0
        if record.flies:
            record.flies = False
            record.landed_time = record.now
            record.measured = False
    else:
        record.unloaded += constants.period
        if record.unloaded >= params.flight_confirmation and not record.flies:
            record.flies = True
            record.measured = True
        if record.flies:  # until it lands its goal may change
            record.target[:] = goal.position
            record.target_heading = goal.heading
    if record.flies or record.measured or record.landed_time == NEVER:
        return
    if record.now - record.landed_time >= params.measure_time:
        measure_position(record, directions)


@kernel
def measure_position(record: CourseRecord, directions: Array2D) -> None:
    """Compare the place of the feet with the target."""
    find_landing_position(record, directions)
    x, y = record.middle[0] - record.start[0], record.middle[1] - record.start[1]
    sine, cosine = sincos(record.start_heading)
    dx = cosine * x + sine * y - record.target[0]
    dy = cosine * y - sine * x - record.target[1]
    turn = record.heading - record.start_heading - record.target_heading
    u, v = dx - record.off[0], dy - record.off[1]
    record.off[0], record.off[1] = dx, dy
    record.length_errors += sqrt(u * u + v * v)
    record.place_error = sqrt(dx * dx + dy * dy)
    record.place_errors += record.place_error
    record.worst_place_error = max(record.worst_place_error, record.place_error)
    record.worst_turn_error = max(record.worst_turn_error, abs(wrap(turn)))
    record.measured = True
    record.jumps += 1
