"""A jump as an optimisation problem of the whole body's motion: the ``full`` formulation.

Knots are the beginnings of the intervals of squat and thrust (feet on the ground), flight, and
landing, and the end. Lift-off is the first knot of the flight, touchdown the first of the landing.
The duration of a flight interval is a state that the last knot before the flight chooses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..signals import Phase
from .assembly import Assembly, Knot
from .clearance import step_edge
from .coordinates import Coordinates
from .knot_spacing import spacing
from .stage_functions import Piece, body_points, parameter_sizes
from .stance import Stance
from .symbolic_model import SymbolicModel
from .task import JumpTask

Array = NDArray[np.float64]
STEP_UP_SHARE, STEP_DOWN_SHARE = 0.45, 0.75
LIMIT_MARGIN = 0.005
"""rad; between two knots a joint at its limit would pass it by about as much."""
SHORTEST_FLIGHT, LONGEST_FLIGHT = 0.04, 1.5
"""s; bounds of a flight time that is left to the planner."""


@dataclass(frozen=True)
class Problem:
    """A problem ready to be solved.

    Attributes:
        assembly: the problem's structure and functions.
        lower, upper: bounds of the variables.
        row_lower, row_upper: bounds of the constraint rows.
        parameters: their values.
        families: of every constraint row the name of what it asks for.
        phases: of every interval.
        steps: the interval lengths [s]; in flight by their mean, which is a variable.
        flight: the range of flight knots, lift-off to the one before touchdown.
    """

    task: JumpTask
    model: SymbolicModel
    coordinates: Coordinates
    assembly: Assembly
    start: Stance
    end: Stance
    lower: Array
    upper: Array
    row_lower: Array
    row_upper: Array
    parameters: Array
    families: list[str]
    phases: list[Phase]
    steps: Array
    flight: range

    @property
    def knots(self) -> int:
        """The number of knots, one more than intervals."""
        return len(self.assembly.knots)


class ProblemBuilder:
    """Builds the problem of a task in those coordinates."""

    def __init__(
        self,
        task: JumpTask,
        model: SymbolicModel,
        coordinates: Coordinates,
        pieces: Mapping[str, Piece],
        start: Stance,
        end: Stance,
    ) -> None:
        self.task, self.model, self.coordinates = task, model, coordinates
        self.start, self.end = start, end
        self.n, self.m = coordinates.size, len(coordinates.joints)
        self.forces = coordinates.forces
        knots = task.knots
        self.phases = (
            [Phase.SQUAT] * knots.squat + [Phase.THRUST] * knots.thrust
            + [Phase.FLIGHT] * knots.flight + [Phase.LANDING] * knots.landing
        )  # fmt: skip
        before = knots.squat + knots.thrust
        self.flight = range(before, before + knots.flight)
        self.steps = np.concatenate(
            [
                task.squat_time / knots.squat * spacing(Phase.SQUAT, knots.squat),
                task.thrust_time / knots.thrust * spacing(Phase.THRUST, knots.thrust),
                spacing(Phase.FLIGHT, knots.flight),
                task.landing_time / knots.landing * spacing(Phase.LANDING, knots.landing),
            ]
        )
        self.pieces = pieces

    def build(self) -> Problem:
        """The problem with its bounds and parameters."""
        self.assembly = Assembly(self._knots(), self.pieces)
        size, rows = self.assembly.variables, self.assembly.constraints
        self.lower, self.upper = np.full(size, -np.inf), np.full(size, np.inf)
        self.row_lower, self.row_upper = np.zeros(rows), np.zeros(rows)
        self.families = ["integration"] * rows
        self.parameters = np.zeros(self.assembly.parameters)
        for k in range(len(self.phases) + 1):
            self._bound_state(k)
            for name in self.assembly.knots[k].pieces:
                getattr(self, f"_fill_{name}")(k)
        return Problem(
            self.task, self.model, self.coordinates, self.assembly, self.start, self.end,
            self.lower, self.upper, self.row_lower, self.row_upper, self.parameters,
            self.families, self.phases, self.steps, self.flight,
        )  # fmt: skip

    def _knots(self) -> list[Knot]:
        n = self.n
        q_and_v = np.arange(2 * n)
        feet = self.pieces["contact"].rows // 2
        knots = []
        for k, phase in enumerate(self.phases):
            rows = np.arange(2 * n, self.pieces["stance"].rows)
            if phase is Phase.FLIGHT:
                knot = Knot(2 * n + 1, n, gap="flight")
                rows = np.arange(2 * n + 1, self.pieces["flight"].rows)
                knot.pieces["flight"] = (np.arange(3 * n + 1), rows)
                if k > self.flight.start:
                    air = self._air_rows(k)
                    knot.pieces["air"] = (np.arange(n), air)
            else:
                last = k == self.flight.start - 1
                knot = Knot(2 * n, n + self.forces + last, gap="stance")
                knot.hold = n + self.forces if last else None
                knot.pieces["stance"] = (np.arange(3 * n + self.forces), rows)
            if k == self.flight.start:
                knot.pieces["take_off"] = (q_and_v, self._take_off_rows())
            if k > 0 and (phase is not Phase.FLIGHT or k == self.flight.start):
                kept = np.arange(2 * feet if k == self.flight.stop else feet)
                knot.pieces["contact"] = (q_and_v, kept)
            if k == 0:
                knot.fixed = tuple(range(2 * n))
            if k == self.flight.start - 1 and self.task.flight_time is not None:
                knot.fixed = (*knot.fixed, 2 * n + n + self.forces)
            knots.append(knot)
        # The flight's last knot leads to a touchdown that has no interval length among its states.
        base = len(self.coordinates.free_base)
        return [*knots, Knot(2 * n, 0, fixed=(*range(base), *range(n, 2 * n)))]

    def _air_rows(self, k: int) -> NDArray[np.int64]:
        """Which rows are needed: how far ahead only where there is an edge."""
        points = self.pieces["air"].rows // 3
        feet = len(self.coordinates.contacts)
        ahead = np.arange(points, points + feet)
        if step_edge(self.task) is None or (self.task.landing_height > 0.0) is (
            self._flight_share(k) > (STEP_UP_SHARE if self.task.landing_height > 0.0
                                     else STEP_DOWN_SHARE)):  # fmt: skip
            ahead = ahead[:0]
        return np.concatenate([np.arange(points), ahead, np.arange(2 * points, 3 * points)])

    def _take_off_rows(self) -> NDArray[np.int64]:
        task = self.task
        kept = [0] if task.rise is not None else [1] if task.take_off_speed is not None else []
        return np.array(kept, dtype=np.int64)

    def _bound_state(self, k: int) -> None:
        """Start and end are given, joints stay within their limits, feet only push."""
        n, start = self.n, int(self.assembly.state_start[k])
        base = len(self.coordinates.free_base)
        limits = self.model.robot.joint_limits[list(self.coordinates.moving)]
        self.lower[start + base : start + n] = limits[:, 0] + LIMIT_MARGIN
        self.upper[start + base : start + n] = limits[:, 1] - LIMIT_MARGIN
        if k in (0, len(self.phases)):
            stance = self.start if k == 0 else self.end
            given = np.concatenate([self.coordinates.reduce(stance.coordinates), np.zeros(n)])
            self._fix(k, given[list(self.assembly.knots[k].fixed)])
            self.lower[start : start + n] = -np.inf
            self.upper[start : start + n] = np.inf
        lean = self.task.touchdown_lean
        if k == self.flight.stop and lean is not None:
            pitch = start + self.coordinates.free_base.index(3)
            nominal = float(self.nominal(k)[pitch - start])
            self.lower[pitch], self.upper[pitch] = nominal - lean, nominal + lean
        if k == len(self.phases):
            return
        if self.phases[k] is not Phase.FLIGHT:
            forces = self.assembly.control_start[k] + n
            every = len(self.coordinates.axes)
            self.lower[forces + every - 1 : forces + self.forces : every] = 0.0
            hold = self.assembly.knots[k].hold
            if hold is not None:
                time = self.task.flight_time
                place = self.assembly.control_start[k] + hold
                if time is not None:
                    self._fix(k, np.array([time / len(self.flight)]))
                else:
                    self.lower[place] = SHORTEST_FLIGHT / len(self.flight)
                    self.upper[place] = LONGEST_FLIGHT / len(self.flight)

    def _fix(self, k: int, values: Array) -> None:
        rows = self.assembly.fixed_rows(k)
        self.row_lower[rows] = self.row_upper[rows] = values
        for row in rows:
            self.families[row] = "stance" if k in (0, len(self.phases)) else "flight time"

    # What a piece's rows ask for, and its parameters

    def _rows(self, name: str, k: int, families: list[tuple[str, int, float, float]]) -> None:
        """Bounds and families of a piece's rows, given for all rows after the gap in turn."""
        start, kept = self.assembly.rows_of(name, k)
        table: list[tuple[str, float, float]] = []
        for family, count, low, high in families:
            table += [(family, low, high)] * count
        table = [("integration", 0.0, 0.0)] * (self.pieces[name].rows - len(table)) + table
        for i, row in enumerate(kept):
            self.families[start + i], self.row_lower[start + i], self.row_upper[start + i] = table[
                row
            ]

    def _set(self, name: str, k: int, **values: Any) -> None:
        start = self.assembly.parameter_start[name, k]
        for key, size in parameter_sizes(self.coordinates)[name].items():
            if key in values:
                self.parameters[start : start + size] = values[key]
            start += size

    def _motor_rows(self) -> list[tuple[str, int, float, float]]:
        profile, effort = self.model.robot.profiles[self.task.profile], self.task.effort
        peak, top = profile.peak_torque * effort, profile.no_load_speed * effort
        line = self._slope() * top
        return [
            ("motor torque", self.m, -peak, peak),
            ("motor torque at speed", 2 * self.m, -line, line),
            ("motor speed", self.m, -top, top),
        ]

    def _slope(self) -> float:
        profile = self.model.robot.profiles[self.task.profile]
        return profile.peak_torque / (profile.no_load_speed - profile.corner_speed)

    def _interval(self, k: int) -> dict[str, Any]:
        weights, base = self.task.weights, self.coordinates.free_base
        share, moving = float(self.coordinates.share), len(self.coordinates.moving)
        posture = [weights.orientation if i >= 3 else 0.0 for i in base]
        return {
            "nominal": self.nominal(k),
            "posture": posture + [weights.posture * share] * moving,
            "velocity": [0.0] * len(base) + [weights.joint_velocity * share] * moving,
            "acceleration": [weights.acceleration] * len(base)
            + [weights.acceleration * share] * moving,
            "slope": self._slope(),
        }

    def nominal(self, k: int) -> Array:
        """The posture that the cost prefers: standing, turning in flight."""
        share = min(max((k - self.flight.start) / len(self.flight), 0.0), 1.0)
        whole = (1.0 - share) * self.start.coordinates + share * self.end.coordinates
        return self.coordinates.reduce(whole)

    def _fill_stance(self, k: int) -> None:
        weights, share = self.task.weights, self.coordinates.share
        self._set(
            "stance", k, step=self.steps[k], force=weights.force * share,
            friction=self.task.friction / np.sqrt(2.0), **self._interval(k),
        )  # fmt: skip
        cones = 2 * (len(self.coordinates.axes) - 1) * len(self.coordinates.contacts)
        base = ("dynamics", len(self.coordinates.rows), 0.0, 0.0)
        self._rows("stance", k, [base, *self._motor_rows(), ("friction", cones, 0.0, np.inf)])

    def _fill_flight(self, k: int) -> None:
        self._set("flight", k, share=self.steps[k], **self._interval(k))
        base = ("dynamics", len(self.coordinates.rows), 0.0, 0.0)
        self._rows("flight", k, [base, *self._motor_rows()])

    def _fill_contact(self, k: int) -> None:
        stance = self.start if k <= self.flight.start else self.end
        places = stance.points[list(self.coordinates.contacts)].ravel()
        heading = [np.cos(stance.heading), np.sin(stance.heading)]
        self._set("contact", k, place=places, heading=heading)
        feet = self.pieces["contact"].rows // 2
        self._rows("contact", k, [("foot velocity", feet, 0.0, 0.0), ("footholds", feet, 0.0, 0.0)])

    def _fill_take_off(self, k: int) -> None:
        rise = self.start.com[2] + (self.task.rise or 0.0)
        speed = self.task.take_off_speed or 0.0
        self._rows("take_off", k, [
            ("apex", 1, rise, rise), ("take-off speed", 1, speed, speed),
            ("angular momentum", 3, -np.inf, np.inf),
        ])  # fmt: skip

    def _fill_air(self, k: int) -> None:
        """Feet and calves are above the ground. At a step they are above the higher ground while
        it is under them: until ``STEP_DOWN_SHARE`` of the flight's time, or from ``STEP_UP_SHARE``
        on, and at that instant they are still, or already, on the lower side of the edge."""
        task, points = self.task, body_points(self.model, self.coordinates)
        share = self._flight_share(k)
        step, edge = task.landing_height, step_edge(task)
        switch = 0.5 if edge is None else STEP_UP_SHARE if step > 0.0 else STEP_DOWN_SHARE
        ground = step if share > switch else 0.0
        floor = ground + task.foot_clearance * np.sin(np.pi * share)
        if self._flight_share(k - 1) < switch <= share:
            floor = max(floor, step)
        ahead = (-np.inf, np.inf)
        if edge is not None:
            before = (share <= switch) if step > 0.0 else False
            beyond = (share > switch) if step < 0.0 else False
            forward = task.distance_x > 0.0
            if before or beyond:
                ahead = (-np.inf, edge) if before is forward else (edge, np.inf)
        n_feet = len(self.coordinates.contacts)
        free = ("ground clearance", len(points) - n_feet, -np.inf, np.inf)
        self._rows("air", k, [
            ("ground clearance", n_feet, floor, np.inf),
            ("ground clearance", len(points) - n_feet, ground, np.inf),
            ("ground clearance", n_feet, *ahead),
            free,
            ("leg clearance", len(points), 0.5 * task.leg_clearance, np.inf),
        ])  # fmt: skip

    def _flight_share(self, k: int) -> float:
        """How much of the flight's time is past at a knot."""
        first = self.flight.start
        return float(self.steps[first:k].sum() / len(self.flight))
