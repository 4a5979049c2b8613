"""The pieces a jump's optimisation problem is made of, as CasADi functions of one knot.

Every piece has variables ``z``, parameters ``w`` and gives a cost and constraint rows; its Jacobian
and the Hessian of its Lagrangian come with it. With n coordinates ``q`` and m joints, all in the
reduced coordinates of ``Coordinates``:

``stance``  z = q, v, a, F.     Interval on the ground. Rows: gap (2n), base dynamics, motor torque,
            torque-speed line and motor speed (m each), torques of held joints, friction pyramid
            (4 a contact point, or 2).
``free_stance`` z = q, v, h, a, F. The same, ``share`` h seconds long. Rows: gap (2n + 1), then alike.
``impact``  z = q, v, dv, L.    Touchdown: velocities change by dv under impulses L, M dv = J' L, with
            none from the motors. Rows: gap (2n), impulse balance (n), motor speed (m), friction.
``flight``  z = q, v, h, a, r.  Interval of ``share`` h seconds in the air. Rows: gap (2n + 1), momentum at
            its end and in its middle, motor torque, torque-speed line at begin
            and end, motor speed, torques of held joints.
``contact`` z = q, v.           Rows: velocity + 10/s x place error of every contact point along its
            foot, across it and upwards (2 in the sagittal plane), then the place errors;
            ``ContactRows`` says which of them are independent.
``take_off`` z = q, v.          Rows: apex height, vertical speed, angular momentum (3).
``air``     z = q.              Rows: height of the points of feet and calves, how far ahead they
            are, and how far on their own leg's side of the torso's middle plane, each point's
            height and side less its radius; then the gaps along the torso of ``fore_and_hind``.
``obstacle`` z = q.             Rows: how high the points of ``obstacle_points`` are above ground
            with a step, rounded, less their radii.

On ground that leans the same pieces, ``sloped_stance`` and so on, have its axes or its plane among their
parameters. Forces and impulses are then along these axes, the last one normal to the ground, and so are
place errors; heights are above the planes.

Over an interval of h seconds accelerations are constant: v+ = v + h a, q+ = q + h v + h^2 a / 2, and
on the ground the dynamics hold in its middle (second order). Gap rows hold minus the next state. ``w`` is named
by ``Parameters``. Not modelled: friction in the joints and the rotors' gyroscopic moment.

Derivatives go by way of a few intermediate quantities, which makes them three times as small. The equations of motion are written in the position and velocity in an interval's middle or at its
end. These are simple expressions of the variables, but of nearly all of them, so that derivatives by
the variables repeat the equations of motion for every one of them. Here the derivatives are by the
intermediate quantities, and the chain rule does the rest.

An interval in the air is exact but for how the attitude is integrated, which is of fourth order. The joints' accelerations are constant over an interval, so their motion is known. What the base
does then follows from momentum alone: the centre of mass falls, and the angular momentum about it
stays. Written for the interval's ends this has no error, however long the interval is:

    centre(q+)     = centre(q) + h c + h^2 g / 2,      c the centre's velocity,
    momentum(q+, v+) = momentum(q, v) + h m g,
    k(q+, v+)      = k(q, v),                          k the angular momentum.

The attitude is integrated by Simpson's rule, whose middle rates ``r`` are variables that have the
same angular momentum at the angles of the cubic through both ends (Lobatto's method of order four):

    angles+ = angles + h (rates + 4 r + rates+) / 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...mathematics.constants import GRAVITY
from ..models.coordinates import (
    Coordinates,
    full_coordinates,
    mirrored_coordinates,
    sagittal_coordinates,
)
from ..models.symbolic_model import Expression, SymbolicModel, centroidal_momentum
from .leg_rows import air_rows
from .obstacles import heights_above_step, touching_sphere


class IntermediateExpressions:
    """Expressions that were replaced by symbols, and derivatives that know of them.

    What is lifted is an expression of the variables alone, not of other lifted symbols.
    """

    def __init__(self) -> None:
        self.symbols: list[Any] = []
        self.expressions: list[Any] = []

    def __call__(self, expression: Any) -> Any:
        """Return a symbol that stands for the expression from here on."""
        import casadi as ca

        dense = ca.densify(expression)
        symbol = ca.SX.sym(f"lifted_{len(self.symbols)}", dense.numel())
        self.symbols.append(symbol)
        self.expressions.append(dense)
        return symbol

    def put_back(self, expressions: list[Any]) -> list[Any]:
        """Return the expressions without the symbols."""
        import casadi as ca

        if not self.symbols:
            return expressions
        return list(ca.substitute(expressions, [self._symbol], [self._expression]))

    def jacobian(self, rows: Any, variables: Any) -> Any:
        """Return the whole derivative of rows by the variables."""
        import casadi as ca

        direct = ca.jacobian(rows, variables)
        if not self.symbols:
            return direct
        through = ca.mtimes(ca.jacobian(rows, self._symbol), self._slope(variables))
        return self.put_back([direct + through])[0]

    def hessian(self, value: Any, variables: Any) -> tuple[Any, Any]:
        """Return the whole second derivative of a value by the variables, and the first."""
        import casadi as ca

        if not self.symbols:
            found, slope = ca.hessian(value, variables)
            return found, slope
        count = variables.numel()
        inner, first = ca.hessian(value, ca.vertcat(variables, self._symbol))
        by_symbols = first[count:]
        slope = self._slope(variables)
        # How the lifted expressions bend, weighted by what the value takes from each.
        weights = ca.SX.sym("weights", by_symbols.numel())
        bend, _ = ca.hessian(ca.dot(weights, self._expression), variables)
        bend = ca.substitute(bend, weights, by_symbols)
        cross = ca.mtimes(inner[:count, count:], slope)
        through = ca.mtimes(slope.T, ca.mtimes(inner[count:, count:], slope))
        whole = inner[:count, :count] + cross + cross.T + through + bend
        whole = ca.triu2symm(ca.triu(whole))
        return tuple(self.put_back([whole, first[:count] + ca.mtimes(slope.T, by_symbols)]))

    @property
    def _symbol(self) -> Any:
        import casadi as ca

        return ca.vertcat(*self.symbols)

    @property
    def _expression(self) -> Any:
        import casadi as ca

        return ca.vertcat(*self.expressions)

    def _slope(self, variables: Any) -> Any:
        import casadi as ca

        return ca.jacobian(self._expression, variables)


class FlightInterval(NamedTuple):
    """The state at an interval's end, ``rows`` that are zero where momentum is conserved (those of
    a base wrench, then the middle's angular momentum), and position and velocity in its middle."""

    end: Expression
    end_velocity: Expression
    rows: list[Expression]
    middle: Expression
    middle_velocity: Expression


