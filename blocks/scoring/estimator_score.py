"""Measures the errors of the estimated base: at lift-off, in flight, at touchdown, at the end."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...runtime.language.block import Block, Input, Metric, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, RobotTruth

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

    Put it into a graph with ``include: [scores/estimator.yaml]``.
    """

    class Params(Parameters):
        flight_confirmation: float = parameter(
            0.02, unit="s", gt=0, text="all points unloaded for this long is a flight"
        )

    params: Params
    truth = Input(RobotTruth, reads_truth=True, text="what the simulator knows")
    base = Input(BaseState, text="what the estimator says")
    record = State(EstimatorRecord, text="the errors so far")

    def setup(self) -> None:
        """Scratch memory."""
        self._error, self._squares = np.zeros(3), np.zeros(KINDS)

    def step(self) -> None:
        """Compare one tick."""
        record = self.record
        self._compare()
        last = record.last
        np.multiply(last, last, out=self._squares)
        record.ticks += 1
        record.square_sum += self._squares
        np.maximum(record.peak, last, out=record.peak)
        if any(self.truth.contact_touched.tolist()):
            if self._confirmed():
                self._land()
            record.unloaded_ticks[()] = 0
            return
        if record.unloaded_ticks == 0:
            record.unloaded_error[:] = last
            record.unloaded_square_sum.fill(0.0)
            record.unloaded_peak.fill(0.0)
        before = self._confirmed()
        record.unloaded_ticks += 1
        record.unloaded_square_sum += self._squares
        np.maximum(record.unloaded_peak, last, out=record.unloaded_peak)
        if self._confirmed() and not before:
            record.flights += 1
            record.lift_off[:] = record.unloaded_error
        # The last tick before a point is loaded again is the touchdown.
        if self._confirmed():
            record.touchdown[:] = last

    def metrics(self) -> Mapping[str, Metric]:
        """The errors by name."""
        record = self.record
        ticks, values = int(record.ticks), dict[str, Metric]()
        values["estimator_flights"] = int(record.flights)
        for kind, (name, unit) in enumerate(_NAMES):

            def put(what: str, value: float, name: str = name, unit: str = unit) -> None:
                values[f"estimator_{name}_{what}_{unit}"] = value

            if ticks:
                put("rms", math.sqrt(record.square_sum.item(kind) / ticks))
                put("peak", record.peak.item(kind))
                put("end", record.last.item(kind))
            if record.flights:
                put("lift_off", record.lift_off.item(kind))
            if record.landings:
                flown = int(record.flight_ticks)
                put("flight_rms", math.sqrt(record.flight_square_sum.item(kind) / flown))
                put("flight_peak", record.flight_peak.item(kind))
                put("touchdown", record.touchdown.item(kind))
        return values

    def _confirmed(self) -> bool:
        """Whether the robot has been unloaded for long enough that this is a flight."""
        ticks = int(self.record.unloaded_ticks)
        return ticks * self.period >= self.params.flight_confirmation - 1e-9

    def _land(self) -> None:
        record = self.record
        record.landings += 1
        record.flight_ticks += record.unloaded_ticks
        record.flight_square_sum += record.unloaded_square_sum
        np.maximum(record.flight_peak, record.unloaded_peak, out=record.flight_peak)

    def _compare(self) -> None:
        """The errors of this tick, into ``record.last``."""
        last, truth, base = self.record.last, self.truth, self.base
        for kind, estimated, true in (
            (0, base.position, truth.base_position),
            (1, base.linear_velocity, truth.base_linear_velocity),
        ):
            np.subtract(estimated, true, out=self._error)
            last[kind] = math.hypot(*self._error.tolist())
        # The product of the estimated quaternion and the true one's inverse.
        ax, ay, az, aw = base.orientation.tolist()
        bx, by, bz, bw = truth.base_orientation.tolist()
        x = ax * bw - aw * bx - ay * bz + az * by
        y = ay * bw - aw * by - az * bx + ax * bz
        z = az * bw - aw * bz - ax * by + ay * bx
        w = aw * bw + ax * bx + ay * by + az * bz
        sine = math.hypot(x, y, z)
        angle = 2.0 * math.atan2(sine, abs(w))
        scale = angle / sine if sine > 0.0 else 0.0
        last[2], last[3], last[4] = angle, scale * math.hypot(x, y), scale * abs(z)
