"""Replays a plan with exact dynamics, at its knots and between them.

Every interval is integrated by itself from the plan's state at its beginning. In stance the open loop is
unstable, so an error that has grown over many intervals would say nothing about the plan. Every flight is
also integrated as a whole, from lift-off to touchdown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ..models.euler_angles import coordinates_of, pose_of, twist_of
from ..models.exact_dynamics import ExactDynamics, joint_motion, rotation_between
from ..task.plan import PlannedJump

Row = tuple[float, int, Array, Array]
"""A time [s], its interval, and the state."""
FLIGHT_STEP = 0.002
"""Longest step of the flight's integration [s]; halving it changes a landing by less than 1 um."""


@dataclass(frozen=True)
class ReplaySamples:
    """The motion at many instants: knots and what lies between them, ``n`` in all.

    ``knot`` is the interval that an instant belongs to. ``force`` (n, n_contacts, 3) is that of
    the interval, ``torque`` what exact dynamics needs for the planned joint motion under it, both
    zero at impacts.
    """

    time: Array
    knot: NDArray[np.int64]
    position: Array
    velocity: Array
    torque: Array
    points: Array
    point_velocity: Array


@dataclass(frozen=True)
class Replay:
    """The motion that follows from a plan by exact dynamics.

    Attributes:
        samples: knots, middles of stance intervals and every step of the flight.
        defect: per interval how far exact dynamics from one knot misses the next: base position
            [m], rotation [rad], linear [m/s] and angular velocity [rad/s] of the base, (N-1, 4).
        gap, wrench: what is left over of the planner's own equations, see ``midpoint_residuals``, (N-1,).
        flight_errors: base position [m] and rotation [rad] missed at every touchdown.
        com, com_velocity, angular_momentum: at the knots, by Pinocchio.
        soles, heading: sole centres [m] (N, n_feet, 3) and unwrapped headings [rad] (N, n_feet).
        flights: the knots where every flight begins and ends, before any impact.
    """

    samples: ReplaySamples
    defect: Array
    gap: Array
    wrench: Array
    flight_errors: tuple[tuple[float, float], ...]
    com: Array
    com_velocity: Array
    angular_momentum: Array
    soles: Array
    heading: Array
    flights: tuple[tuple[int, int], ...]


def replay(plan: PlannedJump, robot: RobotDescription) -> Replay:
    """Replay a plan on the robot with the actuator profile that the plan is for.

    Raises:
        ValueError: it has not one flight for every jump of its task.
    """
    dynamics = ExactDynamics(robot)
    flights = flight_knots(plan)
    flown = [_fly(plan, dynamics, lift_off, touchdown) for lift_off, touchdown in flights]
    flying = {k for first, end in flights for k in range(first, end)}
    followed = [_follow_interval(plan, dynamics, k) for k in range(len(plan.time) - 1)]
    defect = np.array([missed for missed, _ in followed])
    gap, wrench = midpoint_residuals(plan, dynamics)
    between = [row for rows, _ in flown for row in rows]
    between += [row for k, (_, row) in enumerate(followed) if row is not None and k not in flying]
    samples = _sample(plan, dynamics, between)
    states = [dynamics.centroidal(q, v) for q, v in zip(plan.position, plan.velocity, strict=True)]
    placed = [dynamics.soles(q) for q in plan.position]
    return Replay(
        samples, defect, gap, wrench, tuple(error for _, error in flown),
        np.array([s[0] for s in states]),
        np.array([s[1] for s in states]),
        np.array([s[2] for s in states]),
        np.array([soles for soles, _ in placed]),
        np.unwrap(np.array([heading for _, heading in placed]), axis=0),
        flights,
    )  # fmt: skip


def flight_knots(plan: PlannedJump) -> tuple[tuple[int, int], ...]:
    """The knots at lift-off and at touchdown of every flight, the latter before any impact.

    Raises:
        ValueError: there are more or fewer flights than jumps.
    """
    lasting = np.diff(plan.time, append=plan.time[-1]) > 0.0
    flying = np.flatnonzero((plan.phase == Phase.FLIGHT) & lasting)
    found = [
        (int(run[0]), int(run[-1]) + 1)
        for run in np.split(flying, np.flatnonzero(np.diff(flying) > 1) + 1)
        if len(run)
    ]
    jumps = len(plan.task.hops())
    if len(found) != jumps:
        raise ValueError(
            f"a plan has a flight, of intervals one after the other, for every jump; found "
            f"{len(found)} for {jumps}"
        )
    return tuple(found)