def flight_interval(
    model: SymbolicModel, coordinates: Coordinates,
    q: Expression, v: Expression, h: Expression, a: Expression, r: Expression, lift: IntermediateExpressions,
) -> FlightInterval:  # fmt: skip
    """Return the interval of ``h`` seconds that begins with the reduced state ``q``, ``v``; ``a`` are the mean
    accelerations, of the joints the constant ones, and ``r`` the angles' rates in the middle. Positions and velocities
    at its end and in its middle are lifted.
    """
    import casadi as ca

    turning = list(coordinates.turning)
    falling = [i for i, axis in enumerate(coordinates.free_base) if axis < 3]
    end_velocity: Any = v + h * a
    end, middle = _copied(q + h * v + 0.5 * h * h * a), _copied(q + 0.5 * h * v + 0.125 * h * h * a)
    rate: Any
    middle_velocity = _copied(v + 0.5 * h * a)
    for i, rate in zip(turning, ca.vertsplit(r), strict=True):
        both: Any = v[i] + end_velocity[i]
        change: Any = v[i] - end_velocity[i]
        end[i] = q[i] + h / 6.0 * (both + 4.0 * rate)
        middle[i] = 0.5 * (q[i] + end[i]) + 0.125 * h * change
        middle_velocity[i] = rate
    end, end_velocity, middle, middle_velocity = map(
        lift, (end, end_velocity, middle, middle_velocity)
    )

    def momentum(place: Expression, speed: Expression) -> Any:
        return centroidal_momentum(
            model, coordinates.expand(place), coordinates.expand(speed),
            coordinates.limbs, coordinates.share,
        )  # fmt: skip

    mass = model.robot.total_mass
    start = momentum(q, v)
    pull = ca.vertcat(0.0, 0.0, -GRAVITY)
    # The base's own place does not matter for where the centre is in the body.
    stop = momentum(end, end_velocity)
    fallen = start.com + h / mass * start.linear + 0.5 * h * h * pull
    missed = fallen - stop.com
    end = _copied(end)
    for i in falling:
        end[i] = end[i] + missed[coordinates.free_base[i]]
    forces = (stop.linear - start.linear) / h - mass * pull
    moments = (stop.angular - start.angular) / h
    half = momentum(middle, middle_velocity).angular - start.angular
    wrench = ca.vertcat(forces, moments)
    rows = [
        wrench[list(coordinates.rows)],
        half[[row - 3 for row in coordinates.rows if row >= 3]],
    ]
    return FlightInterval(end, end_velocity, rows, middle, middle_velocity)


