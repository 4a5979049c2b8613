"""The parts of a task with several jumps in a row, and with phases of contact of its own.

name: up_and_down
rise: 12 cm
distance_x: 10 cm
jumps: [{landing_height: 5 cm}, {landing_height: -5 cm}]

Ground that nobody chose: for a row of jumps, levels and gaps drawn by a seed.

repeat: 10
distance_x: 14 cm
rough: {seed: 1, steps: 3 cm, gaps: 6 cm}

Ground that leans, and stairs that lead up:

distance_x: 20 cm
landing_slope: [8 deg, 0]

distance_x: 25 cm
stairs: {x: 12 cm, rise: 4 cm, run: 25 cm, steps: 3}
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, parameter
from .contact_groups import ALL, contact_points
from .phase import Phase

FREE = "free"
Slope = tuple[float, float]
"""Angles [rad] by which ground rises along the world's x and y axes, as those of a scene's boxes."""
LEVEL: Slope = (0.0, 0.0)
STEEPEST = math.radians(45.0)
"""Steepest slope [rad]; a scene's boxes lean no more."""
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
    """Jump in a row of several, relative to where it begins; what is not given is as in the task for all of them."""

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
    landing_slope: Slope | None = parameter(
        None, unit="rad", text="angles by which the ground at landing rises along x and y"
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
    contacts: str | tuple[str, ...] = parameter(
        "all",
        text="contact points on the ground: all, those whose names contain this, such as toe, those on a side of the "
        "robot (fore, hind, left, right), or a list of these",
    )
    raised: tuple[str, ...] | None = parameter(
        None, text="those of them that are off the ground all the same, likewise"
    )

    def on_ground(self, robot: RobotDescription) -> tuple[int, ...]:
        """Return the indices of the contact points that carry load."""
        if self.phase == "flight":
            return ()
        off = contact_points(robot, self.raised or ())
        return tuple(k for k in contact_points(robot, self.contacts) if k not in off)


def check_phase_specs(phase_specs: Sequence[PhaseSpec], flights: int) -> str:
    """Return what is wrong with a sequence of phases for this number of jumps; empty if nothing is."""
    if not PATTERN.fullmatch("".join(phase_spec.phase[0] for phase_spec in phase_specs)):
        return (
            "the phases must be squat or thrust, then flights with thrust or landing between "
            "them, then landing; found " + ", ".join(phase_spec.phase for phase_spec in phase_specs)
        )
    found = sum(phase_spec.phase == "flight" for phase_spec in phase_specs)
    if found != flights:
        return f"there are {found} flights among the phases but {flights} jumps"
    if any(
        phase_spec.contacts != ALL or phase_spec.raised
        for phase_spec in (phase_specs[0], phase_specs[-1])
    ):
        return "the robot stands on all contact points in the first and in the last phase"
    return ""


@dataclass(frozen=True)
class StanceLocation:
    """Place of the robot between jumps: the soles' middle [m], their heading, the body's turn in pitch so far [rad],
    and the slope of the ground there.
    """

    x: float
    y: float
    z: float
    heading: float
    turned: float
    slope: Slope = LEVEL

    @property
    def plane(self) -> tuple[float, float, float]:
        """The ground under it as c of its height c0 + c1 x + c2 y [m, world]."""
        a, b = (math.tan(angle) for angle in self.slope)
        return self.z - a * self.x - b * self.y, a, b

    def height(self, x: Any, y: Any) -> Any:
        """Return the height of the ground under it at that place [m], if it went on; of numbers or arrays."""
        if self.slope == LEVEL:
            return self.z + 0.0 * x
        c, a, b = self.plane
        return c + a * x + b * y


def ground_axes(slope: Slope, heading: float = 0.0) -> Array:
    """Return the axes along feet of that ``heading``, across them and normal to ground that leans, as the columns of a
    matrix (3, 3).
    """
    cosine, sine = np.cos(heading), np.sin(heading)
    if slope == LEVEL:
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    a, b = np.tan(slope)
    along = np.array([cosine, sine, a * cosine + b * sine])
    normal = np.array([-a, -b, 1.0])
    along, normal = along / np.linalg.norm(along), normal / np.linalg.norm(normal)
    return np.column_stack([along, np.cross(normal, along), normal])


def places_of(hops: Sequence[Hop], slope: Slope = LEVEL) -> tuple[StanceLocation, ...]:
    """Return the places of the robot before the first jump, on ground of that ``slope``, and after each."""
    found = [StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0, slope)]
    for hop in hops:
        last = found[-1]
        found.append(
            StanceLocation(
                last.x + (hop.distance_x or 0.0),
                last.y + (hop.distance_y or 0.0),
                last.z + (hop.landing_height or 0.0),
                last.heading + (hop.twist or 0.0),
                last.turned + (hop.rotation or 0.0),
                hop.landing_slope or LEVEL,
            )
        )
    return tuple(found)


