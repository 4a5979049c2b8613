"""The one judge of jumps: success by fixed criteria, from the simulator's true state."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from math import degrees, hypot, pi, sqrt

from ...mathematics.arrays import Array0D, Indices0D
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Input, Metric, State
from ...runtime.language.context import Clock
from ...runtime.language.signals import Field, Signal
from ..signals import JumpReference, RobotTruth, WholeBodyCommand
from .footing import BallFeet, Footing, any_loaded
from .jump_criteria import (
    JumpCriteria,
    JumpRecord,
    JumpSeries,
    feet_moved,
    feet_turned,
    first_failure,
    mean_turn,
    series_failure,
)
from .standing import (
    NEVER,
    StandConstants,
    judgement_metrics,
    largest_of,
    record_fall,
    record_feet,
    record_rest,
    record_robot,
    rest_metrics,
)

EARLY_LIFT_OFF = 0.1
"""Feet that leave the ground more than this time [s] before the planned lift-off have bounced."""


class Ending(IntEnum):
    """Reason of a judge to end the run."""

    NONE = 0
    FELL = 1
    ALONE = 2
    """No other jump of a row has come."""
    RESTED = 3


class JumpConstants(StandConstants):
    """Constants of a jump's record, beside its tolerances."""

    planned = Field(dtype="bool", text="there is a reference to compare the jump with")


class RunEnd(Signal):
    """Result of a tick."""

    ending = Field(dtype="int64", values=Ending, text="reason to end the run; see Ending")
    landed = Field(unit="s", text="time after touchdown at which it ends")