def _copied(expression: Expression) -> Expression:
    """Return an expression whose elements may be replaced."""
    import casadi as ca

    return ca.vertcat(*ca.vertsplit(ca.densify(expression)))


DRIFT_RATE = 10.0
"""1/s, how fast the place error of a foot on the ground dies out."""

PIECES = ("stance", "free_stance", "flight", "impact", "contact", "take_off", "air", "obstacle")
SLOPED = "sloped_"
"""Prefix of these pieces' names where the ground leans."""
SLOPED_PIECES = ("stance", "free_stance", "impact", "contact", "air", "obstacle")


@dataclass(frozen=True)
class StageFunction:
    """The functions of one piece: ``value(z, w) -> f, g``; ``gradient(z, w) -> grad f``;
    ``jacobian(z, w) -> g, jac g``; ``hessian(z, w, lam_f, lam_g) -> gradient and Hessian of the Lagrangian``."""

    value: Any
    gradient: Any
    jacobian: Any
    hessian: Any

    @property
    def rows(self) -> int:
        """The number of constraint rows."""
        return int(self.value.size1_out(1))


def parameter_sizes(coordinates: Coordinates, sloped: bool = False) -> dict[str, dict[str, int]]:
    """Return the parameters ``w`` of every piece, or of those for ``sloped`` ground: name -> size, in order.

    ``axes`` are columns of the ground's axes, of the ``contact`` piece along and across the feet.
    Planes are c0, c1, c2 of heights c0 + c1 x + c2 y.
    """
    n, joints = coordinates.size, len(coordinates.joints)
    contacts = len(coordinates.contacts)
    interval = {
        "nominal": n, "posture": n, "velocity": n, "acceleration": n, "slope": joints,
    }  # fmt: skip
    level = {
        "stance": {"step": 1, "friction": 1, "force": 1, "pressure": 1, **interval},
        "free_stance": {"share": 1, "friction": 1, "force": 1, "pressure": 1, **interval},
        "flight": {"share": 1, **interval},
        "impact": {"friction": 1, "impulse": 1},
        "contact": {"place": 3 * contacts, "heading": 2},
        "take_off": {},
        "air": {},
        "obstacle": {"ground": 1, "step": 1, "edge": 1, "onwards": 1, "early": 1},
    }
    if not sloped:
        return level
    more = {name: {"axes": 9} for name in ("stance", "free_stance", "impact")}
    return {name: sizes | more.get(name, {}) for name, sizes in level.items()} | {
        "contact": {"place": 3 * contacts, "heading": 2, "axes": 9},
        "air": {"ground": 3},
        "obstacle": {"ground": 3, "step": 3, "edge": 1, "onwards": 1, "early": 1, "higher": 1},
    }


COORDINATES: Mapping[str, Callable[[SymbolicModel], Coordinates | None]] = {
    "full": full_coordinates,
    "sagittal": sagittal_coordinates,
    "mirrored": mirrored_coordinates,
}
"""Makers of coordinates, by their name."""


def make_coordinates(model: SymbolicModel, name: str) -> Coordinates:
    """Return the coordinates of that name. Raises ``ValueError`` where the robot has none."""
    chosen = COORDINATES[name](model)
    if chosen is None:
        raise ValueError(f"{model.robot.name} is not the same left and right")
    return chosen


