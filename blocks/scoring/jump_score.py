"""The one judge of jumps: success by fixed criteria, from what only a simulator knows."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, hypot

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...runtime.language.block import Input, Metric, State
from ...runtime.language.kernel_block import KernelBlock
from ..signals import JumpReference, RobotTruth, WholeBodyCommand
from .footing import Footing
from .jump_criteria import JumpCriteria, JumpRecord, feet_moved, feet_turned, first_failure
from .jump_following import Ending, Reference, Times, Verdict, follow_jump, follow_reference
from .jump_series import Jump, JumpSeries, Planned, Series, series_failure
from .stand_criteria import NEVER
from .stand_following import Stand, Truth, fields_of, following_limits
from .stand_metrics import judgement_metrics, rest_metrics


class JumpScore(KernelBlock):
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
        """Group the contact points by foot, and bind what a tick needs."""
        footing, truth, record = Footing(self.robot), self.truth, self.record
        limits = self.params.for_robot(footing)
        assert isinstance(limits, JumpCriteria)
        self._limits = limits
        self._planned = "reference" in self.context.wired
        clock = self.context.clock
        planned = Planned(*(getattr(record, f"planned_{name}") for name in Planned._fields))
        series = fields_of(Series, self.series)
        reference = fields_of(Reference, self.reference)
        self._verdict = Verdict(np.zeros(1, np.int64), np.zeros(1))
        comparing = KernelCall(
            follow_reference, clock.present, clock.base_period, record.ticks, reference, planned,
            series,
        )  # fmt: skip
        following = KernelCall(
            follow_jump, clock.present, clock.base_period, fields_of(Truth, truth),
            truth.angular_momentum, reference, self.wbc.failures, fields_of(Stand, record),
            fields_of(Jump, record), planned, series,
            following_limits(limits, footing, limits.slip_delay, self.period),
            Times(
                limits.flight_confirmation, limits.rest_time, limits.settle_time,
                limits.slip_delay, limits.jumps, self._planned,
            ),
            self._verdict,
        )  # fmt: skip
        self.kernel_calls = (
            footing.measuring(
                truth.contact_position, truth.base_orientation, record.foot, record.direction
            ),
            *footing.unrolling(truth.joint_position, truth.base_orientation, record.foot),
            *((comparing,) if self._planned else ()),
            following,
        )
        self.event = self._verdict.ending

    def on_event(self) -> None:
        """Ask for the end of the run."""
        landed = float(self._verdict.landed[0])
        self.request_stop(
            {
                Ending.FELL: "the robot fell",
                Ending.ALONE: f"no other jump {landed:.2f} s after touchdown",
                Ending.RESTED: f"{landed:.2f} s after touchdown",
            }[Ending(int(self._verdict.ending[0]))]
        )

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
