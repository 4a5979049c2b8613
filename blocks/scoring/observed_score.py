"""The judge of a stance, a squat or a jump by what a real robot knows of itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees

from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Input, Metric, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import (
    BaseState,
    ContactState,
    DynamicsTerms,
    JumpReference,
    Phase,
    PhaseState,
)
from .standing import NEVER


class ObservedCriteria(Parameters):
    """The tolerances; those that have the same name are of ``JumpScore``."""

    judge_time: float | None = parameter(
        None, unit="s", gt=0.0,
        text="time at which the rest is judged, by the plan's time; none: `rest_time` after its touchdown",
    )  # fmt: skip
    rest_time: float = parameter(1.5, unit="s", gt=0.0, text="from touchdown to rest")
    peak_tilt: float = parameter(
        0.26, unit="rad", gt=0.0, text="largest tilt in standing and landing"
    )
    rest_tilt: float = parameter(0.1, unit="rad", gt=0.0, text="largest tilt at rest")
    rest_speed: float = parameter(0.1, unit="m/s", gt=0.0, text="largest speed of the com at rest")
    flight_share: float = parameter(
        0.6, ge=0.0, le=1.0, text="least share of the planned flight with all switches open"
    )
    squat_depth: float = parameter(
        0.0, unit="m", ge=0.0, le=0.5, text="nominal descent of the com; zero: not judged"
    )
    depth_tolerance: float = parameter(0.25, ge=0.0, text="of that depth, as a share of it")


class ObservedRecord(Signal):
    """Record for the judgement."""

    begun = Field(dtype="bool", text="the plan has begun")
    faulted = Field(dtype="bool", text="the phase was FAULT")
    flight = Field(unit="s", text="time without a closed switch in flight")
    planned_flight = Field(unit="s", text="duration of the plan's flight")
    height = Field(unit="m", text="of the com as the plan began")
    lowest = Field(unit="m", text="of the com, the least so far before a flight")
    peak_tilt = Field(unit="rad", text="in standing and landing, so far")
    judged = Field(unit="s", text="plan time of the judgement; negative: not yet")
    rest_tilt = Field(unit="rad", text="then")
    rest_speed = Field(unit="m/s", text="of the com, then")
    rest_contacts = Field(dtype="int64", text="number of points that carried load then")


class ObservedScore(Block):
    """Judges a robot that stands, squats or jumps by its own sensors and estimates, and ends the run.

    Simulators know more (``JumpScore``, ``StandScore``); this block serves a robot. It is a success when:

    1. the plan has begun, no phase was FAULT, and the rest was judged: ``rest_time`` after the planned
       touchdown, or at ``judge_time`` of a plan without a flight;
    2. standing, and from touchdown on, the estimated tilt was never above ``peak_tilt``;
    3. the robot was in the air, with all switches open, for at least ``flight_share`` of the planned flight;
    4. before a flight the com went down by ``squat_depth``, if it is given, within ``depth_tolerance``;
    5. at rest the tilt is below ``rest_tilt``, the com slower than ``rest_speed``, and all points carry load.

    It cannot see whether anything else touches the ground, how far the robot has moved, or that a
    switch is stuck. Metrics: ``success``, ``reason``, and the figures; ``observed_rise_m`` is
    g t^2 / 8 of the time in the air.
    """

    Params = ObservedCriteria
    params: ObservedCriteria
    needs = ("floating base", "feet")
    base = Input(BaseState, text="the estimated base")
    terms = Input(DynamicsTerms, text="the estimated com")
    contacts = Input(ContactState, text="points that carry load")
    phase = Input(PhaseState, text="the phase")
    reference = Input(JumpReference, text="the plan")
    record = State(ObservedRecord, text="everything the judgement needs")

    def setup(self) -> None:
        self.judge_time = self.params.judge_time or NEVER

    def start(self) -> None:
        self.record.judged = NEVER

    @kernel
    @staticmethod
    def step(
        base: BaseState,
        terms: DynamicsTerms,
        contacts: ContactState,
        phase: PhaseState,
        reference: JumpReference,
        record: ObservedRecord,
        params: ObservedCriteria,
        judge_time: float,
        period: float,
    ) -> bool:
        if phase.phase == Phase.HANG:
            return False
        if not record.begun:
            record.begun = True
            record.height = terms.com[2]
            record.lowest = terms.com[2]
        loaded = 0
        for k in range(contacts.active.shape[0]):
            loaded += contacts.active[k]
        now, lean = reference.time, tilt(base.orientation)
        record.faulted = record.faulted or phase.phase == Phase.FAULT
        if phase.phase == Phase.FLIGHT and loaded == 0:
            record.flight += period
        if phase.phase < Phase.FLIGHT:
            record.planned_flight = max(0.0, reference.touchdown_time - reference.lift_off_time)
            record.lowest = min(record.lowest, terms.com[2])
        if (
            phase.phase == Phase.STAND or phase.phase > Phase.FLIGHT
        ):  # a plan may lean in squat and thrust
            record.peak_tilt = max(record.peak_tilt, lean)
        due = judge_time
        if due == NEVER:
            due = reference.touchdown_time + params.rest_time
        if record.judged == NEVER and now >= due:
            record.judged = now
            record.rest_tilt = lean
            speed = 0.0
            for k in range(3):
                speed += terms.com_velocity[k] * terms.com_velocity[k]
            record.rest_speed = speed**0.5
            record.rest_contacts = loaded
            return True
        return False

    def on_event(self) -> None:
        """Ask for the end of the run."""
        self.request_stop(f"judged at {self.time:.2f} s")

    def metrics(self) -> Mapping[str, Metric]:
        """Return the judgement and its figures."""
        record = self.record
        failure = next((text for holds, text in self._judge() if not holds), None)
        return {
            "success": failure is None,
            "reason": failure or "stood, moved and rested as planned",
            "observed_flight_s": float(record.flight),
            "observed_rise_m": GRAVITY * float(record.flight) ** 2 / 8.0,
            "observed_depth_m": float(record.height - record.lowest),
            "observed_tilt_deg": degrees(record.peak_tilt),
        }

    def _judge(self) -> Iterator[tuple[bool, str]]:
        """Every criterion, in the order in which a failure explains those behind it."""
        r, p = self.record, self.params
        yield bool(r.begun), "the robot was not put down on all its feet"
        yield not r.faulted, "the phase was FAULT: contact was lost, or the flight did not end"
        lean, most = degrees(r.peak_tilt), degrees(p.peak_tilt)
        yield r.peak_tilt <= p.peak_tilt, f"it leaned by {lean:.1f} deg of {most:.1f} allowed"
        yield r.judged != NEVER, "the run ended before the rest was judged"
        if self.params.judge_time is None:
            least = p.flight_share * r.planned_flight
            yield (
                r.flight >= least,
                f"it was in the air for {1e3 * r.flight:.0f} ms of {1e3 * r.planned_flight:.0f} planned",
            )
        depth = float(r.height - r.lowest)
        yield (
            p.squat_depth == 0.0 or abs(depth - p.squat_depth) <= p.depth_tolerance * p.squat_depth,
            f"it squatted by {1e3 * depth:.0f} mm, not by {1e3 * p.squat_depth:.0f}",
        )
        lean = degrees(r.rest_tilt)
        yield r.rest_tilt <= p.rest_tilt, f"it leans by {lean:.1f} deg at rest"
        yield r.rest_speed <= p.rest_speed, f"its com moves at {r.rest_speed:.2f} m/s at rest"
        points = len(self.robot.contacts)
        yield (
            r.rest_contacts == points,
            f"{r.rest_contacts} of {points} points carry load at rest",
        )
