"""The ``paper`` formulation: the jump problem of the paper's section III, as it is written there.

Decision variables, integration, cost and constraints are those of equations (1) to (16) of that
section; the pieces below have them. What the paper leaves open is chosen so:

- The boundary set Q holds the paper's examples, r[1], r[N], the heights in stance and in flight and
  the take-off velocity; also joint limits, rest at both ends, and the base's pose at the end. A task may add
  bounds on attitude (``margins.squat_lean``, ``margins.landing_lean``, ``touchdown_lean``), joints
  (``margins.joints``, ``margins.landing_limits``), momentum (``lift_off_momentum``, ``touchdown_momentum``) and, by
  ``bounds``, on joint velocities, forces and momentum at all times.
- dt is fixed, the same within every phase. The flight lasts as long as the ballistic flight of the
  asked rise from standing height to standing height takes.
- The friction cone, printed with a squared F_z, is sqrt(F_x^2 + F_y^2) <= mu F_z.
- The weights are the task's, those of forces and of h's rate scaled up, because the acceleration of
  the centre of mass has the weight one, as in the paper.

There are no motor limits, no clearance of feet, calves and legs, no velocity of the feet at
touchdown, and the integration is of first order: the validity check says what that costs.

The variables are the paper's: at knot k positions q[k] (7 + n, with a quaternion), velocities v[k]
(6 + n), centre of mass r[k], rdot[k], rddot[k], contact forces F_j[k] and angular momentum h[k].
Its integration, "[k] - [k-1] = rate[k] dt", makes q, r, rdot, h the states of a knot and v, rddot, F
of the *next* knot its controls: every equation of knot k + 1 is written here in x = (q, r, rdot,
h)[k] and u = (v, rddot, F)[k+1], with what the integration leads to in place of (q, r, rdot, h)[k+1].
The solutions are the same, and the problem has the order in time that fatrop wants.

``stance``   z = x, u.  Rows: integration of q, r, rdot, h; linear momentum rate (3), momentum h =
             A(q) v (3), friction cone (a row a contact point).
``flight``   the same without F.
``posture``  z = x.     Rows: r - f_com(q) (3), f_contact(q) - c along, across and up (3 a contact point). Of the
             points of a foot that are on the ground only the first has a row along it, as their distances are fixed.
``attitude`` z = quaternion.  Rows: the turn from the wanted one (3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ..models import simple_models as centroidal
from ..models.euler_angles import pose_of
from ..models.robot_model import Stance
from ..models.symbolic_model import SymbolicModel
from ..task.margins import joint_bounds
from ..task.phase import Phase
from ..task.task import JumpTask
from .assembly import Knot
from .program import BoundsBuilder, Grid, SimpleProblem, ballistic_flight, uniform_grid
from .stage_functions import StageFunction, derived

NAME = "paper"
PIECES = ("stance", "flight", "posture", "attitude")
TIP = 1e-2
"""N, how far the friction cone's tip is rounded, inwards, to be smooth where there is no force."""
SOURCES = (
    "models/symbolic_model.py",
    "problem/stage_functions.py",
    "models/simple_models.py",
    "problem/paper_problem.py",
)


def state_size(model: SymbolicModel) -> int:
    """Return the numbers in q, r, rdot and h."""
    return model.size + 1 + 9


def parameter_sizes(model: SymbolicModel) -> dict[str, dict[str, int]]:
    """Return the parameters ``w`` of every piece: name -> size, in order. ``Q_q``, ``Q_v``, ``Q_h`` and ``Q_f`` are the
    diagonals of the cost's weights, ``q_nom`` its nominal position.
    """
    contacts = len(model.robot.contacts)
    weights = {"q_nom": model.size + 1, "Q_q": model.size + 1, "Q_v": model.size, "Q_h": 1}
    return {
        "stance": {"step": 1, **weights, "Q_f": 1, "friction": 1, "place": 3 * contacts},
        "flight": {"step": 1, **weights},
        "posture": {"place": 3 * contacts, "heading": 2},
        "attitude": {"wanted": 4},
    }


