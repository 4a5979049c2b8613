"""The ``srbm`` formulation: a jump of a single rigid body with footholds given.

Centre of mass and torso move under the contact forces; the legs weigh nothing and only bound how far
the hips may be from the ankles. At lift-off and touchdown legs are no longer than standing, as a foot
that leaves the ground needs length to gain speed. The flight's time is free. Motors and joints are
not in it; the whole body's motion is found afterwards, by ``solving/rigid_body_plan``.

The body's centre of mass is the robot's, its inertia that of the whole robot as it stands, and its
frame the torso's. With r the centre of mass and e the Euler angles pitch, roll, yaw of the torso:

``stance``  z = r, e, rdot, edot, a, F.     Rows: gap (12), force (3) and moment balance (3), friction
            pyramid (4 a contact point).
``flight``  z = r, e, rdot, edot, h, a.     Interval of ``share`` h seconds. Rows: gap (13), balances.
``legs``    z = r, e.                       Rows: squared length of every leg from hip to ankle.
``take_off`` z = r, rdot.                   Rows: apex height, vertical speed.

Over an interval the six accelerations a are constant and the balances, Newton's and Euler's, hold in
its middle: m (a + g) = sum F and R (I wdot + w x I w) = sum (c - r) x F.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ..models.robot_model import Stance
from ..models.simple_models import RigidBody, ankles
from ..models.symbolic_model import (
    SymbolicModel,
    base_angular_acceleration,
    base_angular_velocity,
    base_rotation,
)
from ..task.phase import Phase
from ..task.task import JumpTask
from .assembly import Knot
from .program import BoundsBuilder, SimpleProblem, ballistic_flight, uniform_grid
from .stage_functions import StageFunction, derived

NAME = "srbm"
PIECES = ("stance", "flight", "legs", "take_off")
SOURCES = (
    "models/symbolic_model.py",
    "problem/stage_functions.py",
    "problem/rigid_body_problem.py",
)


def parameter_sizes(model: SymbolicModel) -> dict[str, dict[str, int]]:
    """Return the parameters ``w`` of every piece: name -> size, in order."""
    contacts, legs = len(model.robot.contacts), len(model.limbs)
    weights = {"nominal": 3, "orientation": 1, "rates": 1, "acceleration": 1}
    return {
        "stance": {"step": 1, "inertia": 9, **weights, "force": 1, "friction": 1,
                   "place": 3 * contacts},
        "flight": {"share": 1, "inertia": 9, **weights},
        "legs": {"hip": 3 * legs, "ankle": 3 * legs},
        "take_off": {},
    }  # fmt: skip


def make_piece(model: SymbolicModel, name: str) -> StageFunction:
    """Return the functions of a piece with exact derivatives."""
    import casadi as ca

    w = {key: ca.SX.sym(key, size) for key, size in parameter_sizes(model)[name].items()}
    cost: Any = ca.SX(0)
    if name == "legs":
        z = ca.SX.sym("z", 6)
        turn = base_rotation(z[3:])
        hips, ankles = (ca.reshape(w[key], 3, -1) for key in ("hip", "ankle"))
        reach = [z[:3] + ca.mtimes(turn, hips[:, i]) - ankles[:, i] for i in range(hips.size2())]
        rows = ca.vertcat(*(ca.dot(leg, leg) for leg in reach))
    elif name == "take_off":
        z = ca.SX.sym("z", 6)
        rows = ca.vertcat(z[2] + z[5] ** 2 / (2.0 * GRAVITY), z[5])
    else:
        z, cost, rows = _interval(model, name, w)
    return derived(f"{NAME}_{name}", z, ca.vertcat(*w.values()), cost, rows)


def _interval(model: SymbolicModel, name: str, w: Any) -> tuple[Any, Any, Any]:
    import casadi as ca

    flies = name == "flight"
    place, rate, a = (ca.SX.sym(s, 6) for s in ("place", "rate", "a"))
    length = ca.SX.sym("h")
    F = ca.SX.sym("F", 0 if flies else 3 * len(model.robot.contacts))
    h = w["share"] * length if flies else w["step"]
    middle = place + 0.5 * h * rate + 0.125 * h * h * a
    moving = rate + 0.5 * h * a
    forces = [F[3 * j : 3 * j + 3] for j in range(F.numel() // 3)]
    pushed: Any = ca.SX.zeros(3)
    turned: Any = ca.SX.zeros(3)
    cones = []
    for j, force in enumerate(forces):
        pushed = pushed + force
        turned = turned + ca.cross(w["place"][3 * j : 3 * j + 3] - middle[:3], force)
        reach = w["friction"] * force[2]
        cones += [reach - force[0], reach + force[0], reach - force[1], reach + force[1]]
    inertia = ca.reshape(w["inertia"], 3, 3)
    spin = base_angular_velocity(middle[3:], moving[3:])
    spun = base_angular_acceleration(middle[3:], moving[3:], a[3:])
    moment = ca.mtimes(inertia, spun) + ca.cross(spin, ca.mtimes(inertia, spin))
    balance = a[:3] + ca.DM([0.0, 0.0, GRAVITY]) - pushed / model.robot.total_mass
    gap = [-(place + h * rate + 0.5 * h * h * a), -(rate + h * a), *([-length] if flies else [])]
    off = place[3:] - w["nominal"]
    cost = (
        w["orientation"] * ca.dot(off, off)
        + w["rates"] * ca.dot(rate[3:], rate[3:])
        + w["acceleration"] * ca.dot(a, a)
    )
    if forces:
        cost = cost + w["force"] * ca.dot(F, F)
    turn = base_rotation(middle[3:])
    rows = ca.vertcat(*gap, balance, ca.mtimes(turn, moment) - turned, *cones)
    z = ca.vertcat(place, rate, length, a) if flies else ca.vertcat(place, rate, a, F)
    return z, h * cost, rows


SHORTEST_FLIGHT, LONGEST_FLIGHT = 0.04, 1.5
"""s"""
STATES = 12


class RigidBodyProblemBuilder:
    """Builds the single rigid body's problem of a task."""

    def __init__(
        self,
        task: JumpTask,
        model: SymbolicModel,
        pieces: Mapping[str, StageFunction],
        body: RigidBody,
        start: Stance,
        end: Stance,
    ) -> None:
        self.task, self.model, self.pieces, self.body = task, model, pieces, body
        self.start, self.end = start, end
        self.grid = uniform_grid(
            task, model.robot, float(task.knots.flight)
        )  # lengths in units of their mean
        self.up, self.flight_time = ballistic_flight(task)
        self.flight = self.grid.flight
        self.last = len(self.grid.phases)
        self.forces = 3 * len(model.robot.contacts)
        self.ankles = {id(stance): ankles(model.robot, stance) for stance in (start, end)}

    def build(self) -> SimpleProblem:
        """Return the problem with its bounds, parameters and guess."""
        self.fill = BoundsBuilder(self._knots(), self.pieces, parameter_sizes(self.model))
        for k in range(self.last + 1):
            for name in self.fill.assembly.knots[k].pieces:
                getattr(self, f"_fill_{'interval' if name in ('stance', 'flight') else name}")(k)
            self._guess(k)
        self.fill.fix(0, "stance", self._at_rest(self.start))
        self.fill.fix(self.last, "stance", self._at_rest(self.end))
        self._bound_flight_time()
        return self.fill.done(self.task, self.model, self.grid, self.start, self.end)

    @staticmethod
    def _at_rest(stance: Stance) -> Array:
        return np.concatenate([stance.com, stance.coordinates[3:6], np.zeros(6)])

    def _knots(self) -> list[Knot]:
        knots = []
        for k, phase in enumerate(self.grid.phases):
            flies = phase is Phase.FLIGHT
            name, states = ("flight", STATES + 1) if flies else ("stance", STATES)
            holds = k == self.flight.start - 1
            controls = 6 + (0 if flies else self.forces)
            knot = Knot(states, controls + holds, gap=name)
            knot.hold = controls if holds else None
            rows = np.arange(states, self.pieces[name].rows)
            knot.pieces[name] = (np.arange(states + controls), rows)
            if k > 0 and (not flies or k == self.flight.start):
                knot.pieces["legs"] = (np.arange(6), np.arange(self.pieces["legs"].rows))
            if k == self.flight.start:
                row = [0] if self.task.rise else [1] if self.task.take_off_speed else []
                if row:
                    moving = np.array([0, 1, 2, 6, 7, 8])
                    knot.pieces["take_off"] = (moving, np.array(row))
            knots.append(knot)
        knots[0].fixed = tuple(range(STATES))
        return [*knots, Knot(STATES, 0, fixed=tuple(range(STATES)))]

    def _bound_flight_time(self) -> None:
        at = int(self.fill.assembly.control_start[self.flight.start - 1]) + 6 + self.forces
        given = self.task.flight_time
        low, high = (given, given) if given else (SHORTEST_FLIGHT, LONGEST_FLIGHT)
        self.fill.lower[at], self.fill.upper[at] = low / len(self.flight), high / len(self.flight)
        self.fill.guess[at] = self.flight_time / len(self.flight)

    def _stance_at(self, k: int) -> Stance:
        return self.start if k <= self.flight.start else self.end

    def _fill_interval(self, k: int) -> None:
        weights = self.task.weights
        share = min(max((k - self.flight.start) / len(self.flight), 0.0), 1.0)
        name = "flight" if self.grid.phases[k] is Phase.FLIGHT else "stance"
        nominal = (1.0 - share) * self.start.coordinates + share * self.end.coordinates
        common = {
            "inertia": self.body.inertia.ravel(),
            "nominal": nominal[3:6],
            "orientation": weights.orientation,
            "rates": weights.joint_velocity,
            "acceleration": weights.acceleration,
        }
        rows = [("dynamics", 6, 0.0, 0.0)]
        if name == "stance":
            common |= {"step": self.grid.steps[k], "force": weights.force,
                       "friction": self.task.friction / np.sqrt(2.0),
                       "place": self._stance_at(k).points.ravel()}  # fmt: skip
            rows.append(("friction", 4 * self.forces // 3, 0.0, np.inf))
            force = int(self.fill.assembly.control_start[k]) + 6
            self.fill.lower[force + 2 : force + self.forces : 3] = 0.0
        else:
            common["share"] = self.grid.steps[k]
        self.fill.set(name, k, **common)
        self.fill.rows(name, k, rows)

    def _fill_legs(self, k: int) -> None:
        down = self.up - GRAVITY * self.flight_time
        hops = {self.flight.start: self.up, self.flight.stop: down}
        longest = self.body.at_hop(hops[k]) if k in hops else self.body.longest
        stance = self._stance_at(k)
        self.fill.set("legs", k, hip=self.body.hips.ravel(), ankle=self.ankles[id(stance)].ravel())
        count = len(self.body.hips)
        self.fill.rows("legs", k, [("leg length", count, self.body.shortest**2, longest**2)])

    def _fill_take_off(self, k: int) -> None:
        if self.task.rise:
            apex = float(self.start.com[2]) + self.task.rise
            self.fill.rows("take_off", k, [("apex", 1, apex, apex)])
        else:
            self.fill.rows("take_off", k, [("take-off speed", 1, self.up, self.up)])

    def _guess(self, k: int) -> None:
        """Return the guess: standing, a ballistic flight, standing; the weight shared by all contact points."""
        assembly, share = self.fill.assembly, (k - self.flight.start) / len(self.flight)
        at = int(assembly.state_start[k])
        state = self._at_rest(self._stance_at(k))
        if k in self.flight:
            time, travel = share * self.flight_time, self._at_rest(self.end)
            travel = (travel - self._at_rest(self.start))[:6] / self.flight_time
            state[:6] += time * travel
            state[6:] = travel
            state[2] = self.start.com[2] + self.up * time - 0.5 * GRAVITY * time * time
            state[8] = self.up - GRAVITY * time
            self.fill.guess[at + STATES] = self.flight_time / len(self.flight)
        self.fill.guess[at : at + STATES] = state
        if k == self.last:
            return
        control = int(assembly.control_start[k])
        if self.grid.phases[k] is Phase.FLIGHT:
            self.fill.guess[control + 2] = -GRAVITY
        else:
            weight = 3.0 * self.model.robot.total_mass * GRAVITY / self.forces
            self.fill.guess[control + 8 : control + 6 + self.forces : 3] = weight