class JumpScore(Block):
    """Judges one jump and ends the run. No controller can see it.

    A jump is a success when all of these hold; every tolerance is a parameter:

    1. Nothing but the contact points ever touches the ground, and no leg another.
    2. It does not fall: tilt at most 69 deg, base above the ground by at least 0.315 of the height
       it stands at (0.12 m for BRUCE). A fall ends the run.
    3. Real flight: all contact points unloaded for at least 90 % of the planned flight time, and
       the com's vertical speed at lift-off within 10 % of the plan's. (A flight begins when all
       points have been unloaded for 20 ms, and counts from the beginning of that time.)
    4. No joint ever beyond its limit; every motor torque within what its speed allows.
    5. Tilt after touchdown always below 15 deg (set 45 deg for pushes).
    6. 1.5 s after touchdown: tilt below 5 deg, com slower than 0.05 m/s, base slower than
       0.2 rad/s, every sole flat (all its points loaded, or three of more), each foot with over
       0.4 of an equal share of the weight, com at least 10 mm inside the support polygon.
    7. From 0.15 s after touchdown to the end: no foot unloaded for more than 20 ms, and the
       middle of each foot stays within 5 mm horizontally (set 20 mm for pushes). With ``steps`` the
       feet may take so many steps in all: each is measured from its new place, 0.15 s after its
       last step, and the rest is judged 1.5 s after the last step.
    8. Task: apex above standing within 10 % of its target, feet within 2 cm and 5 deg of theirs;
       every contact point above ground of the ``landing_height``. Targets are the parameters
       ``rise``, ``distance`` and ``yaw``, else the reference's, and without either not judged.

    On ground that is not as level as that of the task (``ground_tolerance``) these differ. The simulator lets soles
    of several points touch the ground between these points, and counts that in its metric
    ``robot_sole_contacts``. Load there is not measured, so rest (6) is judged by what the robot does: tilt
    and speeds; soles need not be flat, and neither load share nor support count. A foot without a loaded point
    counts as off the ground (7) only if all its points are higher above it than the tolerance. The ground under
    a contact point may be so far above or below the ``landing_height``, so a flight (3) may be shorter. In a row
    all jumps but the first lift off from such ground, too, and the apexes may differ by as much.

    A jump begins with its plan: a robot that is put down from a gantry before is not judged.

    The run ends 0.1 s after the rest has been judged. Not judged, but counted: solver failures,
    share of saturated motor samples, peak torque and speed. Metrics: ``success``, ``reason`` (the
    first failed criterion with its figures) and the figures themselves; of the angular momentum at
    lift-off its magnitude and its part about the world's y axis, the robot's pitch as it stood.

    Of several ``jumps`` in a row all the figures above are of the last; those before it must be
    real flights too, with their lift-off speed and apex as planned, and land within
    ``series_distance_tolerance`` and the yaw's tolerance. Feet that leave the ground more than 0.1 s
    before the next planned lift-off count as a bounce. A row that does not go on ends the run 1.5 s
    after its last touchdown.
    """

    Params = JumpCriteria
    Constants = JumpConstants
    Scratch = RunEnd
    needs = ("floating base", "feet")
    params: JumpCriteria
    constants: JumpConstants
    scratch: RunEnd
    truth = Input(RobotTruth, reads_truth=True, text="true state of the robot")
    reference = Input(JumpReference, default={}, text="the planned jump, for its targets")
    wbc = Input(WholeBodyCommand, default={}, text="the controller's answers, to count failures")
    record = State(JumpRecord, text="everything the judgement needs")
    series = State(JumpSeries, text="the jumps of a row that are over")

    def setup(self) -> None:
        footing = Footing(self.robot)
        self.balls = footing.ball_feet()
        criteria = self.params.for_robot(footing)
        assert isinstance(criteria, JumpCriteria)
        self._criteria = criteria
        self.constants.fill(footing, criteria, criteria.slip_delay, self.period)
        if criteria.ground_tolerance:
            self.constants.clearance = criteria.ground_tolerance
        self.constants.planned = "reference" in self.context.wired

    @kernel
    @staticmethod
    def step(
        truth: RobotTruth,
        reference: JumpReference,
        wbc: WholeBodyCommand,
        record: JumpRecord,
        series: JumpSeries,
        balls: BallFeet,
        params: JumpCriteria,
        constants: JumpConstants,
        scratch: RunEnd,
        clock: Clock,
    ) -> bool:
        now, first = clock.base_period * clock.tick, record.ticks == 0
        scratch.ending = Ending.NONE
        if constants.planned and reference.time < 0.0:
            return False
        record_robot(now, truth, wbc, record, balls, constants)
        if constants.planned:
            record_reference(now, first, reference, record, series)
        if first:
            begin_jump(truth, record)
        if record_fall(truth, record, params, constants):
            scratch.ending = Ending.FELL
        early = reference.time < reference.lift_off_time - EARLY_LIFT_OFF
        bounces = constants.planned and series.made > 0 and early
        record_flight(truth, record, series, params, constants, bounces)
        if record.touchdown_time != NEVER:
            record_landing(truth, record, params, constants, scratch)
        elif series.made != 0:
            record_row(truth, record, series, params, constants, scratch)
        record.vertical_speed = truth.com_velocity[2]
        return bool(scratch.ending != Ending.NONE)

    def on_event(self) -> None:
        """Ask for the end of the run."""
        landed = float(self.scratch.landed)
        self.request_stop(
            {
                Ending.FELL: "the robot fell",
                Ending.ALONE: f"no other jump {landed:.2f} s after touchdown",
                Ending.RESTED: f"{landed:.2f} s after touchdown",
            }[Ending(int(self.scratch.ending))]
        )

    def metrics(self) -> Mapping[str, Metric]:
        """Return the judgement and its figures."""
        record = self.record
        if record.ticks == 0:
            waits = self.constants.planned and self.reference.time < 0.0
            reason = "the plan has not begun" if waits else "the run had no ticks"
            return {"success": False, "reason": reason}
        planned = bool(self.constants.planned)
        failure = first_failure(record, self._criteria, planned)
        made = int(self.series.made) + int(record.touchdown_time != NEVER)
        if self.params.jumps > 1 and record.fall_time == NEVER and not record.forbidden:
            failure = series_failure(self.series, self.params, made) or failure
        x, y = feet_moved(record)
        flown = record.lift_off_time != NEVER
        landed = record.touchdown_time != NEVER
        judged = record.judged_time != NEVER
        values = judgement_metrics(record, failure)
        if self.params.jumps > 1:
            values |= {"jumps": made, "worst_landing_error_m": float(self.series.place_error)}
        if flown:
            values |= {
                "apex_above_standing_m": float(record.apex_height - record.standing_height),
                "apex_from_squat_m": float(record.apex_height - record.squat_height),
                "lift_off_speed_m_s": float(record.lift_off_speed),
                "lift_off_angular_momentum_nms": hypot(*record.lift_off_momentum.tolist()),
                "lift_off_pitch_momentum_nms": record.lift_off_momentum.item(1),
            }
        if landed:
            values |= {
                "touchdown_speed_m_s": float(record.touchdown_speed),
                "flight_time_s": float(record.touchdown_time - record.lift_off_time),
                "peak_tilt_deg": degrees(record.peak_tilt),
                "foot_slip_m": float(record.foot_slip),
                "steps": int(record.steps),
                "jump_distance_x_m": x,
                "jump_distance_y_m": y,
                "jump_yaw_deg": degrees(feet_turned(record)),
            }
        if judged:
            values |= rest_metrics(record)
        if planned:
            values |= {
                "planned_flight_time_s": float(record.planned_flight),
                "planned_lift_off_speed_m_s": float(record.planned_speed),
                "planned_apex_above_standing_m": float(
                    record.planned_apex - record.planned_standing
                ),
            }
        return values


