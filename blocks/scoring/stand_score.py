"""The judge of robots that should stand, squat or take a push without falling."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array0D, Array1D, Indices0D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Input, Metric, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field
from ..signals import JumpReference, RobotTruth, WholeBodyCommand
from .footing import Footing
from .stand_criteria import (
    NEVER,
    StandCriteria,
    StandRecord,
    Verdict,
    judge_feet,
    judge_machine,
    judge_rest,
    judge_safety,
)
from .stand_following import (
    Limits,
    Stand,
    Truth,
    begin,
    fields_of,
    following_limits,
    keep_largest,
    keep_least,
    note_fall,
    note_feet,
    note_machine,
    note_rest,
)
from .stand_metrics import judgement_metrics, rest_metrics

SETTLING = 0.15
"""A foot that has taken a step may settle for so long [s]."""
_FELL, _JUDGED = 1, 2
"""Why the end of the run is asked for."""


class SquatRecord(StandRecord):
    """What the judgement of a stance or a squat needs."""

    lowest_height = Field(unit="m", text="least height of the com so far")
    planned_standing = Field(unit="m", text="com height of the reference at the start")
    planned_lowest = Field(unit="m", text="least com height of the reference so far")


class Squat(NamedTuple):
    """The fields of ``SquatRecord`` beside those of ``StandRecord``."""

    lowest_height: Array0D
    planned_standing: Array0D
    planned_lowest: Array0D


class SquatCriteria(StandCriteria):
    """The tolerances of a successful stance or squat."""

    judge_time: float = parameter(
        3.0, unit="s", gt=0, text="when the rest is judged, and the run ends"
    )
    settle_time: float = parameter(
        0.3, unit="s", ge=0, text="the robot may settle on the ground for so long"
    )
    squat_depth: float | None = parameter(
        None, unit="m", ge=0, text="how far the com should go down; by default as the reference"
    )
    depth_tolerance: float = parameter(0.1, ge=0, text="of that depth, as a share of it")


class StandScore(KernelBlock):
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
    needs = ("floating base", "feet")
    params: SquatCriteria
    truth = Input(RobotTruth, reads_truth=True, text="what the simulator knows")
    reference = Input(JumpReference, default={}, text="the planned squat, for its depth")
    wbc = Input(WholeBodyCommand, default={}, text="the controller's answers, to count failures")
    record = State(SquatRecord, text="everything the judgement needs")

    def setup(self) -> None:
        """Group the contact points by foot, and bind what a tick needs."""
        footing, truth, record = Footing(self.robot), self.truth, self.record
        self._limits = self.params.for_robot(footing)
        self._planned = "reference" in self.context.wired
        clock, params = self.context.clock, self.params
        self._ending = np.zeros(1, np.int64)
        following = KernelCall(
            follow_stand, clock.present, clock.base_period, fields_of(Truth, truth),
            self.reference.com, self.wbc.failures, fields_of(Stand, record),
            fields_of(Squat, record), following_limits(self._limits, footing, SETTLING, self.period),
            params.settle_time, params.judge_time, self._ending,
        )  # fmt: skip
        self.kernel_calls = (
            footing.measuring(
                truth.contact_position, truth.base_orientation, record.foot, record.direction
            ),
            *footing.unrolling(truth.joint_position, truth.base_orientation, record.foot),
            following,
        )
        self.event = self._ending

    def on_event(self) -> None:
        """Ask for the end of the run."""
        fell = self._ending[0] == _FELL
        self.request_stop("the robot fell" if fell else f"judged at {self.time:.2f} s")

    def metrics(self) -> Mapping[str, Metric]:
        """The judgement and its figures."""
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
        r, c = self.record, self._limits
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


@kernel
def follow_stand(
    tick: Indices1D,
    base_period: float,
    truth: Truth,
    planned_com: Array1D,
    failures: Indices0D,
    stand: Stand,
    squat: Squat,
    limits: Limits,
    settle_time: float,
    judge_time: float,
    ending: Indices1D,
) -> None:
    """Follow a robot on its feet by one tick, once these have been measured.

    Args:
        tick: the present tick, (1,), each of ``base_period`` [s].
        planned_com: the reference's [m], (3,).
        failures: of the solver so far, without a dimension.
        settle_time, judge_time: of ``SquatCriteria`` [s].
        ending: becomes why the end of the run is asked for, or zero, (1,).
    """
    now, height, planned = base_period * tick[0], truth.com[2], planned_com[2]
    stand.now[()] = now
    if stand.ticks[()] == 0:
        begin(stand, truth)
        squat.lowest_height[()] = height
        squat.planned_standing[()] = squat.planned_lowest[()] = planned
    stand.ticks[()] = stand.ticks[()] + 1
    note_machine(stand, truth)
    stand.failures[()] = failures[()]
    ending[0] = _FELL if note_fall(stand, truth, limits) else 0
    keep_least(squat.lowest_height, height)
    keep_least(squat.planned_lowest, planned)
    settled = now >= settle_time - 1e-9
    if settled:
        keep_largest(stand.peak_tilt, tilt(truth.base_orientation))
    note_feet(stand, truth.contact_touched, limits, settled)
    if stand.judged_time[()] == NEVER and now >= judge_time - 1e-9:
        note_rest(stand, truth, limits)
        if ending[0] == 0:
            ending[0] = _JUDGED