def on_slopes(hops: Sequence[Hop], slope: Slope) -> tuple[Hop, ...]:
    """Return the jumps from ground of that ``slope``. Where a jump sets nothing else, ground goes on as it leans where
    the jump begins, and its ``landing_height`` is above that.
    """
    found = list[Hop]()
    for hop in hops:
        here = StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0, slope)
        rise = float(here.height(hop.distance_x or 0.0, hop.distance_y or 0.0))
        slope = hop.landing_slope or slope
        up = round((hop.landing_height or 0.0) + rise, 9)
        found.append(hop.model_copy(update={"landing_height": up, "landing_slope": slope}))
    return tuple(found)


def edge_of(hop: Hop, start: StanceLocation) -> float | None:
    """Return the x [m, world] at which the ground changes height under a jump that begins there; ``None`` if the ground
    goes on as it is, or if the robot lands where it stood, so that there can be no edge and the ground is taken to move
    in flight.
    """
    if not changes_ground(hop, start):
        return None
    if hop.step_edge is not None:
        return start.x + hop.step_edge
    ahead = hop.distance_x or 0.0
    return start.x + 0.5 * ahead if abs(ahead) >= SHORTEST_JUMP_OVER_AN_EDGE else None


def changes_ground(hop: Hop, start: StanceLocation) -> bool:
    """Check whether a jump lands on other ground than that on which it begins, going on as it leans."""
    end = places_of([hop], start.slope)[1]
    goes_on = start.height(start.x + end.x, start.y + end.y) - start.z
    return (hop.landing_slope or LEVEL) != start.slope or abs(end.z - goes_on) > 1e-8


def step_of(hop: Hop, start: StanceLocation) -> float:
    """Return the rise of the ground at the edge under a jump [m], in the line of the jump; where there is no edge, how
    much higher it lands.
    """
    edge, up = edge_of(hop, start), hop.landing_height or 0.0
    if edge is None or (start.slope == LEVEL and not hop.landing_slope):
        return up
    ahead, aside = hop.distance_x or 0.0, hop.distance_y or 0.0
    end = StanceLocation(
        start.x + ahead, start.y + aside, start.z + up, 0.0, 0.0, hop.landing_slope or LEVEL
    )
    y = start.y + aside * (edge - start.x) / (ahead or 1.0)
    return round(float(end.height(edge, y) - start.height(edge, y)), 9)


class KnownStairs(Parameters):
    """Stairs ahead that the task knows of, as a scene describes them: the ground is level before the
    first edge, on each step, and behind the last one."""

    x: float = parameter(text="the first edge, ahead of where the robot starts", unit="m", gt=0.0)
    rise: float = parameter(
        text="height of each step; negative: they lead down", unit="m", ge=-0.5, le=0.5
    )
    run: float = parameter(text="depth of each step", unit="m", gt=0.0, le=2.0)
    steps: int = parameter(text="how many there are", ge=1, le=100)

    def passed(self, x: float) -> int:
        """Return the number of their edges that are behind a place."""
        return min(self.steps, max(0, math.floor((x - self.x) / self.run + 1.0 + 1e-9)))

    def under(self, hops: Sequence[Hop]) -> tuple[Hop, ...]:
        """Return the jumps over these stairs. Of several edges under one jump the first one up, or the last one down,
        counts for all of them, so that feet clear every one.
        """
        found, x = list[Hop](), 0.0
        for hop in hops:
            ahead = hop.distance_x or 0.0
            before, after = self.passed(x), self.passed(x + ahead)
            up = (after - before) * self.rise
            changed: dict[str, Any] = {"landing_height": round(up, 9)}
            if after != before:
                low, high = min(before, after), max(before, after) - 1
                # The higher ground lies behind the edges where they lead up, else before them.
                edge = self.x + self.run * (low if self.rise > 0.0 else high)
                changed["step_edge"] = round(edge - x, 9)
            found.append(hop.model_copy(update=changed))
            x += ahead
        return tuple(found)


class RoughGround(Parameters):
    """Unevenness of the ground under a row of jumps. Every number is uniform and independent."""

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
        """Return the jumps over that ground: with its steps and gaps, longer by the gap and higher by the step up, so
        that each clears its landing by as much as on level ground.
        """
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