@kernel
def record_reference(
    now: float, first: bool, reference: JumpReference, record: JumpRecord, series: JumpSeries
) -> None:
    """Record what the reference plans: its flight, its apex, and where the feet should be."""
    feet, turn, height = record.planned_foot.shape[0], 0.0, reference.com[2]
    record.planned_foot[:] = reference.foot_position[:, :2]
    for foot in range(feet):
        turn += reference.foot_yaw[foot]
    record.planned_yaw = turn / feet
    if first:
        record.planned_start[:] = record.planned_foot
        record.planned_yaw_start = record.planned_yaw
        record.planned_standing = height
        record.planned_apex = height
        record.planned_speed_time = NEVER
    record.planned_apex = max(record.planned_apex, height)
    time, lift_off = reference.time, reference.lift_off_time
    taken_off = lift_off - 1e-9 <= time < reference.touchdown_time
    fresh = record.planned_speed_time == NEVER
    if fresh or taken_off:  # from the middle of a flight on the reference names the next
        record.planned_flight = reference.touchdown_time - lift_off
    later = lift_off > series.planned_lift_off
    if taken_off and (fresh or later):
        series.planned_lift_off = lift_off
        if not fresh:
            record.planned_apex = height
        record.planned_speed_time = now
        # The plan's own ballistic flight takes it back to the planned instant.
        record.planned_speed = reference.com_velocity[2] + GRAVITY * (time - lift_off)


@kernel
def begin_jump(truth: RobotTruth, record: JumpRecord) -> None:
    """Begin the record of a jump in its first tick."""
    record.unloaded_time = NEVER
    record.lift_off_time = NEVER
    record.touchdown_time = NEVER
    record.planned_speed_time = NEVER
    record.squat_height = truth.com[2]
    record.apex_height = truth.com[2]
    record.start_foot[:] = record.foot
    record.start_direction[:] = record.direction


@kernel
def record_flight(
    truth: RobotTruth,
    record: JumpRecord,
    series: JumpSeries,
    params: JumpCriteria,
    constants: JumpConstants,
    bounces: bool,
) -> None:
    """Record lift-off, apex and touchdown, by the simulator's contacts.

    ``bounces`` means that a foot off the ground would be no lift-off: it is between two jumps.
    """
    height, now, loaded = truth.com[2], record.now, any_loaded(truth.contact_touched)
    if record.lift_off_time == NEVER:
        record.squat_height = min(record.squat_height, height)
        if loaded or bounces:
            record.unloaded_time = NEVER
            return
        if record.unloaded_time == NEVER:
            # Nothing touched during the whole of the tick before.
            record.unloaded_time = max(0.0, now - constants.period)
            record.unloaded_speed = record.vertical_speed if now > 0.0 else truth.com_velocity[2]
            record.unloaded_momentum[:] = truth.angular_momentum
            record.apex_height = height
        if now - record.unloaded_time >= params.flight_confirmation - 1e-9:
            record.lift_off_time = record.unloaded_time
            record.lift_off_speed = record.unloaded_speed
            record.lift_off_momentum[:] = record.unloaded_momentum
            if series.made != 0:
                keep_position(series)
    elif record.touchdown_time == NEVER and loaded:
        record.touchdown_time = now - constants.period
        record.touchdown_speed = -record.vertical_speed
        if series.made + 1 < params.jumps:  # more jumps must follow
            record_jump(record, series, params, constants.planned)
            record.peak_tilt = 0.0
            return
    if record.touchdown_time == NEVER:
        record.apex_height = max(record.apex_height, height)


