"""The one judge of jumps: success by fixed criteria, from what only a simulator knows."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, hypot

from ...mathematics.constants import GRAVITY
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Input, Metric, State
from ..signals import JumpReference, RobotTruth, WholeBodyCommand
from .footing import Footing
from .jump_criteria import JumpCriteria, JumpRecord, feet_moved, feet_turned, first_failure
from .jump_series import (
    EARLY_LIFT_OFF,
    JumpSeries,
    goes_on,
    keep_place,
    note_landing,
    note_place,
    series_failure,
)
from .stand_criteria import NEVER
from .stand_following import begin, note_fall, note_feet, note_machine, note_rest
from .stand_metrics import judgement_metrics, rest_metrics


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
    needs = ("floating base", "feet")
    params: JumpCriteria
    truth = Input(RobotTruth, reads_truth=True, text="what the simulator knows")
    reference = Input(JumpReference, default={}, text="the planned jump, for its targets")
    wbc = Input(WholeBodyCommand, default={}, text="the controller's answers, to count failures")
    record = State(JumpRecord, text="everything the judgement needs")
    series = State(JumpSeries, text="the jumps of a row that are over")

    def setup(self) -> None:
        """Group the contact points by foot."""
        self._footing = Footing(self.robot)
        limits = self.params.for_robot(self._footing)
        assert isinstance(limits, JumpCriteria)
        self._limits = limits
        self._planned = "reference" in self.context.wired

    def step(self) -> None:
        """Follow the jump by one tick."""
        record, truth = self.record, self.truth
        time = self.time
        first = record.ticks == 0
        record.now[()] = time
        self._footing.measure(
            truth.contact_position, truth.base_orientation, record.foot, record.direction
        )
        self._footing.unroll(truth.joint_position, truth.base_orientation, record.foot)
        if self._planned:
            self._follow_reference(time, first)
        if first:
            self._begin()
        record.ticks += 1
        note_machine(record, truth)
        record.failures[()] = self.wbc.failures
        if note_fall(record, truth, self._limits):
            self.request_stop("the robot fell")
        self._follow_flight(time)
        if record.touchdown_time != NEVER:
            self._follow_landing(time - float(record.touchdown_time))
        elif self.series.made:
            self._follow_row(time)
        record.vertical_speed[()] = truth.com_velocity.item(2)

    def metrics(self) -> Mapping[str, Metric]:
        """The judgement and its figures."""
        record = self.record
        if record.ticks == 0:
            return {"success": False, "reason": "the run had no ticks"}
        failure = first_failure(record, self._limits, self._planned)
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
        if self._planned:
            values |= {
                "planned_flight_time_s": float(record.planned_flight),
                "planned_lift_off_speed_m_s": float(record.planned_speed),
                "planned_apex_above_standing_m": float(
                    record.planned_apex - record.planned_standing
                ),
            }
        return values

    def _begin(self) -> None:
        record, height = self.record, self.truth.com[2]
        begin(record, self.truth)
        for instant in (
            record.unloaded_time, record.lift_off_time, record.touchdown_time,
            record.planned_speed_time,
        ):  # fmt: skip
            instant[()] = NEVER
        for start in (record.squat_height, record.apex_height):
            start[()] = height
        record.start_foot[:] = record.foot
        record.start_direction[:] = record.direction

    def _follow_reference(self, time: float, first: bool) -> None:
        record, plan = self.record, self.reference
        yaw = sum(plan.foot_yaw.tolist()) / len(self._footing.points_of_foot)
        record.planned_foot[:] = plan.foot_position[:, :2]
        record.planned_yaw[()] = yaw
        height = plan.com.item(2)
        if first:
            record.planned_start[:] = record.planned_foot
            record.planned_yaw_start[()] = yaw
            record.planned_standing[()] = height
            record.planned_apex[()] = height
            record.planned_speed_time[()] = NEVER
        record.planned_apex[()] = max(record.planned_apex.item(), height)
        taken_off = plan.lift_off_time - 1e-9 <= plan.time < plan.touchdown_time
        fresh = record.planned_speed_time == NEVER
        if fresh or taken_off:  # from the middle of a flight on the reference names the next
            record.planned_flight[()] = plan.touchdown_time - plan.lift_off_time
        later = plan.lift_off_time > self.series.planned_lift_off
        if taken_off and (fresh or later):
            self.series.planned_lift_off[()] = plan.lift_off_time
            record.planned_apex[()] = height if not fresh else record.planned_apex.item()
            record.planned_speed_time[()] = time
            # The plan's own ballistic flight takes it back to the planned instant.
            late = plan.time.item() - plan.lift_off_time.item()
            record.planned_speed[()] = plan.com_velocity.item(2) + GRAVITY * late

    def _follow_flight(self, time: float) -> None:
        """Lift-off, apex and touchdown, by the simulator's contacts."""
        record, truth = self.record, self.truth
        height, speed = truth.com.item(2), truth.com_velocity.item(2)
        touched = any(truth.contact_touched.tolist())
        if record.lift_off_time == NEVER:
            touched = touched or self._bounces()
            record.squat_height[()] = min(record.squat_height.item(), height)
            if touched:
                record.unloaded_time[()] = NEVER
                return
            if record.unloaded_time == NEVER:
                # Nothing touched during the whole of the tick before.
                record.unloaded_time[()] = max(0.0, time - self.period)
                record.unloaded_speed[()] = record.vertical_speed if time > 0.0 else speed
                record.unloaded_momentum[:] = truth.angular_momentum
                record.apex_height[()] = height
            if time - record.unloaded_time.item() >= self.params.flight_confirmation - 1e-9:
                record.lift_off_time[()] = record.unloaded_time
                record.lift_off_speed[()] = record.unloaded_speed
                record.lift_off_momentum[:] = record.unloaded_momentum
                if self.series.made:
                    keep_place(self.series)
        elif record.touchdown_time == NEVER and touched:
            record.touchdown_time[()] = time - self.period
            record.touchdown_speed[()] = -record.vertical_speed
            if goes_on(self.series, self.params):
                note_landing(record, self.series, self._planned)
                return
        if record.touchdown_time == NEVER:
            record.apex_height[()] = max(record.apex_height.item(), height)

    def _bounces(self) -> bool:
        """Whether a foot off the ground between two jumps is no lift-off."""
        plan = self.reference
        early = float(plan.time) < float(plan.lift_off_time) - EARLY_LIFT_OFF
        return self._planned and bool(self.series.made) and early

    def _follow_row(self, time: float) -> None:
        """Between two jumps: where the feet stand, and whether another comes."""
        if self._planned and any(self.truth.contact_touched.tolist()):
            note_place(self.record, self.series)
        landed = time - float(self.series.landed_time)
        if self.record.lift_off_time == NEVER and landed >= self.params.rest_time - 1e-9:
            self.request_stop(f"no other jump {landed:.2f} s after touchdown")

    def _follow_landing(self, landed: float) -> None:
        """Peaks since touchdown, feet that slide or step, and the rest when its time comes."""
        record, truth, params = self.record, self.truth, self.params
        record.peak_tilt[()] = max(record.peak_tilt.item(), tilt(truth.base_orientation))
        note_feet(
            record, truth, self._footing, self.period, landed >= params.slip_delay - 1e-9,
            params, params.slip_delay,
        )  # fmt: skip
        if record.steps:
            landed = min(landed, float(record.now) - max(record.step_end.tolist()))
        if record.judged_time == NEVER and landed >= params.rest_time - 1e-9:
            note_rest(record, truth, self._footing)
            record.ground_low[()] = min(truth.ground_height.tolist())
            record.ground_high[()] = max(truth.ground_height.tolist())
        if landed >= params.rest_time + params.settle_time - 1e-9:
            self.request_stop(f"{landed:.2f} s after touchdown")
