"""The judge of the flight, who sees the simulator's truth."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from mission import FlightPhase, Flown

from aloft import Block, Field, Input, Parameters, Signal, State, parameter
from aloft.blocks.signals import RobotTruth, ThrusterState
from aloft.mathematics.rotations import tilt


class FlightRecord(Signal):
    """The figures that the judgement needs."""

    ticks = Field(dtype="int64", text="ticks so far")
    pad = Field(3, unit="m", frame="world", text="where the robot stood")
    hover_error = Field(
        2, unit="m", text="largest distance from the hover point, before and after the flip"
    )
    hover_tilt = Field(2, unit="rad", text="largest tilt there")
    turned = Field(unit="rad", text="how far it has turned about the flip's axis")
    upside_down = Field(dtype="bool", text="whether it was")
    lowest = Field(unit="m", text="least height between take-off and landing")
    touched = Field(dtype="int64", text="ticks in the air with a contact")
    forbidden = Field(dtype="int64", text="physics steps in which anything but a foot touched")
    sinking = Field(unit="m/s", text="vertical speed at touchdown, positive downwards")
    down = Field(dtype="bool", text="whether it has touched down")
    speed = Field(unit="m/s", text="speed of the base at the end")
    tilt = Field(unit="rad", text="its tilt at the end")
    away = Field(unit="m", text="its horizontal distance from the pad at the end")
    thrust = Field(unit="N", text="thrust at the end")
    phase = Field(dtype="int64", values=FlightPhase, text="what the flight was at")
    hovered = Field(unit="s", text="how long the present hover has lasted")
    rested = Field(unit="s", text="how long ago it landed")


class FlightScore(Block):
    """Judges the flight by what is true. It is a success when all of these hold:

    1. In the last second of both hovers it is within ``hover_error`` of the point above the pad, and tilted
       by less than ``hover_tilt``.
    2. Between them it turns about the flip's axis by 360 deg within ``turn_error``, upside down on the way.
    3. From the first hover to the descent nothing touches it, and it is never below ``least_height``.
    4. Nothing but its feet ever touches anything.
    5. It touches down slower than ``touchdown_speed``, and ``rest`` after the rotors were switched off it stands
       still and level within ``pad_error`` of where it stood, without thrust. Then the run ends.
    """

    class Params(Parameters):
        height: float = parameter(unit="m", gt=0, text="of the hover above the pad")
        axis: str = parameter("roll", text="about which it flips")
        hover_error: float = parameter(0.15, unit="m", gt=0, text="in each hover's last second")
        hover_tilt: float = parameter(0.17, unit="rad", gt=0, text="there")
        turn_error: float = parameter(0.35, unit="rad", gt=0, text="of the flip")
        least_height: float = parameter(0.5, unit="m", gt=0, text="in the air, above the pad")
        touchdown_speed: float = parameter(1.0, unit="m/s", gt=0, text="downwards")
        pad_error: float = parameter(0.2, unit="m", gt=0, text="where it lands")
        rest: float = parameter(1.0, unit="s", gt=0, text="after which the landing is judged")
        hover: float = parameter(unit="s", gt=0, text="how long it hovers")

    needs = ("robot", "floating base")
    params: Params
    truth = Input(RobotTruth, reads_truth=True, text="what the simulator knows")
    flown = Input(Flown, text="what the flight is at")
    thrusters = Input(ThrusterState, text="what the rotors give")
    record = State(FlightRecord, text="what the judgement needs")

    @classmethod
    def example_parameters(cls) -> Mapping:
        """Return an example for the conformance suite."""
        return {"height": 1.5, "hover": 2.0}

    def setup(self) -> None:
        """Make room."""
        self._away = np.zeros(3)

    def step(self) -> None:
        """Note the tick."""
        r, truth, p, phase = self.record, self.truth, self.params, int(self.flown.phase)
        away = self._away
        if r.ticks == 0:
            r.pad[:] = truth.base_position
            r.lowest[()] = math.inf
        r.ticks += 1
        np.subtract(truth.base_position, r.pad, out=away)
        high, leaning = float(away[2]), tilt(truth.base_orientation)
        hovers = phase in (FlightPhase.HOVER, FlightPhase.HOVER_AGAIN)
        r.hovered[()] = r.hovered + self.period if hovers and phase == r.phase else 0.0
        touches = bool(truth.contact_touched.any())
        r.forbidden += truth.forbidden_contacts
        if hovers and r.hovered > p.hover - 1.0:
            k = int(phase == FlightPhase.HOVER_AGAIN)
            away[2] -= p.height
            r.hover_error[k] = max(r.hover_error[k], math.hypot(*away))
            r.hover_tilt[k] = max(r.hover_tilt[k], leaning)
        if FlightPhase.BOOST <= phase <= FlightPhase.RECOVER:
            rate = truth.base_angular_velocity[0 if p.axis == "roll" else 1]
            r.turned += rate * self.period
            r.upside_down |= leaning > 0.9 * math.pi
        if FlightPhase.HOVER <= phase <= FlightPhase.HOVER_AGAIN:
            r.lowest[()] = min(r.lowest, high)
            r.touched += touches
        if phase >= FlightPhase.DESCEND and touches and not r.down:
            r.down[()] = True
        elif not r.down:
            r.sinking[()] = -truth.base_linear_velocity[2]
        r.phase[()] = phase
        r.rested[()] = r.rested + self.period if phase == FlightPhase.LANDED else 0.0
        if r.rested >= p.rest - 1e-9:
            r.speed[()] = math.hypot(*truth.base_linear_velocity)
            r.tilt[()], r.away[()] = leaning, math.hypot(away[0], away[1])
            r.thrust[()] = self.thrusters.thrust.max()
            self.request_stop(f"judged at {self.time:.2f} s")

    def metrics(self) -> Mapping:
        """Return the judgement and its figures."""
        r = self.record
        failure = next((text for holds, text in self._judge() if not holds), None)
        return {
            "success": failure is None,
            "reason": failure or "all criteria hold",
            "hover_error_before_m": float(r.hover_error[0]),
            "hover_error_after_m": float(r.hover_error[1]),
            "turned_deg": math.degrees(r.turned),
            "lowest_height_m": float(r.lowest) if math.isfinite(r.lowest) else 0.0,
            "touchdown_speed_m_s": float(r.sinking),
            "landing_error_m": float(r.away),
        }

    def _judge(self) -> Iterator[tuple[bool, str]]:
        r, p = self.record, self.params
        yield r.forbidden == 0, "something other than a foot touched something"
        yield (
            r.phase == FlightPhase.LANDED and r.rested >= p.rest - 1e-9,
            f"the run ended while it was at {FlightPhase(int(r.phase)).name.lower()}",
        )
        for k, when in enumerate(("before", "after")):
            far = float(r.hover_error[k])
            yield far <= p.hover_error, f"{far:.2f} m from the hover point {when} the flip"
            leaning = float(r.hover_tilt[k])
            yield (
                leaning <= p.hover_tilt,
                f"tilted by {math.degrees(leaning):.0f} deg {when} the flip",
            )
        turned = abs(abs(float(r.turned)) - 2.0 * math.pi)
        yield (
            bool(r.upside_down) and turned <= p.turn_error,
            f"turned by {math.degrees(r.turned):.0f} deg",
        )
        yield r.touched == 0, "it touched something in flight"
        yield r.lowest >= p.least_height, f"it came down to {float(r.lowest):.2f} m"
        yield r.sinking <= p.touchdown_speed, f"it came down at {float(r.sinking):.2f} m/s"
        yield r.away <= p.pad_error, f"it landed {float(r.away):.2f} m from where it stood"
        yield r.speed <= 0.05 and r.tilt <= 0.09 and r.thrust <= 0.05, "it does not stand still"
