"""Replays a plan with exact dynamics, at its knots and between them.

Every interval is integrated by itself from the plan's state at its beginning. In stance the open loop is
unstable, so an error that has grown over many intervals would say nothing about the plan. Every flight is
also integrated as a whole, from lift-off to touchdown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from ...mathematics.whole_body_motion import MotionTerms
from ...robots.description import RobotDescription
from ..models.euler_angles import coordinates_of, pose_of, twist_of, unwrapped
from ..models.exact_dynamics import (
    ExactDynamics,
    Segments,
    dynamics_of,
    half_steps,
    rotation_between,
    states_between,
)
from ..task.plan import PlannedJump

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
        impacts: by knot the velocities behind its impulse and the impulses of held joints, see
            ``ExactDynamics.velocity_after_impact``.
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
    impacts: dict[int, tuple[Array, Array]]


def replay(plan: PlannedJump, robot: RobotDescription) -> Replay:
    """Replay a plan on the robot with the actuator profile that the plan is for.

    Raises:
        ValueError: it has not one flight for every jump of its task.
    """
    dynamics, flights, lasting = dynamics_of(robot), plan.flight_knots, plan.lasting
    flown = [_flight(plan, lift_off, touchdown) for lift_off, touchdown in flights]
    single = half_steps(plan.position, plan.velocity, plan.time, plan.contact_force, lasting)
    places, rates = dynamics.follow(Segments.joined([*(one.segments for one in flown), single]))
    behind = np.cumsum([len(one.time) for one in flown])
    errors = tuple(
        (float(np.linalg.norm(places[last - 1, :3] - plan.position[end, :3])),
         float(rotation_between(places[last - 1, 3:7], plan.position[end, 3:7])))
        for last, (_, end) in zip(behind, flights, strict=True)
    )  # fmt: skip
    # Behind the flights every lasting interval has its middle and its end.
    first = int(behind[-1])
    impacts = {
        k: dynamics.velocity_after_impact(
            plan.position[k], plan.velocity[k], plan.contact_force[k], held_joints(plan, k)
        )
        for k in np.flatnonzero(plan.steps <= 0.0).tolist()
    }
    defect = _defects(plan, impacts, lasting, places[first + 1 :: 2], rates[first + 1 :: 2])
    gap, wrench = midpoint_residuals(plan, dynamics)
    flying = np.zeros(len(plan.steps), np.bool_)
    for lift_off, touchdown in flights:
        flying[lift_off:touchdown] = True
    grounded = ~flying[lasting]
    half = 0.5 * plan.steps[lasting[grounded]]
    samples, terms, knots = _sample(
        plan, dynamics,
        np.concatenate([*(one.time for one in flown), plan.time[lasting[grounded]] + half]),
        np.concatenate([*(one.knot for one in flown), lasting[grounded]]),
        np.concatenate([places[:first], places[first::2][grounded]]),
        np.concatenate([rates[:first], rates[first::2][grounded]]),
    )  # fmt: skip
    contacts, balls = plan.contact.shape[1], [ball.foot for ball in dynamics.balls]
    ahead = terms.ahead[knots, contacts:]
    ahead[:, balls] = matrices_of_quaternions(plan.position[:, 3:7])[:, None, :, 0]
    return Replay(
        samples, defect, gap, wrench, errors,
        terms.com[knots], terms.com_velocity[knots], terms.momentum[knots],
        terms.points[knots, contacts:],
        unwrapped(np.arctan2(ahead[:, :, 1], ahead[:, :, 0])),
        flights, impacts,
    )  # fmt: skip


@dataclass(frozen=True)
class _Flight:
    """A whole flight: time and interval of the end of every step, (n_steps,)."""

    segments: Segments
    time: Array
    knot: NDArray[np.int64]


def _flight(plan: PlannedJump, lift_off: int, touchdown: int) -> _Flight:
    """Return the flight from the plan's state at lift-off, in steps of at most ``FLIGHT_STEP``."""
    # An even number of steps, so that the interval's middle is among them.
    durations = plan.steps[lift_off:touchdown]
    counts = 2 * np.ceil(0.5 * durations / FLIGHT_STEP).astype(np.int64)
    step = durations / counts
    interval, number = _numbered(counts)
    half, half_number = _numbered(2 * counts)
    passed = np.concatenate([[0.0], 0.5 * step[half] * half_number])
    angles, speeds, _ = states_between(
        plan.position[:, 7:], plan.velocity[:, 6:], plan.time,
        lift_off + np.concatenate([[0], half]), passed,
    )  # fmt: skip
    first = slice(lift_off, lift_off + 1)
    segments = Segments(
        plan.position[first, :7], plan.velocity[first, :6], angles, speeds,
        np.zeros_like(plan.contact_force[first]), step[interval], np.array([len(interval)]),
    )  # fmt: skip
    return _Flight(
        segments, plan.time[lift_off + interval] + step[interval] * number, lift_off + interval
    )


