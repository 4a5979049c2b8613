"""Variables and rows of a jump's problem at each of its knots.

What is given there comes with it: the start, the end, times, and no force on points that are not on
the ground.

The ``contact`` piece has, for every contact point, its place error along the foot, across it and upwards, with
the errors' velocities before them. A foot is rigid, so not all of its points' rows are independent,
and dependent rows make the solver's matrix singular. A point foot is held by its three rows. A line
foot is held by five, as it turns about its own line: ``along`` is held at one of its points only. A
flat foot is held by six. The rows are chosen one after the other, points in their order, each only
if it adds to the rank.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Indices
from ...robots.description import RobotDescription
from ...robots.limb import chain_to
from ..models.coordinates import Coordinates
from ..models.robot_model import Stance
from ..models.symbolic_model import SymbolicModel
from ..task.sequence import Hop, StanceLocation, edge_of, ground_axes, step_of
from ..task.task import JumpTask
from .assembly import Knot
from .layout import ProblemPhase, layout
from .leg_rows import fore_and_hind
from .obstacles import ObstacleRows
from .stage_functions import StageFunction

LENGTH = 0.05
"""m; turns of a foot count as velocities at this distance."""
TOLERANCE = 1e-2
"""Points of a foot that are closer to a line than this times ``LENGTH`` are on one."""


def reduced_contacts(coordinates: Coordinates, points: Iterable[int]) -> set[int]:
    """Return those of the coordinates' own contact points that are among the robot's ``points``."""
    chosen = set(points)
    return {i for i, c in enumerate(coordinates.contacts) if c in chosen}


def is_mirrored(coordinates: Coordinates, points: Iterable[int]) -> bool:
    """Check whether a mirrored motion can stand on these of the robot's points."""
    chosen, matrix = set(points), coordinates.force_matrix
    own = reduced_contacts(coordinates, chosen)
    every = len(coordinates.axes)
    reached = {
        c for i in own for c in range(len(matrix) // 3)
        if np.any(matrix[3 * c : 3 * c + 3, every * i : every * (i + 1)])
    }  # fmt: skip
    return reached == chosen


class ContactRows:
    """The rows of the piece for sets of contact points, indices among the coordinates' own.

    ``places`` are all contact points as the robot stands (n_contacts, 3), in axes along the feet,
    across them and upwards.
    """

    def __init__(self, robot: RobotDescription, coordinates: Coordinates, places: Array) -> None:
        self._foot = tuple(robot.contacts[c].foot for c in coordinates.contacts)
        self._place = places[list(coordinates.contacts)]
        self._axes = tuple(coordinates.axes)
        self._each = len(coordinates.axes)
        self._errors = self._each * len(self._foot)

    def velocities(self, points: set[int]) -> Indices:
        """Return the rows of the velocities of points on the ground."""
        return self._rows(points, set())

    def speeds(self, points: set[int], axes: Iterable[int]) -> Indices:
        """Return the rows of the velocities of points that hit the ground, in those of their axes: the last one is
        upwards, those before it along the foot and across it.
        """
        rows = [self._each * i + axis for i in sorted(points) for axis in axes]
        return np.array(rows, dtype=np.int64)

    def places(self, points: set[int], held: set[int]) -> Indices:
        """Return the rows of the places of points that come to the ground while others are ``held`` there."""
        return self._rows(points - held, points & held) + self._errors

    def _rows(self, points: set[int], others: set[int]) -> Indices:
        """Return the rows of points that say what no row before them does, nor those of the others."""
        places = tuple(map(tuple, self._place.tolist()))
        found = _independent(self._foot, places, self._axes, frozenset(points), frozenset(others))
        return np.array(found, dtype=np.int64)


@lru_cache(maxsize=256)
def _independent(
    of_foot: tuple[str, ...], places: tuple[tuple[float, ...], ...], axes: tuple[int, ...],
    points: frozenset[int], others: frozenset[int],
) -> tuple[int, ...]:  # fmt: skip
    """Return the independent rows. Few sets occur, but at every knot of a problem, and robots begin in few stances."""
    rows = list[int]()
    place = np.array(places)
    for foot in dict.fromkeys(of_foot):
        here = [i for i in range(len(of_foot)) if of_foot[i] == foot]
        centre = place[here].mean(axis=0)
        known = [_motion(place[i] - centre, axis, axes)
                 for i in here if i in others for axis in axes]  # fmt: skip
        rank = _rank(known)
        for i in here:
            if i not in points:
                continue
            for number, axis in enumerate(axes):
                more = [*known, _motion(place[i] - centre, axis, axes)]
                if _rank(more) > rank:
                    known, rank = more, rank + 1
                    rows.append(len(axes) * i + number)
    return tuple(sorted(rows))


def _motion(arm: Array, axis: int, axes: tuple[int, ...]) -> Array:
    """Return the effect of a foot's own motion, three velocities and three turns, on a point along an axis; ``arm``
    leads to the point. In the sagittal plane a foot turns about y only.
    """
    direction = np.eye(3)[axis]
    turns = np.cross(arm / LENGTH, direction)
    if 1 not in axes:
        turns[[0, 2]] = 0.0
    return np.concatenate([direction, turns])


def _rank(rows: list[Array]) -> int:
    return int(np.linalg.matrix_rank(np.array(rows), tol=TOLERANCE)) if rows else 0


STEP_UP_SHARE, STEP_DOWN_SHARE = 0.45, 0.5
"""Shares of the flight at which feet pass a step's edge. Feet that pass a high platform's edge later
must be drawn up to the falling body first, and then stretched at once."""


def _along_feet(stance: Stance) -> Array:
    """Return the contact points of a stance in axes along its heading, across it and normal to the ground."""
    return np.asarray(stance.points @ ground_axes(stance.slope, stance.heading))


class Structure:
    """The knots of a task's problem in those coordinates.

    Attributes:
        problem_phases: the phases with their intervals; ``of_knot`` that of every interval.
        given: by knot the variables that are given there, their values and families.
        knots: all of them, the end included.
    """

    def __init__(
        self,
        task: JumpTask,
        model: SymbolicModel,
        coordinates: Coordinates,
        pieces: Mapping[str, StageFunction],
        stances: Sequence[Stance],
    ) -> None:
        self.coordinates, self.pieces = coordinates, pieces
        self.n, self.forces = coordinates.size, coordinates.forces
        self._in_legs = {k for f in model.robot.feet for k in chain_to(model.robot, f.link)}
        self._lead(task, stances)
        self.problem_phases = layout(task, model.robot)
        self.of_knot = [
            problem_phase
            for problem_phase in self.problem_phases
            for _ in range(problem_phase.count)
        ]
        self.contact_rows = ContactRows(model.robot, coordinates, _along_feet(self.stances[0]))
        self.obstacles = ObstacleRows(model, coordinates)
        self.leg_pairs = len(fore_and_hind(model, coordinates))
        self.given: dict[int, list[tuple[int, float, str]]] = {}
        self._kept: dict[ProblemPhase, NDArray[np.int64]] = {}
        self.knots = self._knots()

    def _knots(self) -> list[Knot]:
        n, end = self.n, len(self.of_knot)
        knots = []
        for k, problem_phase in enumerate(self.of_knot):
            before = self.of_knot[k - 1] if k else None
            after = self.of_knot[k + 1] if k + 1 < end else None
            states = 2 * n + problem_phase.timed
            holds = after is not None and after is not problem_phase and after.timed
            own = n + (len(self.coordinates.turning) if problem_phase.flies else self.forces)
            knot = Knot(states, own + holds, gap=problem_phase.piece)
            knot.hold = own if holds else None
            take = np.arange(states + own)
            knot.pieces[problem_phase.piece] = (take, self._interval_rows(problem_phase))
            q_and_v = np.arange(2 * n)
            if problem_phase.flies and k > problem_phase.first:
                knot.pieces["air"] = (np.arange(n), self._air_rows(k))
            moment = self._moment_rows(before, problem_phase, k)
            if moment is not None:
                knot.pieces["take_off"] = (q_and_v, moment)
            if before is not None:
                kept = self._contact_rows(before, problem_phase)
                if len(kept):
                    knot.pieces["contact"] = (q_and_v, kept)
            obstacle = self._obstacle_rows(k)
            if k and len(obstacle):
                knot.pieces["obstacle"] = (np.arange(n), obstacle)
            idle = self.idle(problem_phase)
            if idle and k and not problem_phase.impact:
                knot.pieces["air"] = (np.arange(n), np.array(idle))
            self._give(k, knot, problem_phase, after if holds else None)
            knots.append(knot)
        # The last interval leads to a knot that has no interval length among its states.
        self.given[end] = self._given_at_the_end()
        fixed = tuple(i for i, _, _ in self.given[end])
        last = Knot(2 * n, 0, fixed=fixed)
        obstacle = self._obstacle_rows(end)
        # Where the base is given, knees can still fold.
        if self.obstacles.knees_fold and len(obstacle):
            last.pieces["obstacle"] = (np.arange(n), obstacle)
        return [*knots, last]

    def _given_at_the_end(self) -> list[tuple[int, float, str]]:
        """Return what is given at the end: the robot stands still, its base and what is in no leg where they are in the
        stance; the legs follow from base and feet.
        """
        at_rest = self.coordinates.reduce(self.stances[-1].coordinates)
        base = len(self.coordinates.free_base)
        free = [base + i for i, k in enumerate(self.coordinates.moving) if k not in self._in_legs]
        values = [(i, float(at_rest[i]), "stance") for i in (*range(base), *free)]
        return values + [(self.n + i, 0.0, "stance") for i in range(self.n)]

    def moved(self, task: JumpTask, stances: Sequence[Stance]) -> Structure:
        """Return the structure for a task of the same structure that leads elsewhere, see ``ProblemBuilder.moved``."""
        found = copy(self)
        found._lead(task, stances)
        found.given = self.given | {len(self.of_knot): found._given_at_the_end()}
        return found

    def _lead(self, task: JumpTask, stances: Sequence[Stance]) -> None:
        """Take on where the task leads."""
        self.task, self.stances = task, tuple(stances)
        self.hops, self.places = task.hops(), task.places()
        begun = [*zip(self.hops, self.places, strict=False)]
        self._edges = [edge_of(hop, at) for hop, at in begun]
        self._steps = [step_of(hop, at) for hop, at in begun]

    def _give(
        self, k: int, knot: Knot, problem_phase: ProblemPhase, timed: ProblemPhase | None
    ) -> None:
        """Fix what is given at a knot: the start, forces on points without contact, a next time."""
        n, given = self.n, []
        if k == 0:
            start = self.coordinates.reduce(self.stances[0].coordinates)
            given += [(i, float(start[i]), "stance") for i in range(n)]
            given += [(n + i, 0.0, "stance") for i in range(n)]
        every = len(self.coordinates.axes)
        first = knot.states + n
        for point in self.idle(problem_phase):
            given += [(first + point * every + i, 0.0, "friction") for i in range(every)]
        if timed is not None and timed.time is not None and knot.hold is not None:
            given.append((knot.states + knot.hold, timed.time / timed.count, "flight time"))
        if given:
            self.given[k] = given
            knot.fixed = tuple(i for i, _, _ in given)

    def idle(self, problem_phase: ProblemPhase) -> list[int]:
        """Return the contact variables' points that are not on the ground in a stance."""
        if problem_phase.flies:
            return []
        on = reduced_contacts(self.coordinates, problem_phase.contacts)
        return [i for i in range(len(self.coordinates.contacts)) if i not in on]

    def _interval_rows(self, problem_phase: ProblemPhase) -> NDArray[np.int64]:
        """Return ``_kept_rows``, worked out once for a phase."""
        if problem_phase not in self._kept:
            self._kept[problem_phase] = self._kept_rows(problem_phase)
        return self._kept[problem_phase]

    def _kept_rows(self, problem_phase: ProblemPhase) -> NDArray[np.int64]:
        """Return the rows of an interval that are kept: no friction where there is no contact, and pressure only where
        a share is required and the whole foot is down.
        """
        total, points = self.pieces[problem_phase.piece].rows, len(self.coordinates.contacts)
        rows = np.arange(2 * self.n + problem_phase.timed, total)
        if problem_phase.flies:
            return rows
        each = 2 * (len(self.coordinates.axes) - 1)
        pressure = 0 if problem_phase.impact else points
        cones = total - pressure - each * points
        idle = [cones + each * point + i for point in self.idle(problem_phase) for i in range(each)]
        if idle or self.task.margins is None or not self.task.margins.pressure:
            idle += range(total - pressure, total)
        return np.setdiff1d(rows, idle) if idle else rows

    def _contact_rows(self, before: ProblemPhase, problem_phase: ProblemPhase) -> NDArray[np.int64]:
        """Return the rows that hold the feet at the knot between two intervals."""
        held, now = (
            set() if s.flies else reduced_contacts(self.coordinates, s.contacts)
            for s in (before, problem_phase)
        )  # fmt: skip
        if problem_phase.impact:
            bounded = [
                axis for axis, most in enumerate(self.touchdown_speeds()) if most is not None
            ]
            return np.concatenate(
                [self.contact_rows.speeds(now, bounded), self.contact_rows.places(now, set())]
            )
        if before.impact:
            return self.contact_rows.velocities(now)
        velocities = self.contact_rows.velocities(held | now)
        return np.concatenate([velocities, self.contact_rows.places(now, held)])

    def touchdown_speeds(self) -> list[float | None]:
        """Return the most [m/s] that a point may move where it hits the ground: along the foot, across it (not in the
        sagittal plane) and downwards.
        """
        margins, sideways = self.task.margins, len(self.coordinates.axes) - 1
        if margins is None:
            return [None] * (sideways + 1)
        return [*[margins.touchdown_slide] * sideways, margins.touchdown_speed]

    def _air_rows(self, k: int) -> NDArray[np.int64]:
        """Return the rows that are needed: the distance ahead only where there is an edge."""
        rows = self.pieces["air"].rows
        points = (rows - self.leg_pairs) // 3
        feet = len(self.coordinates.contacts)
        ahead = np.arange(points, points + feet)
        if self.hops[self.of_knot[k].place].rotation:
            return np.arange(2 * points, rows)
        if not self.over_step(k)[1]:
            ahead = ahead[:0]
        return np.concatenate([np.arange(points), ahead, np.arange(2 * points, rows)])

    def phase_at(self, k: int) -> ProblemPhase:
        """Return the phase of the interval that begins with a knot; at the end that of the last one."""
        return self.of_knot[min(k, len(self.of_knot) - 1)]

    def hop_at(self, k: int) -> tuple[Hop, StanceLocation, float | None]:
        """Return the jump under way at a knot, or the last one; where it began, and its step's edge."""
        number = min(self.phase_at(k).place, len(self.hops) - 1)
        return self.hops[number], self.places[number], self._edges[number]

    def _obstacle_rows(self, k: int) -> NDArray[np.int64]:
        hop, _, edge = self.hop_at(k)
        problem_phase = self.phase_at(k)
        return self.obstacles.rows(hop, edge, problem_phase, k == problem_phase.first)

    def _moment_rows(
        self, before: ProblemPhase | None, problem_phase: ProblemPhase, k: int
    ) -> NDArray[np.int64] | None:
        """Return the rows of a lift-off (apex or speed, angular momentum) or a touchdown (angular momentum); ``None``
        at any other knot.
        """
        lift_off = problem_phase.flies and k == problem_phase.first
        kept = []
        if lift_off:
            hop = self.hops[problem_phase.place]
            margins = self.task.margins
            least = None if margins is None else margins.lift_off_speed
            kept = [0] if hop.rise is not None else []
            kept += [1] if hop.take_off_speed is not None or least is not None else []
        elif not self.is_touchdown(before, problem_phase) or self.task.touchdown_momentum is None:
            return None
        most = self.task.lift_off_momentum if lift_off else self.task.touchdown_momentum
        if most is not None:
            # The momentum about an axis is a base moment's: zero by symmetry, or to be bounded.
            kept += [row - 1 for row in self.coordinates.rows if row >= 3]
        return np.array(kept, dtype=np.int64)

    @staticmethod
    def is_touchdown(before: ProblemPhase | None, problem_phase: ProblemPhase) -> bool:
        """Check whether a knot between two intervals is the first on the ground, behind any impact."""
        landed = before is not None and (before.flies or before.impact)
        return landed and not problem_phase.flies and not problem_phase.impact

    def step_under(self, k: int) -> tuple[float, float | None]:
        """Return the step's height and its edge under a flight."""
        place = self.of_knot[k].place
        return self._steps[place], self._edges[place]

    def over_step(self, k: int) -> tuple[bool, bool]:
        """Return whether feet are above the higher ground at a flight's knot, and whether they are on the lower side of
        the edge. At the first knot of a step's later part both are true, or they could cut the corner between that knot
        and the one before it.
        """
        step, edge = self.step_under(k)
        switch = 0.5 if edge is None else STEP_UP_SHARE if step > 0.0 else STEP_DOWN_SHARE
        late, first = self.flight_share(k) >= switch, self.flight_share(k - 1) < switch
        higher = late if step > 0.0 else not late or (first and edge is not None)
        lower_side = (not late or first) if step > 0.0 else late
        return higher, lower_side and edge is not None

    def flight_share(self, k: int) -> float:
        """Return the share of the flight's time that is past at a knot of it."""
        problem_phase = self.of_knot[k]
        return float(
            problem_phase.lengths[: max(0, k - problem_phase.first)].sum() / problem_phase.count
        )