def piece_expressions(
    model: SymbolicModel,
    coordinates: Coordinates,
    name: str,
    lifted: IntermediateExpressions | None = None,
) -> tuple[Any, Any, Any, Any]:
    """Return the symbols ``z`` and ``w`` of a piece, its cost and its rows; with ``lifted`` in terms of what is lifted
    there, too.
    """
    import casadi as ca

    lift = IntermediateExpressions() if lifted is None else lifted
    sloped, name = name.startswith(SLOPED), name.removeprefix(SLOPED)
    sizes = parameter_sizes(coordinates, sloped)[name]
    w = {key: ca.SX.sym(key, size) for key, size in sizes.items()}
    q, v = ca.SX.sym("q", coordinates.size), ca.SX.sym("v", coordinates.size)
    cost: Any = ca.SX(0)
    z: list[Any] = [q, v]
    rows: list[Any]
    if name in ("stance", "free_stance", "flight"):
        z, cost, rows = _interval(model, coordinates, name, q, v, w, lift)
    elif name == "impact":
        z, cost, rows = _impact(model, coordinates, q, v, w)
    elif name == "contact":
        errors = _place_errors(model, coordinates, q, w)
        rows = [_contact_velocities(model, coordinates, q, v, w, errors), errors]
    elif name == "take_off":
        whole = centroidal_momentum(model, coordinates.expand(q), coordinates.expand(v))
        rise = whole.linear[2] / model.robot.total_mass
        rows = [whole.com[2] + rise * rise / (2.0 * GRAVITY), rise, whole.angular]
    elif name == "air":
        z, rows = [q], air_rows(model, coordinates, q, w)
    else:
        z, rows = [q], heights_above_step(model, coordinates, q, w)
    rows_of_all = ca.vertcat(*rows)
    if lifted is None and lift.symbols:
        cost, rows_of_all = lift.put_back([cost, rows_of_all])
    return ca.vertcat(*z), ca.vertcat(*w.values()), cost, rows_of_all


def _interval(
    model: SymbolicModel, coordinates: Coordinates, name: str, q: Any, v: Any,
    w: Mapping[str, Any], lift: IntermediateExpressions,
) -> tuple[list[Any], Any, list[Any]]:  # fmt: skip
    """Return the symbols, the cost and the rows of an interval on the ground or in the air."""
    import casadi as ca

    a, state = ca.SX.sym("a", coordinates.size), ca.SX.sym("h")
    h = w["step"] if name == "stance" else w["share"] * state
    forces = 0 if name == "flight" else coordinates.forces
    F = ca.SX.sym("F", forces)
    z = [q, v, a, F] if name == "stance" else [q, v, state, a, F]
    half_v = v + 0.5 * h * a
    half_q = q + 0.5 * h * v + 0.125 * h * h * a
    end_q, end_v = q + h * v + 0.5 * h * h * a, v + h * a
    balance: list[Any] = []
    if name == "flight":
        z[-1] = ca.SX.sym("r", len(coordinates.turning))
        end_q, end_v, balance, half_q, half_v = flight_interval(
            model, coordinates, q, v, h, a, z[-1], lift
        )
    else:
        half_q, half_v = lift(half_q), lift(half_v)
    all_forces: Any = ca.mtimes(ca.DM(coordinates.force_matrix), F) if forces else None
    named = {
        model.robot.contacts[c].name: _in_world(all_forces[3 * c : 3 * c + 3], w)
        for c in coordinates.contacts
        if forces
    }
    middle = coordinates.expand(half_q), coordinates.expand(half_v), coordinates.expand(a)
    base, passed, torque = model.inverse_dynamics(*middle, named, coordinates.limbs)
    held = model.held_torques(*middle, passed, coordinates.limbs, coordinates.twins)
    if name != "flight":
        wrench = model.base_wrench(base, passed, coordinates.share)
        balance = [wrench[list(coordinates.rows)]]
    start = [] if name == "stance" else [-state]
    motors = _motor_rows(model, coordinates, torque, v, v + h * a, w["slope"])
    rows = [-end_q, -end_v, *start, *balance, *motors, *held]
    off = q - w["nominal"]
    cost = (
        ca.dot(w["posture"], off * off)
        + ca.dot(w["velocity"], v * v)
        + ca.dot(w["acceleration"], a * a)
    )
    if forces:
        cost = cost + w["force"] * ca.dot(F, F)
        rows += _cones(coordinates, all_forces, w["friction"])
        rows += _pressures(model, coordinates, all_forces, w["pressure"])
    return z, h * cost, rows


