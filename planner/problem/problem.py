"""A jump as an optimisation problem of the whole body's motion: the ``full`` formulation.

What the knots stand for is the ``layout``. Lift-off is the first knot of a flight, touchdown the
first behind it. The length of a flight interval is a state that the last knot before the flight
chooses, and so is that of any other phase whose time is free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.kinematics import fall_height
from ..models.coordinates import Coordinates
from ..models.robot_model import Stance
from ..models.symbolic_model import SymbolicModel
from ..task.margins import Margins, joint_bounds
from ..task.phase import Phase
from ..task.sequence import StanceLocation, ground_axes
from ..task.task import JumpTask
from .arm_range import arm_ranges
from .assembly import Assembly, NonlinearProgram
from .layout import ProblemPhase
from .leg_rows import body_points
from .obstacles import side_clearance, step_parameters
from .stage_functions import StageFunction, parameter_sizes
from .structure import Structure

BODY_CLEARANCE = 0.002
"""m; what a body between two knots may come nearer to a step than at them."""
LEADING = ("take_off", "air", "obstacle")
"""The pieces whose bounds depend on where the task leads."""
Rows = tuple[str, int, float, float]
"""Constraint rows that follow each other: their family, their number and their bounds."""


def rows_of_each(family: str, low: Array, high: Array) -> list[Rows]:
    """Return one row for each pair of bounds."""
    return [(family, 1, float(a), float(b)) for a, b in zip(low, high, strict=True)]


@dataclass(frozen=True)
class FullProblem(NonlinearProgram):
    """A problem ready to be solved.

    Attributes:
        stances: where the robot stands at the start, between jumps and at the end.
        problem_phases: the phases with their intervals.
        steps: the interval lengths [s]; by their mean where that is a variable.
        exact: the model of the robot as it is; ``model`` is the same left and right in mirrored
            coordinates.
    """

    task: JumpTask
    model: SymbolicModel
    coordinates: Coordinates
    stances: tuple[Stance, ...]
    problem_phases: tuple[ProblemPhase, ...]
    steps: Array
    exact: SymbolicModel

    @property
    def start(self) -> Stance:
        """Stance of the robot at the start."""
        return self.stances[0]

    @property
    def end(self) -> Stance:
        """Stance of the robot at the end."""
        return self.stances[-1]

    @property
    def phases(self) -> list[Phase]:
        """The phase of every interval."""
        return [
            problem_phase.phase
            for problem_phase in self.problem_phases
            for _ in range(problem_phase.count)
        ]

    @property
    def flights(self) -> tuple[range, ...]:
        """The knots of every flight, lift-off to the one before touchdown."""
        return tuple(range(s.first, s.stop) for s in self.problem_phases if s.flies)

    @property
    def flight(self) -> range:
        """The knots of the first flight."""
        return self.flights[0]

    def phase_at(self, k: int) -> ProblemPhase:
        """Return the phase of the interval that begins with a knot; the last one at the end."""
        return next((s for s in self.problem_phases if k < s.stop), self.problem_phases[-1])

    def posture(self, k: int) -> Array:
        """Return the posture, of all coordinates, that the cost prefers: standing, turning in flight."""
        problem_phase = self.phase_at(k)
        here = self.stances[problem_phase.place].coordinates
        if not problem_phase.flies:
            return here
        share = (k - problem_phase.first) / problem_phase.count
        return (1.0 - share) * here + share * self.stances[problem_phase.place + 1].coordinates


class ProblemBuilder:
    """Builds the problem of a task in those coordinates."""

    def __init__(
        self,
        task: JumpTask,
        model: SymbolicModel,
        coordinates: Coordinates,
        pieces: Mapping[str, StageFunction],
        stances: Sequence[Stance],
        exact: SymbolicModel | None = None,
    ) -> None:
        self.task, self.model, self.coordinates = task, model, coordinates
        self.exact = exact or model
        self.structure = Structure(task, model, coordinates, pieces, stances)
        self.problem_phases, self.of_knot = self.structure.problem_phases, self.structure.of_knot
        self.stances, self.hops = self.structure.stances, self.structure.hops
        self.margins, self.leans = task.margins or Margins(), task.leans
        self.sizes = parameter_sizes(coordinates, self.leans)
        self.n, self.m = coordinates.size, len(coordinates.joints)
        self.forces = coordinates.forces
        self.steps = np.concatenate(
            [
                s.lengths * (1.0 if s.timed else (s.time or 0.0) / s.count)
                for s in self.problem_phases
            ]
        )
        self.pieces, self.free_base = pieces, coordinates.free_base
        self._nominal: dict[int, Array] = {}
        self._beside: dict[int, float] = {}
        self._tables: dict[tuple[str, tuple[Rows, ...]], tuple[tuple[str, ...], Array, Array]] = {}
        self._of_motors: dict[float, list[Rows]] = {}
        self._body_points = body_points(model, coordinates)
        self._fall_height = fall_height(self.exact.robot)
        self._arm_ranges = arm_ranges(model.robot, task.leg_clearance)

    def build(self) -> FullProblem:
        """Return the problem with its bounds and parameters."""
        self.assembly = Assembly(self.structure.knots, self.pieces)
        size, rows = self.assembly.variables, self.assembly.constraints
        self.lower, self.upper = np.full(size, -np.inf), np.full(size, np.inf)
        self.row_lower, self.row_upper = np.zeros(rows), np.zeros(rows)
        self.families = ["integration"] * rows
        self.parameters = np.zeros(self.assembly.parameters)
        self.problem = FullProblem(
            self.assembly, self.lower, self.upper, self.row_lower, self.row_upper,
            self.parameters, self.families, self.task, self.model, self.coordinates,
            self.stances, self.problem_phases, self.steps, self.exact,
        )  # fmt: skip
        for k in range(len(self.of_knot) + 1):
            self._bound_state(k)
            self._give(k)
            for name in self.assembly.knots[k].pieces:
                self._fill(name, k)
        return self.problem

    def moved(self, task: JumpTask, stances: Sequence[Stance]) -> FullProblem:
        """Return the built problem for a task that leads elsewhere: only distances, turn, rise and landing height may
        differ, with the same signs, so that the structure is the same. What does not follow from them is not worked out
        again.
        """
        other, built = copy(self), self.problem
        other.task, other.structure = task, self.structure.moved(task, stances)
        other.stances, other.hops = other.structure.stances, other.structure.hops
        other.lower, other.upper = self.lower.copy(), self.upper.copy()
        other.row_lower, other.row_upper = self.row_lower.copy(), self.row_upper.copy()
        other.parameters, other.families = self.parameters.copy(), self.families.copy()
        other._nominal, other._beside, other._tables = {}, {}, self._tables.copy()
        other.problem = replace(
            built, task=task, stances=other.stances, lower=other.lower, upper=other.upper,
            row_lower=other.row_lower, row_upper=other.row_upper, parameters=other.parameters,
            families=other.families,
        )  # fmt: skip
        # On level ground the height that feet keep does not follow from where the jump leads.
        heights = [place.z for each in (self, other) for place in each.structure.places]
        level = not self.leans and not any(heights)
        for k, problem_phase in enumerate(self.of_knot):
            begins = problem_phase.place == 0 and not problem_phase.flies
            if not begins:
                other._bound_base(k)
                if not problem_phase.impact:
                    other._set(problem_phase.piece, k, nominal=other.nominal(k))
            for name in self.assembly.knots[k].pieces:
                if name == "contact" and not begins:
                    other._place_feet(k)
                elif name in LEADING and not (level and name == "air"):
                    other._fill(name, k)
        end = len(self.of_knot)
        other._give(end)
        for name in self.assembly.knots[end].pieces:
            other._fill(name, end)
        return other.problem

    def _fill(self, name: str, k: int) -> None:
        """Set the bounds and parameters of a piece on a knot."""
        fill = self._fill_stance if name == "free_stance" else getattr(self, f"_fill_{name}")
        fill(k)

    def _give(self, k: int) -> None:
        """Set the bounds of the rows of a knot's variables that are given."""
        for row, (_, value, family) in zip(
            self.assembly.fixed_rows(k), self.structure.given.get(k, []), strict=True
        ):
            self.row_lower[row] = self.row_upper[row] = value
            self.families[row] = family

    # Bounds of the variables

    def _bound_state(self, k: int) -> None:
        """Start and end are given, joints stay within their limits, feet only push."""
        n, start = self.n, int(self.assembly.state_start[k])
        base = len(self.free_base)
        if k == len(self.of_knot):
            return
        problem_phase, knot = self.of_knot[k], self.assembly.knots[k]
        if k:
            limits = joint_bounds(self.model.robot, self.margins, problem_phase.place > 0)
            for joint, (low, high) in self._arm_ranges.items():
                limits[joint] = max(limits[joint, 0], low), min(limits[joint, 1], high)
            limits = limits[list(self.coordinates.moving)]
            self.lower[start + base : start + n] = limits[:, 0]
            self.upper[start + base : start + n] = limits[:, 1]
            self._bound_base(k)
        if k == 0 and problem_phase.timed:
            self.lower[start + 2 * n], self.upper[start + 2 * n] = problem_phase.bounds
        control = int(self.assembly.control_start[k])
        if not problem_phase.flies:
            every, idle = len(self.coordinates.axes), self.structure.idle(problem_phase)
            for point in range(len(self.coordinates.contacts)):
                if point not in idle:
                    self.lower[control + n + point * every + every - 1] = self._least_load(
                        problem_phase
                    )
        following = self.of_knot[k + 1] if knot.hold is not None else None
        if following is not None and following.time is None and knot.hold is not None:
            self.lower[control + knot.hold], self.upper[control + knot.hold] = following.bounds

    def _bound_base(self, k: int) -> None:
        """Bound the torso's lean at a knot behind the first, and its height on legs that fold until it lies on the
        ground, or the robot would count as fallen.
        """
        problem_phase = self.of_knot[k]
        if self.structure.obstacles.knees_fold and not problem_phase.flies:
            at = int(self.assembly.state_start[k]) + self.free_base.index(2)
            ground = self.structure.places[problem_phase.place].z
            self.lower[at] = ground + self._fall_height + (self.margins.step or 0.0)
        pitch, lean = self.free_base.index(3), self._most_lean(k)
        nominal, at = float(self.nominal(k)[pitch]), int(self.assembly.state_start[k]) + pitch
        self.lower[at], self.upper[at] = nominal - lean, nominal + lean

    def _least_load(self, problem_phase: ProblemPhase) -> float:
        """Return the least upward force of every contact point on the ground [N]."""
        if not self.margins.load or problem_phase.impact or problem_phase.phase == Phase.LANDING:
            return 0.0
        robot = self.model.robot
        return self.margins.load * robot.total_mass * GRAVITY / max(1, len(problem_phase.contacts))

    def _most_lean(self, k: int) -> float:
        """Return the largest lean of the torso away from the nominal posture at a knot."""
        problem_phase, bounds = self.of_knot[k], [np.inf]
        if problem_phase.place == 0 and not (problem_phase.flies and k > problem_phase.first):
            bounds.append(self.margins.squat_lean or np.inf)
        if problem_phase.place > 0 and not problem_phase.flies:
            bounds.append(self.margins.landing_lean or np.inf)
            if self.of_knot[k - 1].flies and self.task.touchdown_lean is not None:
                bounds.append(self.task.touchdown_lean)
        return float(min(bounds))

    # What a piece's rows ask for, and its parameters

    def _rows(self, name: str, k: int, families: list[Rows]) -> None:
        """Set the bounds and families of a piece's rows, given for all rows after the gap in turn."""
        start, kept = self.assembly.rows_of(name, k)
        key = name, tuple(families)
        if key not in self._tables:  # many knots have the same
            table: list[tuple[str, float, float]] = []
            for family, count, low, high in families:
                table += [(family, low, high)] * count
            before = [("integration", 0.0, 0.0)] * (self.pieces[name].rows - len(table))
            names, lows, highs = zip(*before, *table, strict=True)
            self._tables[key] = names, np.array(lows), np.array(highs)
        names, lower, upper = self._tables[key]
        rows = slice(start, start + len(kept))
        self.families[rows] = [names[row] for row in kept.tolist()]
        self.row_lower[rows], self.row_upper[rows] = lower[kept], upper[kept]

    def _set(self, name: str, k: int, **values: Any) -> None:
        start = self.assembly.parameter_start[name, k]
        for key, size in self.sizes[name].items():
            if key in values:
                self.parameters[start : start + size] = values[key]
            start += size

    def _effort(self, k: int) -> float:
        """Return the share of the motors' abilities that the plan may use from knot ``k`` to the next."""
        landed = self.of_knot[k].phase is Phase.LANDING
        return self.task.landing_effort if landed else self.task.effort

    def _motor_rows(self, k: int) -> list[Rows]:
        effort = self._effort(k)
        if effort not in self._of_motors:
            self._of_motors[effort] = self._bounds_of_motors(k)
        return self._of_motors[effort]

    def _bounds_of_motors(self, k: int) -> list[Rows]:
        peak, top = self._peak_torque(k), self._top_speed(k)
        line = self._slope() * top
        links = [
            "",
            *(j.child for i in self.coordinates.joints for j in [self.model.robot.joints[i]]),
        ]
        links[0] = self.model.robot.base
        loads = [load.most for load in self.model.loads if load.link in links]
        held = self._effort(k) * np.array(loads)
        return [
            *rows_of_each("motor torque", -peak, peak),
            *rows_of_each("motor torque at speed", -line, line) * 2,
            *rows_of_each("motor speed", -top, top),
            *rows_of_each("held joints", -held, held),
        ]

    def _peak_torque(self, k: int) -> Array:
        """Return the most torque of the computed motors that the plan may use [N m]."""
        chosen = list(self.coordinates.joints)
        return np.asarray(self.model.robot.motors.peak_torque[chosen] * self._effort(k))

    def _top_speed(self, k: int) -> Array:
        """Return the highest speed of the computed motors that the plan may use [rad/s]."""
        chosen = list(self.coordinates.joints)
        return np.asarray(self.model.robot.motors.no_load_speed[chosen] * self._effort(k))

    def _slope(self) -> Array:
        """Return the slope at which the computed motors' torque falls with speed [N m s/rad]."""
        motors, chosen = self.model.robot.motors, list(self.coordinates.joints)
        slope = motors.peak_torque / (motors.no_load_speed - motors.corner_speed)
        return np.asarray(slope[chosen])

    def _interval(self, k: int) -> dict[str, Any]:
        weights, base = self.task.weights, self.free_base
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
        """Return the posture that the cost prefers; on the ground it is that of the first knot there."""
        problem_phase = self.structure.phase_at(k)
        key = k if problem_phase.flies else -1 - problem_phase.place
        if key not in self._nominal:
            self._nominal[key] = self.coordinates.reduce(self.problem.posture(k))
        return self._nominal[key]

    def _fill_stance(self, k: int) -> None:
        weights, share, problem_phase = self.task.weights, self.coordinates.share, self.of_knot[k]
        self._set(
            problem_phase.piece, k, step=self.steps[k], share=self.steps[k],
            force=weights.force * share, friction=self.task.friction / np.sqrt(2.0),
            pressure=self.margins.pressure, **self._interval(k), **self._axes(problem_phase),
        )  # fmt: skip
        base = ("dynamics", len(self.coordinates.rows), 0.0, 0.0)
        pressure = ("pressure", len(self.coordinates.contacts), 0.0, np.inf)
        self._rows(problem_phase.piece, k, [base, *self._motor_rows(k), self._cones(), pressure])

    def _axes(self, problem_phase: ProblemPhase, heading: float = 0.0) -> dict[str, Array]:
        """Return the parameter of a piece on ground that leans: the axes of forces, and of feet where these have that
        heading.
        """
        if not self.leans:
            return {}
        axes = ground_axes(self.stances[problem_phase.place].slope, heading)
        return {"axes": axes.ravel(order="F")}

    def _cones(self) -> Rows:
        cones = 2 * (len(self.coordinates.axes) - 1) * len(self.coordinates.contacts)
        return ("friction", cones, 0.0, np.inf)

    def _fill_impact(self, k: int) -> None:
        top = self._top_speed(k)
        self._set(
            "impact", k, impulse=self.task.weights.impulse,
            friction=self.task.friction / np.sqrt(2.0), **self._axes(self.of_knot[k]),
        )  # fmt: skip
        balance = ("impact", self.n, 0.0, 0.0)
        speeds = rows_of_each("motor speed", -top, top)
        self._rows("impact", k, [balance, *speeds, self._cones()])

    def _fill_flight(self, k: int) -> None:
        self._set("flight", k, share=self.steps[k], **self._interval(k))
        balance = len(self.coordinates.rows) + len(self.coordinates.turning)
        self._rows("flight", k, [("dynamics", balance, 0.0, 0.0), *self._motor_rows(k)])

    def _fill_contact(self, k: int) -> None:
        problem_phase = self.of_knot[k]
        self._place_feet(k)
        feet = self.pieces["contact"].rows // 2
        speeds = [("foot velocity", feet, 0.0, 0.0)]
        if problem_phase.impact:  # hits the ground from above
            *along, down = [most or np.inf for most in self.structure.touchdown_speeds()]
            of_point = [("foot velocity", 1, -most, most) for most in along]
            of_point.append(("foot velocity", 1, -down, np.inf))
            speeds = of_point * len(self.coordinates.contacts)
        self._rows("contact", k, [*speeds, ("footholds", feet, 0.0, 0.0)])

    def _place_feet(self, k: int) -> None:
        """Tell where the feet stand."""
        stance = self.stances[self.of_knot[k].place]
        places = stance.footholds[list(self.coordinates.contacts)].ravel()
        heading = [np.cos(stance.heading), np.sin(stance.heading)]
        axes = self._axes(self.of_knot[k], stance.heading)
        self._set("contact", k, place=places, heading=heading, **axes)

    def _fill_obstacle(self, k: int) -> None:
        hop, place, edge = self.structure.hop_at(k)
        problem_phase, obstacles = self.structure.phase_at(k), self.structure.obstacles
        share = (
            self.structure.flight_share(k)
            if problem_phase.flies
            else float(problem_phase.place > 0)
        )
        end = self.structure.places[min(problem_phase.place + 1, len(self.hops))]
        apart = BODY_CLEARANCE if self.margins.step is None else self.margins.step
        number = min(problem_phase.place, len(self.hops) - 1)
        if number not in self._beside:
            robot = self.exact.robot
            self._beside[number] = side_clearance(robot, hop, edge, place, end, apart)
        found = step_parameters(hop, edge, place, end, share, self.leans, self._beside[number])
        self._set("obstacle", k, **found)
        floor = self.task.foot_clearance * np.sin(np.pi * share)
        self._rows("obstacle", k, [
            ("ground clearance", obstacles.feet, floor, np.inf),
            ("ground clearance", obstacles.count - obstacles.feet, apart, np.inf),
        ])  # fmt: skip

    def _fill_take_off(self, k: int) -> None:
        hop, problem_phase = self.structure.hop_at(k)[0], self.of_knot[k]
        rise = self.stances[problem_phase.place].com[2] + (hop.rise or 0.0)
        speeds = (self.margins.lift_off_speed or 0.0, np.inf)
        if hop.take_off_speed is not None:
            speeds = (hop.take_off_speed, hop.take_off_speed)
        lift_off, touchdown = self.task.lift_off_momentum, self.task.touchdown_momentum
        given = lift_off if problem_phase.flies else touchdown
        most = np.inf if given is None else given
        self._rows("take_off", k, [
            ("apex", 1, rise, rise), ("take-off speed", 1, *speeds),
            ("angular momentum", 3, -most, most),
        ])  # fmt: skip

    def _fill_air(self, k: int) -> None:
        """Keep feet and calves above the ground. At a step they are above the higher ground while it is under them, and
        at one knot, about ``STEP_DOWN_SHARE`` or ``STEP_UP_SHARE`` of the flight's time, also on the lower side of the
        edge.
        """
        task, points = self.task, self._body_points
        n_feet, place = len(self.coordinates.contacts), self.of_knot[k].place
        here = self.structure.places[place]
        low = self._ground_of_air(k, here) if self.leans else here.z
        if not self.of_knot[k].flies:
            others = 2 * len(points) + len(self._leg_gaps)
            self._rows("air", k, [("ground clearance", len(points), low, np.inf),
                                  ("ground clearance", others, -np.inf, np.inf)])  # fmt: skip
            return
        share = self.structure.flight_share(k)
        step, edge = self.structure.step_under(k)
        higher, lower_side = self.structure.over_step(k)
        if self.leans:
            behind = higher is (step > 0.0)
            ground = self._ground_of_air(k, self.structure.places[place + 1] if behind else here)
        else:
            ground = low + (max(step, 0.0) if higher else min(step, 0.0))
        floor = ground + task.foot_clearance * np.sin(np.pi * share)
        ahead = (-np.inf, np.inf)
        if lower_side and edge is not None:
            forward = (self.hops[place].distance_x or 0.0) > 0.0
            apart = self.margins.step or 0.0
            ahead = (-np.inf, edge - apart) if (step > 0.0) is forward else (edge + apart, np.inf)
        free = ("ground clearance", len(points) - n_feet, -np.inf, np.inf)
        self._rows("air", k, [
            ("ground clearance", n_feet, floor, np.inf),
            ("ground clearance", len(points) - n_feet, ground, np.inf),
            ("ground clearance", n_feet, *ahead),
            free,
            *(("leg clearance", 1, 0.5 * task.leg_clearance if side else -np.inf, np.inf)
              for _, _, side in points),
            *(("leg clearance", 1, gap, np.inf) for gap in self._leg_gaps),
        ])  # fmt: skip

    @cached_property
    def _leg_gaps(self) -> list[float]:
        """Least gaps [m] between fore and hind legs: the task's, or those of the standing robot where it has less."""
        count = self.structure.leg_pairs
        if not count:
            return []
        standing = self.coordinates.reduce(self.stances[0].coordinates)
        level = np.zeros(sum(self.sizes["air"].values()))
        gaps = np.array(self.pieces["air"].value(standing, level)[1]).ravel()[-count:]
        return [min(self.task.leg_clearance, gap) for gap in gaps.tolist()]

    def _ground_of_air(self, k: int, place: StanceLocation) -> float:
        """Let the piece's heights count from the ground under a place; that height is 0 then."""
        self._set("air", k, ground=np.array(place.plane))
        return 0.0
