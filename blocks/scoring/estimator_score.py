"""Measures the errors of the estimated base: at lift-off, in flight, at touchdown, at the end."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Literal

from ...mathematics.elementary import cos, sin
from ...mathematics.kernel import kernel
from ...mathematics.rotations import conjugate, logarithm, multiply, rotate, yaw
from ...runtime.language.block import Block, Input, Metric, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, RobotTruth
from .footing import any_loaded, magnitude

KINDS = 5
"""Position, velocity, attitude and its two parts tilt and yaw, in this order."""
_NAMES = (
    ("position", "m"), ("velocity", "m_s"), ("attitude", "rad"), ("tilt", "rad"), ("yaw", "rad"),
)  # fmt: skip


class EstimatorRecord(Signal):
    """Errors so far, each an array of position [m], velocity [m/s], attitude, tilt, yaw [rad]."""

    ticks = Field(dtype="int64", text="ticks compared")
    square_sum = Field(KINDS, text="sum of all squared errors")
    peak = Field(KINDS, text="largest errors")
    last = Field(KINDS, text="errors of the present tick")
    unloaded_ticks = Field(dtype="int64", text="ticks in a row in which no point was loaded")
    unloaded_error = Field(KINDS, text="errors in the first of these ticks")
    unloaded_square_sum = Field(KINDS, text="sum of the squared errors in these ticks")
    unloaded_peak = Field(KINDS, text="largest errors in these ticks")
    flights = Field(dtype="int64", text="flights that have begun")
    flight_ticks = Field(dtype="int64", text="ticks in ended flights")
    flight_square_sum = Field(KINDS, text="sum of the squared errors in ended flights")
    flight_peak = Field(KINDS, text="largest errors in ended flights")
    lift_off = Field(KINDS, text="errors at the last lift-off")
    touchdown = Field(KINDS, text="errors at the last touchdown")
    landings = Field(dtype="int64", text="flights that have ended")
    yaw = Field(
        unit="rad", text="from the estimate's world to that of the truth, by its first sample"
    )
    start = Field(3, unit="m", text="first estimated place, in the estimate's world")
    true_start = Field(3, unit="m", text="first true place, in the world of the truth")


class EstimatorScratch(Signal):
    """Intermediate values of a tick."""

    error = Field(3, text="of a position, a velocity or an orientation")
    squares = Field(KINDS, text="of the errors of the tick")
    turn = Field(4, unit="", text="from the true to the estimated orientation")
    position = Field(3, unit="m", text="estimated place in the world of the truth")
    velocity = Field(3, unit="m/s", text="estimated velocity there")
    orientation = Field(4, unit="", text="estimated orientation there")


class EstimatorScore(Block):
    """Compares the estimated base with the true one. No controller can see it.

    Errors are Euclidean norms: of position [m] and of velocity [m/s] in the world, and of the
    rotation vector [rad, world] from the true to the estimated orientation, whole (``attitude``)
    and by its parts about the horizontal axes (``tilt``) and about the vertical one (``yaw``).

    A flight begins in the first tick in which no contact point was loaded and counts as one once
    that has lasted ``flight_confirmation``; it ends when a point is loaded again. Lift-off is the
    first tick of the flight and touchdown the last, just before the impact.

    Metrics, each for ``position``, ``velocity``, ``attitude``, ``tilt`` and ``yaw``, with its unit
    at the end of the name: ``estimator_position_rms_m`` and ``_peak_m`` over the run,
    ``_flight_rms_m`` and ``_flight_peak_m`` over all flights, ``_lift_off_m`` and
    ``_touchdown_m`` of the last flight, ``_end_m`` at the end of the run. ``estimator_flights``
    counts the flights, so after several jumps ``_end_m`` is the drift over that many.

    With ``align: start`` the estimate is turned about the vertical and moved so that its first sample has the true yaw and place: for
    motion capture, whose world is its own.

    Put it into a graph with ``include: [scores/estimator.yaml]``.
    """

    class Params(Parameters):
        flight_confirmation: float = parameter(
            0.02, unit="s", gt=0, text="all points unloaded for this long is a flight"
        )
        align: Literal["world", "start"] = parameter(
            "world",
            text="the truth is in the estimate's world, or, by motion capture, in one that place and yaw of the first sample give",
        )

    Scratch = EstimatorScratch
    params: Params
    truth = Input(RobotTruth, reads_truth=True, text="true state of the robot")
    base = Input(BaseState, text="estimate of the base")
    record = State(EstimatorRecord, text="the errors so far")

    @kernel
    @staticmethod
    def step(
        truth: RobotTruth,
        base: BaseState,
        record: EstimatorRecord,
        params: Params,
        scratch: EstimatorScratch,
        period: float,
    ) -> None:
        align_base(base, truth, record, scratch, params.align == "start")
        find_errors(truth, record, scratch)
        errors, squares = record.last, scratch.squares
        squares[:] = errors * errors
        record.ticks += 1
        record.square_sum[:] += squares
        record.peak[:] = max(record.peak, errors)
        confirmed = is_flight(record, params.flight_confirmation, period)
        if any_loaded(truth.contact_touched):
            if confirmed:
                record_landing(record)
            record.unloaded_ticks = 0
            return
        if record.unloaded_ticks == 0:
            record.unloaded_error[:] = errors
            record.unloaded_square_sum[:] = 0.0
            record.unloaded_peak[:] = 0.0
        record.unloaded_ticks += 1
        record.unloaded_square_sum[:] += squares
        record.unloaded_peak[:] = max(record.unloaded_peak, errors)
        if not is_flight(record, params.flight_confirmation, period):
            return
        if not confirmed:
            record.flights += 1
            record.lift_off[:] = record.unloaded_error
        # The last tick before a point is loaded again is the touchdown.
        record.touchdown[:] = errors

    def metrics(self) -> Mapping[str, Metric]:
        """Return the errors by name."""
        record = self.record
        ticks, values = int(record.ticks), dict[str, Metric]()
        values["estimator_flights"] = int(record.flights)
        for kind, (name, unit) in enumerate(_NAMES):

            def put(what: str, value: float, name: str = name, unit: str = unit) -> None:
                values[f"estimator_{name}_{what}_{unit}"] = value

            if ticks:
                put("rms", sqrt(record.square_sum.item(kind) / ticks))
                put("peak", record.peak.item(kind))
                put("end", record.last.item(kind))
            if record.flights:
                put("lift_off", record.lift_off.item(kind))
            if record.landings:
                flown = int(record.flight_ticks)
                put("flight_rms", sqrt(record.flight_square_sum.item(kind) / flown))
                put("flight_peak", record.flight_peak.item(kind))
                put("touchdown", record.touchdown.item(kind))
        return values


@kernel
def align_base(
    base: BaseState,
    truth: RobotTruth,
    record: EstimatorRecord,
    scratch: EstimatorScratch,
    by_start: bool,
) -> None:
    """Turn the estimate into the world of the truth: by nothing, or by yaw and place of the first sample."""
    scratch.position[:] = base.position
    scratch.velocity[:] = base.linear_velocity
    scratch.orientation[:] = base.orientation
    if not by_start:
        return
    if record.ticks == 0:
        record.yaw = yaw(truth.base_orientation) - yaw(base.orientation)
        record.start[:] = base.position
        record.true_start[:] = truth.base_position
    turn = scratch.turn
    turn[0], turn[1], turn[2], turn[3] = 0.0, 0.0, sin(0.5 * record.yaw), cos(0.5 * record.yaw)
    scratch.position[:] -= record.start
    rotate(turn, scratch.position, scratch.position)
    scratch.position[:] += record.true_start
    rotate(turn, scratch.velocity, scratch.velocity)
    multiply(turn, scratch.orientation, scratch.orientation)


@kernel
def find_errors(truth: RobotTruth, record: EstimatorRecord, scratch: EstimatorScratch) -> None:
    """Find the errors of this tick, into ``record.last``."""
    error, turn = scratch.error, scratch.turn
    error[:] = scratch.position - truth.base_position
    record.last[0] = magnitude(error)
    error[:] = scratch.velocity - truth.base_linear_velocity
    record.last[1] = magnitude(error)
    conjugate(truth.base_orientation, turn)
    multiply(scratch.orientation, turn, turn)
    logarithm(turn, error)
    record.last[2] = magnitude(error)
    record.last[3] = sqrt(error[0] * error[0] + error[1] * error[1])
    record.last[4] = abs(error[2])


@kernel
def is_flight(record: EstimatorRecord, confirmation: float, period: float) -> bool:
    """Check whether the robot has been unloaded for long enough that this is a flight."""
    return bool(record.unloaded_ticks * period >= confirmation - 1e-9)


@kernel
def record_landing(record: EstimatorRecord) -> None:
    """Add the flight that has ended to those before."""
    record.landings += 1
    record.flight_ticks += record.unloaded_ticks
    record.flight_square_sum[:] += record.unloaded_square_sum
    record.flight_peak[:] = max(record.flight_peak, record.unloaded_peak)
