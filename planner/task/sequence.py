"""The parts of a task with several jumps in a row, and with phases of contact of its own.

name: up_and_down
rise: 12 cm
distance_x: 10 cm
jumps: [{landing_height: 5 cm}, {landing_height: -5 cm}]

Ground that nobody chose: for a row of jumps, levels and gaps drawn by a seed.

repeat: 10
distance_x: 14 cm
rough: {seed: 1, steps: 3 cm, gaps: 6 cm}
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import model_validator

from ...blocks.signals import Phase
from ...runtime.language.parameters import Parameters, parameter

FREE = "free"
SHORTEST_JUMP_OVER_AN_EDGE = 0.03
"""Start and landing closer together than this [m] have no room for a step's edge between them."""
PHASES = {
    "squat": Phase.SQUAT,
    "thrust": Phase.THRUST,
    "flight": Phase.FLIGHT,
    "landing": Phase.LANDING,
}
PATTERN = re.compile(r"[st]+(f[stl]+)*fl+")
"""Initials of the phases: from the ground, flights with ground between them, a landing."""


class FreeTimes(Parameters):
    """Parameters whose times may be written as ``free``: those that may be ``None``."""

    @model_validator(mode="before")
    @classmethod
    def _read_free(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        times = [key for key in data if key == "time" or key.endswith("_time")]
        return data | {key: None for key in times if data[key] == FREE}


class Hop(FreeTimes):
    """One of several jumps in a row, relative to where it begins; what is not given is as the task
    says for all of them."""

    rise: float | None = parameter(
        None, unit="m", gt=0.0, le=2.0, text="apex of the centre of mass above standing there"
    )
    take_off_speed: float | None = parameter(
        None, unit="m/s", gt=0.0, le=8.0, text="vertical speed of the centre of mass at lift-off"
    )
    flight_time: float | None = parameter(None, unit="s", gt=0.0, le=3.0, text="time of the flight")
    distance_x: float | None = parameter(
        None, unit="m", ge=-2.0, le=2.0, text="how far it lands along the world's x axis"
    )
    distance_y: float | None = parameter(
        None, unit="m", ge=-2.0, le=2.0, text="how far it lands along the world's y axis"
    )
    twist: float | None = parameter(
        None, unit="rad", ge=-6.3, le=6.3, text="change of heading, to the left"
    )
    landing_height: float | None = parameter(
        None, unit="m", ge=-2.0, le=2.0, text="ground at landing above the ground where it begins"
    )
    step_edge: float | None = parameter(
        None,
        unit="m",
        ge=-2.0,
        le=2.0,
        text="where the ground changes its height, along x from the start of this jump",
    )
    gap: float | None = parameter(
        None, unit="m", ge=0.0, le=1.0, text="width of a gap in the ground, midway or at the edge"
    )
    rotation: float | None = parameter(
        None, unit="rad", ge=-12.6, le=12.6, text="the body's turn in pitch"
    )


class PhaseSpec(FreeTimes):
    """A phase of the sequence of contacts, in the order of time."""

    phase: Literal["squat", "thrust", "flight", "landing"] = parameter(text="the kind of phase")
    time: float | None = parameter(
        None, unit="s", gt=0.0, le=5.0, text="its time; None or free: found by the planner"
    )
    knots: int | None = parameter(
        None, ge=2, le=400, text="number of intervals; None: that of the task's knots"
    )
    contacts: str = parameter(
        "all",
        text="contact points on the ground: all, or those whose names contain this, such as toe",
    )

    def on_ground(self, names: Sequence[str]) -> tuple[int, ...]:
        """The indices of the contact points that carry load."""
        if self.phase == "flight":
            return ()
        return tuple(k for k, name in enumerate(names) if self.contacts in ("all", name)
                     or self.contacts in name)  # fmt: skip


def check_spans(spans: Sequence[PhaseSpec], flights: int) -> str:
    """What is wrong with a sequence of phases for so many jumps; empty where nothing is."""
    if not PATTERN.fullmatch("".join(span.phase[0] for span in spans)):
        return (
            "the phases must be squat or thrust, then flights with thrust or landing between "
            "them, then landing; found " + ", ".join(span.phase for span in spans)
        )
    found = sum(span.phase == "flight" for span in spans)
    if found != flights:
        return f"there are {found} flights among the phases but {flights} jumps"
    if spans[0].contacts != "all" or spans[-1].contacts != "all":
        return "the robot stands on all contact points in the first and in the last phase"
    return ""


@dataclass(frozen=True)
class StanceLocation:
    """Where the robot stands between jumps: the soles' middle [m], their heading and how far the
    body has turned in pitch [rad]."""

    x: float
    y: float
    z: float
    heading: float
    turned: float


def places_of(hops: Sequence[Hop]) -> tuple[StanceLocation, ...]:
    """Where the robot stands before the first jump and after each of them."""
    found = [StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0)]
    for hop in hops:
        last = found[-1]
        found.append(
            StanceLocation(
                last.x + (hop.distance_x or 0.0),
                last.y + (hop.distance_y or 0.0),
                last.z + (hop.landing_height or 0.0),
                last.heading + (hop.twist or 0.0),
                last.turned + (hop.rotation or 0.0),
            )
        )
    return tuple(found)


def edge_of(hop: Hop, start: StanceLocation) -> float | None:
    """The x [m, world] at which the ground changes height under a jump that begins there; ``None``
    if the ground is level, or if the robot lands where it stood, so that there can be no edge and
    the ground is taken to move in flight."""
    if not hop.landing_height:
        return None
    if hop.step_edge is not None:
        return start.x + hop.step_edge
    ahead = hop.distance_x or 0.0
    return start.x + 0.5 * ahead if abs(ahead) >= SHORTEST_JUMP_OVER_AN_EDGE else None


class RoughGround(Parameters):
    """How uneven the ground under a row of jumps is. Every number is uniform and independent."""

    seed: int = parameter(0, ge=0, le=2**31, text="what the ground is drawn by")
    steps: float = parameter(
        0.0, unit="m", ge=0.0, le=0.2,
        text="each landing is at most so much higher or lower than the start",
    )  # fmt: skip
    gaps: float = parameter(
        0.0, unit="m", ge=0.0, le=0.5,
        text="widest gap in the ground under a jump, which is longer by the gap",
    )  # fmt: skip

    def under(self, hops: Sequence[Hop]) -> tuple[Hop, ...]:
        """The jumps over that ground: with its steps and gaps, longer by the gap and higher by the
        step up, so that each clears its landing by as much as on level ground."""
        # Python's own generator, whose numbers are the same in every version and on every machine.
        draw, level, found = random.Random(self.seed), 0.0, list[Hop]()
        for hop in hops:
            landing = round(draw.uniform(-self.steps, self.steps), 3)
            gap = round(draw.uniform(0.0, self.gaps), 3)
            step, ahead = round(landing - level, 3), hop.distance_x or 0.0
            longer = ahead + (gap if ahead >= 0.0 else -gap)
            changed = {"landing_height": step, "gap": gap, "distance_x": round(longer, 6)}
            if hop.rise is not None:
                changed["rise"] = round(hop.rise + max(0.0, step), 6)
            found.append(hop.model_copy(update=changed))
            level = landing
        return tuple(found)