def _motor_rows(
    model: SymbolicModel, coordinates: Coordinates, torque: Any, begin: Any, end: Any, slope: Any
) -> list[Any]:
    """Return the rows of motor torque, the torque-speed line at begin and end, and motor speed."""
    import casadi as ca

    to_motor = model.robot.torque_to_motor[np.ix_(coordinates.joints, coordinates.joints)]
    motor = ca.mtimes(ca.DM(to_motor), torque[list(coordinates.joints)])
    speed, end_speed = (_motor_speeds(model, coordinates, v) for v in (begin, end))
    return [motor, motor + slope * speed, motor + slope * end_speed, speed]


def _impact(
    model: SymbolicModel, coordinates: Coordinates, q: Any, v: Any, w: Mapping[str, Any]
) -> tuple[list[Any], Any, list[Any]]:
    """Return the symbols, the cost and the rows of touchdown."""
    import casadi as ca

    change, F = ca.SX.sym("dv", coordinates.size), ca.SX.sym("F", coordinates.forces)
    pushes = ca.mtimes(ca.DM(coordinates.force_matrix), F)
    rows = [
        -q, -(v + change),
        _impulse_balance(model, coordinates, q, change, pushes, w),
        _motor_speeds(model, coordinates, v),
        *_cones(coordinates, pushes, w["friction"]),
    ]  # fmt: skip
    return [q, v, change, F], w["impulse"] * ca.dot(F, F), rows


def _in_world(force: Any, w: Mapping[str, Any]) -> Any:
    """Return a force along the ground's axes in the world."""
    import casadi as ca

    return ca.mtimes(ca.reshape(w["axes"], 3, 3), force) if "axes" in w else force


def _motor_speeds(model: SymbolicModel, coordinates: Coordinates, velocity: Any) -> Any:
    """Return the speeds of the motors of those joints that are computed."""
    import casadi as ca

    geared = model.robot.joint_to_motor[np.ix_(coordinates.joints, coordinates.joints)]
    own = [6 + joint for joint in coordinates.joints]
    return ca.mtimes(ca.DM(geared), coordinates.expand(velocity)[own])


def _cones(coordinates: Coordinates, forces: Any, friction: Any) -> list[Any]:
    """Return the friction pyramid's rows of every contact point."""
    rows = []
    for c in coordinates.contacts:
        reach = friction * forces[3 * c + 2]
        for axis in coordinates.axes[:-1]:
            pull = forces[3 * c + axis]
            rows += [reach - pull, reach + pull]
    return rows


def _pressures(
    model: SymbolicModel, coordinates: Coordinates, forces: Any, share: Any
) -> list[Any]:
    """Return the load of every point beyond that share of its foot's load."""
    contacts = model.robot.contacts
    rows = []
    for c in coordinates.contacts:
        same = [i for i in coordinates.contacts if contacts[i].foot == contacts[c].foot]
        rows.append(forces[3 * c + 2] - share * sum(forces[3 * i + 2] for i in same))
    return rows


def _impulse_balance(model: SymbolicModel, coordinates: Coordinates, q: Any, change: Any,
                     impulses: Any, w: Mapping[str, Any]) -> Any:  # fmt: skip
    """Return M dv - J' L of the base (body frame) and of the joints that are coordinates: the others of a mirrored
    motion are held.
    """
    import casadi as ca

    still = ca.SX.zeros(model.size)
    named = {
        model.robot.contacts[c].name: _in_world(impulses[3 * c : 3 * c + 3], w)
        for c in coordinates.contacts
    }
    sums = []
    # Gravity has no impulse: what holds the robot at rest is taken off again.
    for bend, forces in ((coordinates.expand(change), named), (still, {})):
        base, passed, torque = model.inverse_dynamics(
            coordinates.expand(q), still, bend, forces, coordinates.limbs
        )
        wrench = model.base_wrench(base, passed, coordinates.share)
        sums.append(ca.vertcat(wrench[list(coordinates.rows)], torque[list(coordinates.moving)]))
    return sums[0] - sums[1]