def make_piece(model: SymbolicModel, name: str) -> StageFunction:
    """Return the functions of a piece with exact derivatives."""
    import casadi as ca

    w = {key: ca.SX.sym(key, size) for key, size in parameter_sizes(model)[name].items()}
    if name == "attitude":
        z = ca.SX.sym("quaternion", 4)
        cost, rows = _attitude(z, w)
    elif name == "posture":
        z = ca.SX.sym("x", state_size(model))
        cost, rows = _posture(model, z, w)
    else:
        x, v, pull = (
            ca.SX.sym("x", state_size(model)), ca.SX.sym("v", model.size), ca.SX.sym("rddot", 3)
        )  # fmt: skip
        F = ca.SX.sym("F", 3 * len(model.robot.contacts) if name == "stance" else 0)
        z = ca.vertcat(x, v, pull, F)
        cost, rows = _interval(model, x, v, pull, F, w)
    return derived(f"{NAME}_{name}", z, ca.vertcat(*w.values()), cost, rows)


def _interval(model: SymbolicModel, x: Any, v: Any, pull: Any, F: Any, w: Any) -> tuple[Any, Any]:
    """Return the rows of knot k + 1, the integration, momentum rates and the friction cone, and its cost."""
    import casadi as ca

    n, dt, mass = model.size + 1, w["step"], model.robot.total_mass
    q, r, speed, h = x[:n], x[n : n + 3], x[n + 3 : n + 6], x[n + 6 :]
    forces = [F[3 * j : 3 * j + 3] for j in range(F.numel() // 3)]
    # Integration of q, rdot and r.
    later = ca.vertcat(
        q[:3] + dt * v[:3],
        centroidal.quaternion_step(q[centroidal.QUATERNION], v[3:6], dt),
        q[7:] + dt * v[6:],
    )
    speed_later = speed + dt * pull
    r_later = r + dt * speed_later
    # Angular momentum rate, and the integration of h.
    rate: Any = ca.SX.zeros(3)
    for j, force in enumerate(forces):
        rate = rate + ca.cross(w["place"][3 * j : 3 * j + 3] - r_later, force)
    h_later = h + dt * rate
    # Linear momentum rate, in units of acceleration; h = A(q) v; the cone.
    weight = ca.DM([0.0, 0.0, GRAVITY])
    balance = pull + weight - (sum(forces) / mass if forces else 0)
    tie = h_later - centroidal.angular_momentum(model, later, v)
    cones = [
        w["friction"] * force[2] - ca.sqrt(force[0] ** 2 + force[1] ** 2 + TIP**2)
        for force in forces
    ]
    off = later - w["q_nom"]
    cost = (
        ca.dot(w["Q_q"], off * off)
        + ca.dot(w["Q_v"], v * v)
        + ca.dot(pull, pull)
        + w["Q_h"] * ca.dot(rate, rate)
    )
    if forces:
        cost = cost + w["Q_f"] * ca.dot(F, F)
    gap = -ca.vertcat(later, r_later, speed_later, h_later)
    return dt * cost, ca.vertcat(gap, balance, tie, *cones)


def _posture(model: SymbolicModel, x: Any, w: Any) -> tuple[Any, Any]:
    """Return the rows by which centre of mass and contact points are those of the position."""
    import casadi as ca

    n = model.size + 1
    q, heading = x[:n], w["heading"]
    rows = [x[n : n + 3] - centroidal.com(model, q)]
    for j, point in enumerate(centroidal.contact_points(model, q)):
        off = point - w["place"][3 * j : 3 * j + 3]
        along = heading[0] * off[0] + heading[1] * off[1]
        across = heading[0] * off[1] - heading[1] * off[0]
        rows += [along, across, off[2]]
    return ca.SX(0), ca.vertcat(*rows)


def _attitude(q: Any, w: Any) -> tuple[Any, Any]:
    """Return half the sine of the turn that is missing."""
    import casadi as ca

    back = ca.vertcat(-w["wanted"][:3], w["wanted"][3])
    return ca.SX(0), centroidal.quaternion_product(back, q)[:3]


FORCE_SCALE, RATE_SCALE = 100.0, 1e4
"""Q_f and Q_h by the task's weight of forces: of the size of the acceleration's term."""


class PaperProblemBuilder:
    """Builds the paper's problem of a task."""

    def __init__(
        self,
        task: JumpTask,
        model: SymbolicModel,
        pieces: Mapping[str, StageFunction],
        start: Stance,
        end: Stance,
    ) -> None:
        self.task, self.model, self.pieces = task, model, pieces
        self.start, self.end = start, end
        self.up, flight_time = ballistic_flight(task, backward_steps=task.knots.flight)
        self.grid: Grid = uniform_grid(task, model.robot, flight_time)
        self.nq, self.nv = model.size + 1, model.size
        self.nx = state_size(model)
        self.forces = 3 * len(model.robot.contacts)
        self.lift_off, self.touchdown = self.grid.flight.start, self.grid.flight.stop
        self.last = len(self.grid.phases)
        self.q_start, self.q_end = pose_of(start.coordinates), pose_of(end.coordinates)

    def build(self) -> SimpleProblem:
        """Return the problem with its bounds, parameters and guess."""
        sizes = parameter_sizes(self.model)
        self.fill = BoundsBuilder(self._knots(), self.pieces, sizes)
        for k in range(self.last + 1):
            self._bound_state(k)
            for name in self.fill.assembly.knots[k].pieces:
                getattr(self, f"_fill_{'interval' if name in ('stance', 'flight') else name}")(k)
            self._guess(k)
        self._fix()
        return self.fill.done(self.task, self.model, self.grid, self.start, self.end)

    def _on_ground(self, k: int) -> tuple[int, ...]:
        """Return the contact points on the ground at a knot, those of the intervals before and after it; none at the last
        one, where that follows from rest."""
        if k in (0, self.last):
            return ()
        return tuple(sorted({*self.grid.on_ground[k - 1], *self.grid.on_ground[k]}))

    def _raised(self, k: int) -> tuple[int, ...]:
        """Return the contact points of interval k that are off the ground while others bear load."""
        loaded = self.grid.on_ground[k]
        return tuple(j for j in range(self.forces // 3) if loaded and j not in loaded)

    def _foothold_rows(self, k: int) -> list[tuple[int, bool]]:
        """Return the posture's rows of contact points at a knot, and whether each holds its point or keeps it from
        passing through the ground."""
        on_ground, feet, found = self._on_ground(k), set(), list[tuple[int, bool]]()
        for j, contact in enumerate(self.model.robot.contacts):
            if j in on_ground:
                first = 3 + 3 * j + (contact.foot in feet)
                found += [(row, True) for row in range(first, 6 + 3 * j)]
                feet.add(contact.foot)
            elif on_ground:
                found.append((5 + 3 * j, False))
        return found

    def _knots(self) -> list[Knot]:
        every = np.arange(self.nx)
        knots = []
        for k, phase in enumerate(self.grid.phases):
            name = "flight" if phase is Phase.FLIGHT else "stance"
            controls = self.nv + 3 + (0 if phase is Phase.FLIGHT else self.forces)
            knot = Knot(self.nx, controls, gap=name)
            take = np.arange(self.nx + controls)
            rows = self.pieces[name].rows
            if name == "stance":  # the cones are its last rows
                raised = [rows - self.forces // 3 + j for j in self._raised(k)]
                kept = np.setdiff1d(np.arange(self.nx, rows), np.array(raised, dtype=np.int64))
            else:
                kept = np.arange(self.nx, rows)
            knot.pieces[name] = (take, kept)
            if k > 0:
                held = [row for row, _ in self._foothold_rows(k)]
                knot.pieces["posture"] = (every, np.array([0, 1, 2, *held]))
            knot.fixed = self._raised_forces(k)
            knots.append(knot)
        knots[0].fixed = tuple(range(self.nx))
        speed = self.nq + 3
        knots[self.lift_off].fixed = (self.nq + 2, speed, speed + 1, speed + 2)
        knots[-1].fixed = tuple(range(self.nx, self.nx + self.nv))
        end = Knot(self.nx, 0, fixed=(0, 1, 2))
        end.pieces["posture"] = (every, np.arange(3))
        end.pieces["attitude"] = (np.arange(3, 7), np.arange(3))
        return [*knots, end]

    def _raised_forces(self, k: int) -> tuple[int, ...]:
        """Return the variables of knot k that are the forces of raised points. There are none at both ends, where the
        robot stands on all points."""
        first = self.nx + self.nv + 3
        return tuple(first + 3 * j + axis for j in self._raised(k) for axis in range(3))

    def _fix(self) -> None:
        """Fix Q: standing still at the start, the velocity at lift-off, at rest in place at the end."""
        flight = float(self.grid.steps[self.grid.flight].sum())
        across = [self.task.distance_x / flight, self.task.distance_y / flight]
        self.fill.fix(0, "stance", self._at_rest(self.q_start, self.start.com))
        self.fill.fix(self.lift_off, "take-off speed", [self.start.com[2], *across, self.up])
        self.fill.fix(self.last - 1, "stance", np.zeros(self.nv))
        self.fill.fix(self.last, "stance", self.q_end[:3])
        for k in range(1, self.last - 1):
            if self._raised(k):
                self.fill.fix(k, "friction", np.zeros(len(self._raised_forces(k))))

    def _at_rest(self, q: Array, com: Array) -> Array:
        return np.concatenate([q, com, np.zeros(6)])

    def _bound_state(self, k: int) -> None:
        """Bound joints by their limits, and the centre of mass: at most as high as standing in stance, and between that
        and the apex in flight.
        """
        if k in (0, self.last):
            return
        at = int(self.fill.assembly.state_start[k])
        margins = self.task.margins
        limits = self.model.robot.joint_limits
        if margins is not None:
            limits = joint_bounds(self.model.robot, margins, k >= self.touchdown)
        self._bound_lean(k, at + 3)
        self._bound_momentum(k, at + self.nq + 6)
        self.fill.lower[at + 7 : at + self.nq] = limits[:, 0]
        self.fill.upper[at + 7 : at + self.nq] = limits[:, 1]
        height = at + self.nq + 2
        nominal, landing = float(self.start.com[2]), float(self.end.com[2])
        if k < self.lift_off:
            self.fill.upper[height] = nominal
        elif self.lift_off < k < self.touchdown:
            self.fill.lower[height] = min(nominal, landing)
            self.fill.upper[height] = nominal + self.up**2 / (2.0 * GRAVITY)
        elif self.touchdown < k < self.last - 1:  # at rest it is there anyway
            self.fill.upper[height] = landing

    def _bound_lean(self, k: int, quaternion: int) -> None:
        """Bound the torso's lean: with the quaternion x, y, z, w it is at most twice the arc sine of |(x, y)|."""
        margins, largest = self.task.margins, []
        if margins is not None:
            largest.append(margins.squat_lean if k <= self.lift_off else None)
            largest.append(margins.landing_lean if k >= self.touchdown else None)
        largest.append(self.task.touchdown_lean if k == self.touchdown else None)
        leans = [each for each in largest if each is not None]
        if leans:
            self._within(quaternion, 2, float(np.sin(0.5 * min(leans))))

    def _bound_momentum(self, k: int, h: int) -> None:
        task, bounds = self.task, self.task.bounds
        largest = [
            bounds.angular_momentum if bounds is not None else None,
            task.lift_off_momentum if k == self.lift_off else None,
            task.touchdown_momentum if k == self.touchdown else None,
        ]
        found = [each for each in largest if each is not None]
        if found:
            self._within(h, 3, min(found))

    def _within(self, first: int, count: int, largest: float) -> None:
        self.fill.lower[first : first + count] = -largest
        self.fill.upper[first : first + count] = largest

    def _bound_controls(self, k: int) -> None:
        """Bound joint velocities and normal forces of knot k + 1."""
        bounds, control = self.task.bounds, int(self.fill.assembly.control_start[k])
        if bounds is not None and bounds.joint_velocity is not None:
            self._within(control + 6, self.nv - 6, bounds.joint_velocity)
        if self.grid.phases[k] is Phase.FLIGHT:
            return
        force = control + self.nv + 3
        self.fill.lower[force + 2 : force + self.forces : 3] = 0.0
        if bounds is not None and bounds.force is not None:
            self.fill.upper[force + 2 : force + self.forces : 3] = bounds.force

    def _nominal(self, k: int) -> Array:
        """Return q_nom: standing, and in flight from one stance to the other at constant rates."""
        share = min(max((k - self.lift_off) / len(self.grid.flight), 0.0), 1.0)
        return pose_of((1.0 - share) * self.start.coordinates + share * self.end.coordinates)

    def _fill_interval(self, k: int) -> None:
        weights, joints = self.task.weights, self.nv - 6
        name = "flight" if self.grid.phases[k] is Phase.FLIGHT else "stance"
        common = {
            "step": self.grid.steps[k],
            "q_nom": self._nominal(k + 1),
            "Q_q": [0.0] * 3 + [4.0 * weights.orientation] * 4 + [weights.posture] * joints,
            "Q_v": [0.0] * 3 + [weights.joint_velocity] * (3 + joints),
            "Q_h": RATE_SCALE * weights.force,
        }
        rates = [("dynamics", 3, 0.0, 0.0), ("momentum", 3, 0.0, 0.0)]
        if name == "stance":
            common |= {"Q_f": FORCE_SCALE * weights.force, "friction": self.task.friction,
                       "place": self._stance_at(k + 1).points.ravel()}  # fmt: skip
            rates.append(("friction", self.forces // 3 - len(self._raised(k)), 0.0, np.inf))
        self._bound_controls(k)
        self.fill.set(name, k, **common)
        self.fill.rows(name, k, rates)

    def _stance_at(self, k: int) -> Stance:
        return self.start if k <= self.lift_off else self.end

    def _fill_posture(self, k: int) -> None:
        stance = self._stance_at(k)
        heading = [np.cos(stance.heading), np.sin(stance.heading)]
        self.fill.set("posture", k, place=stance.points.ravel(), heading=heading)
        families = [("centre of mass", 3, 0.0, 0.0)]
        for _, holds in self._foothold_rows(k):
            families.append(
                ("footholds", 1, 0.0, 0.0) if holds else ("ground clearance", 1, 0.0, np.inf)
            )
        self.fill.rows("posture", k, families)

    def _fill_attitude(self, k: int) -> None:
        self.fill.set("attitude", k, wanted=self.q_end[3:7])
        self.fill.rows("attitude", k, [("stance", 3, 0.0, 0.0)])

    def _guess(self, k: int) -> None:
        """Return the guess: standing, a ballistic flight, standing; the weight shared by all contact points."""
        first, last = self.start, self.end
        flight = float(self.grid.steps[self.grid.flight].sum())
        q, com, speed = self._nominal(k), first.com.copy(), np.zeros(3)
        if k > self.touchdown:
            com = last.com.copy()
        elif k >= self.lift_off:
            time = float(self.grid.times[k] - self.grid.times[self.lift_off])
            speed = (last.com - first.com) / flight
            com = first.com + time * speed
            com[2] = first.com[2] + self.up * time - 0.5 * GRAVITY * time * time
            speed[2] = self.up - GRAVITY * time
            q = q.copy()
            q[:3] += com - first.com - (time / flight) * (last.com - first.com)
        at = int(self.fill.assembly.state_start[k])
        self.fill.guess[at : at + self.nx] = np.concatenate([q, com, speed, np.zeros(3)])
        if k == self.last:
            return
        control = int(self.fill.assembly.control_start[k])
        if self.grid.phases[k] is Phase.FLIGHT:
            turn = (last.coordinates - first.coordinates) / flight
            self.fill.guess[control : control + 3] = speed
            self.fill.guess[control + 3 : control + 6] = turn[[4, 3, 5]]
            self.fill.guess[control + self.nv + 2] = -GRAVITY
            return
        loaded, begin = self.grid.on_ground[k], control + self.nv + 3
        for j in loaded:
            self.fill.guess[begin + 3 * j + 2] = self.model.robot.weight / len(loaded)
