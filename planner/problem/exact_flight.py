"""An interval in the air, exact but for how the attitude is integrated, which is of fourth order.

The joints' accelerations are constant over an interval, so their motion is known. What the base
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

from typing import Any, NamedTuple

from ...mathematics.constants import GRAVITY
from ..models.coordinates import Coordinates
from ..models.symbolic_frames import Expression
from ..models.symbolic_model import SymbolicModel
from ..models.symbolic_momentum import centroidal_momentum
from .lifted import Lifted


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
    q: Expression, v: Expression, h: Expression, a: Expression, r: Expression, lift: Lifted,
) -> FlightInterval:  # fmt: skip
    """The interval of ``h`` seconds that begins with the reduced state ``q``, ``v``; ``a`` are the
    mean accelerations, of the joints the constant ones, and ``r`` the angles' rates in the middle.
    Positions and velocities at its end and in its middle are lifted."""
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
    """An expression whose elements may be replaced."""
    import casadi as ca

    return ca.vertcat(*ca.vertsplit(ca.densify(expression)))
