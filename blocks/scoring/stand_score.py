"""The judge of robots that should stand, squat or take a push without falling."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees

from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Input, Metric, State
from ...runtime.language.context import Clock
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field
from ..signals import JumpReference, RobotTruth, WholeBodyCommand
from .footing import BallFeet, Footing
from .standing import (
    NEVER,
    SETTLING,
    StandConstants,
    StandCriteria,
    StandRecord,
    Verdict,
    judge_feet,
    judge_machine,
    judge_rest,
    judge_safety,
    judgement_metrics,
    record_fall,
    record_feet,
    record_rest,
    record_robot,
    rest_metrics,
)


class SquatRecord(StandRecord):
    """Record for the judgement of a stance or a squat."""

    lowest_height = Field(unit="m", text="least height of the com so far")
    planned_standing = Field(unit="m", text="com height of the reference at the start")
    planned_lowest = Field(unit="m", text="least com height of the reference so far")


class SquatCriteria(StandCriteria):
    """The tolerances of a successful stance or squat."""

    judge_time: float = parameter(
        3.0, unit="s", gt=0, text="time at which the rest is judged, and the run ends"
    )
    settle_time: float = parameter(
        0.3, unit="s", ge=0, text="the robot may settle on the ground for so long"
    )
    squat_depth: float | None = parameter(
        None, unit="m", ge=0, text="nominal descent of the com; by default as the reference"
    )
    depth_tolerance: float = parameter(0.1, ge=0, text="of that depth, as a share of it")


class StandScore(Block):
    """Judges a robot that stands, squats or takes a push, and ends the run. No controller sees it.

    It is a success when all of these hold, which are those of a jump that concern standing;
    every tolerance is a parameter:

    1. Nothing but the contact points ever touches the ground, and no leg another.
    2. It does not fall: tilt at most 69 deg, base above the ground by at least 0.315 of the height
       it stands at. A fall ends the run.
    3. No joint is ever beyond its limit; every motor torque is within what its speed allows.
    4. From ``settle_time`` on: tilt always below 15 deg (set 45 deg for pushes); no foot unloaded
       for more than 20 ms; the middle of each foot within 5 mm horizontally (set 20 mm for pushes).
    5. At ``judge_time``: tilt below 5 deg, com slower than 0.05 m/s, base slower than 0.2 rad/s,
       every sole flat (all its points loaded, or three of more), each foot with over 0.4 of an
       equal share of the weight, com at least 10 mm inside the support polygon.
    6. The com has gone down by ``squat_depth``, or else as far as the reference's, within 10 %.
       Without either this is not judged, nor for a depth of less than 1 mm.

    The run ends once the rest has been judged. Metrics: ``success``, ``reason`` (the first failed
    criterion with its figures) and the figures themselves.
    """

    Params = SquatCriteria
    Constants = StandConstants
    needs = ("floating base", "feet")
    params: SquatCriteria
    constants: StandConstants
    truth = Input(RobotTruth, reads_truth=True, text="true state of the robot")
    reference = Input(JumpReference, default={}, text="the planned squat, for its depth")
    wbc = Input(WholeBodyCommand, default={}, text="the controller's answers, to count failures")
    record = State(SquatRecord, text="everything the judgement needs")

    def setup(self) -> None:
        footing = Footing(self.robot)
        self.balls = footing.ball_feet()
        self._criteria = self.params.for_robot(footing)
        self._planned = "reference" in self.context.wired
        self.constants.fill(footing, self._criteria, SETTLING, self.period)

    @kernel
    @staticmethod
    def step(
        truth: RobotTruth,
        reference: JumpReference,
        wbc: WholeBodyCommand,
        record: SquatRecord,
        balls: BallFeet,
        params: SquatCriteria,
        constants: StandConstants,
        clock: Clock,
    ) -> bool:
        now, height, planned = clock.base_period * clock.tick, truth.com[2], reference.com[2]
        if record.ticks == 0:
            record.lowest_height = height
            record.planned_standing = planned
            record.planned_lowest = planned
        record_robot(now, truth, wbc, record, balls, constants)
        fell = record_fall(truth, record, params, constants)
        record.lowest_height = min(record.lowest_height, height)
        record.planned_lowest = min(record.planned_lowest, planned)
        settled = now >= params.settle_time - 1e-9
        if settled:
            record.peak_tilt = max(record.peak_tilt, tilt(truth.base_orientation))
        record_feet(truth, record, params, constants, settled)
        judged = record.judged_time == NEVER and now >= params.judge_time - 1e-9
        if judged:
            record_rest(truth, record, constants)
        return fell or judged

    def on_event(self) -> None:
        """Ask for the end of the run."""
        fell = self.record.fall_time == self.record.now
        self.request_stop("the robot fell" if fell else f"judged at {self.time:.2f} s")

    def metrics(self) -> Mapping[str, Metric]:
        """Return the judgement and its figures."""
        record = self.record
        if record.ticks == 0:
            return {"success": False, "reason": "the run had no ticks"}
        failure = next((text for holds, text in self._judge() if not holds), None)
        values = judgement_metrics(record, failure) | {
            "squat_depth_m": float(record.standing_height - record.lowest_height),
            "peak_tilt_deg": degrees(record.peak_tilt),
            "foot_slip_m": float(record.foot_slip),
        }
        if record.judged_time != NEVER:
            values |= rest_metrics(record)
        return values

    def _judge(self) -> Iterator[Verdict]:
        """Every criterion, in the order in which a failure explains those behind it."""
        r, c = self.record, self._criteria
        yield from judge_safety(r, c)
        yield from judge_machine(r, c)
        yield (
            r.judged_time != NEVER,
            f"the run ended at {r.now:.3f} s, before {self.params.judge_time} s",
        )
        yield from judge_rest(r, c, "while it should stand")
        yield from judge_feet(r, c, "while it should stand")
        depth, target = float(r.standing_height - r.lowest_height), self.params.squat_depth
        if target is None and self._planned:
            target = float(r.planned_standing - r.planned_lowest)
        if target is not None and target >= 1e-3:
            tolerance = self.params.depth_tolerance
            yield (
                abs(depth - target) <= tolerance * target,
                (
                    f"squatted by {1e3 * depth:.1f} mm, not within {tolerance:.0%} of "
                    f"{1e3 * target:.1f} mm"
                ),
            )