def _fly(
    plan: PlannedJump, dynamics: ExactDynamics, lift_off: int, touchdown: int
) -> tuple[list[Row], tuple[float, float]]:
    """Integrate the flight from the plan's state at lift-off, and compare its end with the planned touchdown."""
    q, v = plan.position[lift_off], plan.velocity[lift_off]
    nothing = np.zeros(plan.contact_force.shape[1:])
    out = []
    for k in range(lift_off, touchdown):
        joints = joint_motion(plan.position, plan.velocity, plan.time, k)
        q = np.concatenate([q[:7], plan.position[k, 7:]])
        v = np.concatenate([v[:6], plan.velocity[k, 6:]])
        # An even number of steps, so that the interval's middle is among them.
        step = 0.5 * joints.duration / math.ceil(0.5 * joints.duration / FLIGHT_STEP)
        steps = dynamics.integrate(q, v, joints, nothing, step)
        out += [(float(plan.time[k]) + t, k, there, moving) for t, there, moving in steps]
        _, q, v = steps[-1]
    planned = plan.position[touchdown]
    missed = float(np.linalg.norm(q[:3] - planned[:3])), rotation_between(q[3:7], planned[3:7])
    return out, missed


def held_joints(plan: PlannedJump, k: int) -> NDArray[np.bool_]:
    """The joints (n_joints) that stand still before and behind the impact at a knot: roll and yaw
    of a mirrored jump, which their motors keep."""
    still = (plan.velocity[k : k + 2, 6:] == 0.0).all(axis=0)
    return np.asarray(still)


def _follow_interval(
    plan: PlannedJump, dynamics: ExactDynamics, k: int
) -> tuple[Array, Row | None]:
    """How far exact dynamics from knot ``k`` misses the next knot, see ``Replay``, and the middle of
    the interval where it lasts."""
    q, v, planned_q, planned_v = (
        plan.position[k], plan.velocity[k], plan.position[k + 1], plan.velocity[k + 1],
    )  # fmt: skip
    force, middle = plan.contact_force[k], None
    if plan.time[k + 1] > plan.time[k]:
        joints = joint_motion(plan.position, plan.velocity, plan.time, k)
        steps = dynamics.integrate(q, v, joints, force, 0.5 * joints.duration)
        t, there, moving = steps[0]
        middle = (float(plan.time[k]) + t, k, there, moving)
        _, q, v = steps[-1]
    else:
        v, _ = dynamics.velocity_after_impact(q, v, force, held_joints(plan, k))
    missed = np.array(
        [
            np.linalg.norm(q[:3] - planned_q[:3]),
            rotation_between(q[3:7], planned_q[3:7]),
            np.linalg.norm(v[:3] - planned_v[:3]),
            np.linalg.norm(v[3:6] - planned_v[3:6]),
        ]
    )
    return missed, middle


def _sample(plan: PlannedJump, dynamics: ExactDynamics, between: list[Row]) -> ReplaySamples:
    """All knots, the middles of stance intervals and the steps of the flights, in time's order."""
    inside: dict[int, list[Row]] = {}
    for row in between:
        inside.setdefault(row[1], []).append(row)
    rows = list[Row]()
    for k in range(len(plan.time)):
        interval = min(k, len(plan.time) - 2)
        rows.append((float(plan.time[k]), interval, plan.position[k], plan.velocity[k]))
        rows += inside.get(k, [])
    torque, points, velocities = [], [], []
    for time, k, q, v in rows:
        places, jacobian = dynamics.contact_jacobians(q)
        points.append(places)
        velocities.append((jacobian @ v).reshape(-1, 3))
        if plan.time[k + 1] > plan.time[k]:
            joints = joint_motion(plan.position, plan.velocity, plan.time, k)
            acceleration = joints.at(time - float(plan.time[k]))[2]
            force = plan.contact_force[k]
            torque.append(dynamics.joint_torque(q, v, acceleration, force, jacobian))
        else:
            torque.append(np.zeros(plan.joint_torque.shape[1]))
    return ReplaySamples(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
        np.array(torque),
        np.array(points),
        np.array(velocities),
    )


def midpoint_residuals(plan: PlannedJump, dynamics: ExactDynamics) -> tuple[Array, Array]:
    """What is left over of the planner's own equations in every interval, zero at impacts.

    The ``full`` formulation holds accelerations of its coordinates constant over an interval and
    fulfils the equations of motion in its middle. Pinocchio evaluates these anew.

    Returns the gap, how far the coordinates miss those of a constant acceleration [m or rad],
    (N-1,), and the base's six equations of motion in the middle [N or N m], (N-1,).
    """
    places, rates = coordinates_of(plan.position, plan.velocity)
    count = len(plan.time) - 1
    gap, wrench = np.zeros(count), np.zeros(count)
    for k in range(count):
        h = float(plan.time[k + 1] - plan.time[k])
        if h <= 0.0:
            continue
        bend = (rates[k + 1] - rates[k]) / h
        gap[k] = np.abs(places[k + 1] - places[k] - 0.5 * h * (rates[k] + rates[k + 1])).max()
        middle = places[k] + 0.5 * h * rates[k] + 0.125 * h * h * bend
        velocity, acceleration = twist_of(middle, rates[k] + 0.5 * h * bend, bend)
        left = dynamics.base_residual(
            pose_of(middle), velocity, acceleration, plan.contact_force[k]
        )
        wrench[k] = np.abs(left).max()
    return gap, wrench