@kernel
def record_landing(
    truth: RobotTruth,
    record: JumpRecord,
    params: JumpCriteria,
    constants: JumpConstants,
    scratch: RunEnd,
) -> None:
    """Peaks since touchdown, feet that slide or step, and the rest when its time comes."""
    landed = record.now - record.touchdown_time
    stay = landed >= params.slip_delay - 1e-9
    record.peak_tilt = max(record.peak_tilt, tilt(truth.base_orientation))
    record_feet(truth, record, params, constants, stay)
    if record.steps != 0:
        landed = min(landed, record.now - largest_of(record.step_end))
    if record.judged_time == NEVER and landed >= params.rest_time - 1e-9:
        record_rest(truth, record, constants)
        record.ground_low = truth.ground_height[0]
        record.ground_high = truth.ground_height[0]
        for point in range(1, truth.ground_height.shape[0]):
            record.ground_low = min(record.ground_low, truth.ground_height[point])
            record.ground_high = max(record.ground_high, truth.ground_height[point])
    if landed >= params.rest_time + params.settle_time - 1e-9:
        end_run(scratch, Ending.RESTED, landed)


@kernel
def record_row(
    truth: RobotTruth,
    record: JumpRecord,
    series: JumpSeries,
    params: JumpCriteria,
    constants: JumpConstants,
    scratch: RunEnd,
) -> None:
    """Between two jumps: where the feet stand, and whether another comes."""
    if constants.planned and any_loaded(truth.contact_touched):
        compare_landing_position(record, series)
    landed = record.now - series.landed_time
    if record.lift_off_time == NEVER and landed >= params.rest_time - 1e-9:
        end_run(scratch, Ending.ALONE, landed)


@kernel
def end_run(scratch: RunEnd, ending: int, landed: float) -> None:
    """Ask for the end of the run, unless the same tick has asked for it already."""
    if scratch.ending == Ending.NONE:
        scratch.ending = ending
        scratch.landed = landed


@kernel
def record_jump(
    record: JumpRecord, series: JumpSeries, params: JumpCriteria, planned: bool
) -> None:
    """Record a jump of a row that has touched down, and prepare for the next lift-off.

    ``planned`` means that there is a reference to compare the jump with. All but the first may lift off from
    ground that is higher or lower than that of the task, and all may land there.
    """
    made = series.made + 1
    series.made = made
    series.landed_time = record.touchdown_time
    if made == 1:
        series.flight_share = 1e9
    if planned:
        flight = record.touchdown_time - record.lift_off_time
        off = params.ground_tolerance
        below = 0.0
        if made > 1:
            below = off
        flight += (off + below) / max(abs(record.planned_speed), 1e-9)
        share = flight / max(record.planned_flight, 1e-9)
        if share < series.flight_share:
            series.flight_share = share
            series.flight_jump = made
        speed = record.planned_speed
        error = abs(record.lift_off_speed - speed) / max(abs(speed), 1e-9)
        keep_worst(series.speed_error, series.speed_jump, error, made)
        rise = record.planned_apex - record.planned_standing
        error = abs(record.apex_height - record.standing_height - rise)
        error = max(error - below, 0.0) / max(rise, 1e-9)
        keep_worst(series.rise_error, series.rise_jump, error, made)
    record.lift_off_time = NEVER
    record.touchdown_time = NEVER
    record.unloaded_time = NEVER


@kernel
def compare_landing_position(record: JumpRecord, series: JumpSeries) -> None:
    """Compare the feet with their planned positions and headings, between two jumps."""
    x, y, feet = 0.0, 0.0, record.foot.shape[0]
    for k in range(feet):
        moved = record.foot[k, 0] - record.start_foot[k, 0]
        x += (moved - (record.planned_foot[k, 0] - record.planned_start[k, 0])) / feet
        moved = record.foot[k, 1] - record.start_foot[k, 1]
        y += (moved - (record.planned_foot[k, 1] - record.planned_start[k, 1])) / feet
    series.place_now = sqrt(x * x + y * y)
    turn = record.planned_yaw - record.planned_yaw_start
    error = abs(mean_turn(record.start_direction, record.direction) - turn)
    # Half a turn to the left is the same as half a turn to the right.
    series.turn_now = abs(error - 2.0 * pi) if error > pi else error


@kernel
def keep_position(series: JumpSeries) -> None:
    """Keep the last landing's error if it is the largest, when the next jump lifts off."""
    keep_worst(series.place_error, series.place_jump, series.place_now, series.made)
    keep_worst(series.turn_error, series.turn_jump, series.turn_now, series.made)


@kernel
def keep_worst(worst: Array0D, of_jump: Indices0D, error: float, jump: int) -> None:
    """``error`` becomes the ``worst`` one if it is larger, and ``jump`` the number of its jump."""
    if error > worst[()]:
        worst[()] = error
        of_jump[()] = jump