def make_piece(model: SymbolicModel, coordinates: Coordinates, name: str) -> StageFunction:
    """Return the functions of a piece with exact derivatives."""
    lifted = IntermediateExpressions()
    return derived(
        f"{coordinates.name}_{name}", *piece_expressions(model, coordinates, name, lifted), lifted
    )


def derived(
    prefix: str, z: Any, w: Any, cost: Any, rows: Any, lifted: IntermediateExpressions | None = None
) -> StageFunction:
    """Return a piece from its symbols ``z`` and ``w``, its cost and its rows, which may be written in terms of what is
    ``lifted``.
    """
    import casadi as ca

    lift = IntermediateExpressions() if lifted is None else lifted
    lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", rows.numel())
    hessian, slope = lift.hessian(lam_f * cost + ca.dot(lam_g, rows), z)
    jacobian, gradient = lift.jacobian(rows, z), ca.densify(lift.jacobian(cost, z).T)
    cost, rows = lift.put_back([cost, ca.densify(rows)])
    return StageFunction(
        ca.Function(f"{prefix}_value", [z, w], [cost, rows]),
        ca.Function(f"{prefix}_gradient", [z, w], [gradient]),
        ca.Function(f"{prefix}_jacobian", [z, w], [rows, jacobian]),
        ca.Function(f"{prefix}_hessian", [z, w, lam_f, lam_g], [ca.densify(slope), hessian]),
    )


def _place_errors(model: SymbolicModel, coordinates: Coordinates, q: Any, w: Mapping[str, Any]
                  ) -> Any:  # fmt: skip
    """Return every contact point's error along and across the foot and upwards, or normal to the ground, in the heading
    that the foot stands with.
    """
    import casadi as ca

    place, heading = w["place"], w["heading"]
    axes = ca.vertsplit(ca.reshape(w["axes"], 3, 3).T) if "axes" in w else None
    points = model.footholds(coordinates.expand(q), coordinates.limbs, heading)
    errors = []
    for i in range(len(coordinates.contacts)):
        off = points[i] - place[3 * i : 3 * i + 3]
        if axes is not None:
            errors += [ca.mtimes(axes[axis], off) for axis in coordinates.axes]
            continue
        along = heading[0] * off[0] + heading[1] * off[1]
        across = heading[0] * off[1] - heading[1] * off[0]
        sideways = [across] if 1 in coordinates.axes else []
        errors += [along, *sideways, off[2]]
    return ca.vertcat(*errors)


def _contact_velocities(
    model: SymbolicModel, coordinates: Coordinates, q: Any, v: Any, w: Mapping[str, Any],
    errors: Any,
) -> Any:  # fmt: skip
    """Return the velocities of the place errors, which die out at ``DRIFT_RATE``. Out of the sagittal plane those of a
    ball along the ground are the velocities of its material where it touches: how far it has rolled follows from no
    attitude then, and a leg that yaws while its knee stretches would slip by the difference.
    """
    import casadi as ca

    rates = ca.jtimes(errors, q, v)
    if 1 not in coordinates.axes:
        return rates + DRIFT_RATE * errors
    robot, rows = model.robot, ca.vertsplit(rates + DRIFT_RATE * errors)
    frames = model.frames(coordinates.expand(q), coordinates.limbs)
    link_of = {foot.name: foot.link for foot in robot.feet}
    axes = ca.reshape(w["axes"], 3, 3).T if "axes" in w else None
    heading = w["heading"]
    for i, c in enumerate(coordinates.contacts):
        place, radius = touching_sphere(robot, c)
        if not radius:
            continue
        link = link_of[robot.contacts[c].foot]
        rotation = frames[link][0]
        turning = ca.mtimes(ca.reshape(ca.jtimes(ca.vec(rotation), q, v), 3, 3), rotation.T)
        centre = ca.jtimes(model.point(frames, link, place), q, v)
        slip = centre - radius * ca.vertcat(turning[0, 2], turning[1, 2], 0.0)
        if axes is None:
            along = heading[0] * slip[0] + heading[1] * slip[1]
            rows[3 * i], rows[3 * i + 1] = along, heading[0] * slip[1] - heading[1] * slip[0]
        else:
            rows[3 * i], rows[3 * i + 1] = ca.vertsplit(ca.mtimes(axes[:2, :], slip))
    return ca.vertcat(*rows)