def _numbered(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return, where the k-th of some things has so many parts, of every part the thing and its number in it, from 1."""
    of_part = np.repeat(np.arange(len(counts)), counts)
    return of_part, np.arange(1, len(of_part) + 1) - (np.cumsum(counts) - counts)[of_part]


def held_joints(plan: PlannedJump, k: int) -> NDArray[np.bool_]:
    """Return the joints (n_joints) that stand still before and behind the impact at a knot: roll and yaw of a mirrored
    jump, which their motors keep.
    """
    still = (plan.velocity[k : k + 2, 6:] == 0.0).all(axis=0)
    return np.asarray(still)


def _defects(
    plan: PlannedJump, impacts: dict[int, tuple[Array, Array]], lasting: NDArray[np.int64],
    places: Array, rates: Array,
) -> Array:  # fmt: skip
    """Return the distances by which exact dynamics from each knot miss the next, see ``Replay``; ``places`` and
    ``rates`` are the ends of the lasting intervals.
    """
    reached, moving = plan.position[:-1, :7].copy(), plan.velocity[:-1, :6].copy()
    reached[lasting], moving[lasting] = places[:, :7], rates[:, :6]
    for k, (behind, _) in impacts.items():
        moving[k] = behind[:6]
    missed, slip = reached - plan.position[1:, :7], moving - plan.velocity[1:, :6]
    return np.column_stack(
        [
            np.linalg.norm(missed[:, :3], axis=1),
            rotation_between(reached[:, 3:7], plan.position[1:, 3:7]),
            np.linalg.norm(slip[:, :3], axis=1),
            np.linalg.norm(slip[:, 3:], axis=1),
        ]
    )


def _sample(
    plan: PlannedJump, dynamics: ExactDynamics,
    time: Array, knot: NDArray[np.int64], places: Array, rates: Array,
) -> tuple[ReplaySamples, MotionTerms, NDArray[np.int64]]:  # fmt: skip
    """Return all knots and the given states between them, in time's order; what follows from them; and which samples
    are the knots.
    """
    count = len(plan.time)
    own = np.arange(count)
    # A knot comes before what lies in the interval behind it.
    order = np.lexsort((np.concatenate([plan.time, time]), np.concatenate([own, knot])))
    interval = np.concatenate([np.minimum(own, count - 2), knot])[order]
    instant = np.concatenate([plan.time, time])[order]
    position = np.concatenate([plan.position, places])[order]
    velocity = np.concatenate([plan.velocity, rates])[order]
    _, _, bend = states_between(
        plan.position[:, 7:], plan.velocity[:, 6:], plan.time, interval, instant - plan.time[interval]
    )  # fmt: skip
    lasts = (plan.time[interval + 1] > plan.time[interval])[:, None]
    force = np.where(lasts[:, :, None], plan.contact_force[interval], 0.0)
    terms = dynamics.motion(position, velocity, bend, force)
    contacts = force.shape[1]
    samples = ReplaySamples(
        instant, interval, position, velocity, np.where(lasts, terms.torque, 0.0),
        terms.points[:, :contacts], terms.point_velocity[:, :contacts],
    )  # fmt: skip
    return samples, terms, np.flatnonzero(order < count)


def midpoint_residuals(plan: PlannedJump, dynamics: ExactDynamics) -> tuple[Array, Array]:
    """Return the residuals of the planner's own equations in every interval, zero at impacts.

    The ``full`` formulation holds accelerations of its coordinates constant over an interval and
    fulfils the equations of motion in its middle. Exact dynamics evaluates these anew.

    Returns the gap, how far the coordinates miss those of a constant acceleration [m or rad],
    (N-1,), and the base's six equations of motion in the middle [N or N m], (N-1,).
    """
    places, rates = coordinates_of(plan.position, plan.velocity)
    gap, wrench = np.zeros(len(plan.time) - 1), np.zeros(len(plan.time) - 1)
    k = plan.lasting
    h = plan.steps[k][:, None]
    bend = (rates[k + 1] - rates[k]) / h
    gap[k] = np.abs(places[k + 1] - places[k] - 0.5 * h * (rates[k] + rates[k + 1])).max(axis=1)
    middle = places[k] + 0.5 * h * rates[k] + 0.125 * h * h * bend
    velocity, acceleration = twist_of(middle, rates[k] + 0.5 * h * bend, bend)
    left = dynamics.base_residual(pose_of(middle), velocity, acceleration, plan.contact_force[k])
    wrench[k] = np.abs(left).max(axis=1)
    return gap, wrench
