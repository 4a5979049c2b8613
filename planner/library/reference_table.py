"""Turns a plan into a table of the reference that the controller follows, with a row about every 2 ms.

Between two knots the base position, the Euler angles and the joints follow the cubic through both knots. In
flight this is within a millimetre of exact dynamics, because a valid plan is. The rate of change of momentum
follows from the contact forces. A contact force is taken to hold in the middle of its interval and to change
linearly from there to the middle of the next, but never across lift-off or touchdown.

In the formulations ``paper`` and ``srbm`` the centre of mass and the momentum are variables of their own, with
which the motion of the joints does not quite agree. Such plans are never valid. A controller that follows one
nevertheless receives these variables, which agree with the planned forces.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.rotations import matrices_of_quaternions
from ...robots.description import RobotDescription
from ..models.euler_angles import (
    ORDER,
    coordinates_of,
    rotation,
    times,
    twist_of,
    unwrapped,
)
from ..models.exact_dynamics import (
    AFTER,
    BEFORE,
    ExactDynamics,
    dynamics_of,
    states_between,
)
from ..task.phase import Phase
from ..task.plan import PlannedJump
from .jump_table import JumpTable

CENTROIDAL = ("com", "com_velocity", "angular_momentum")

STEP = 0.002
"""Longest time between two rows [s]."""
COARSE_STEPS = {Phase.SQUAT: 0.01, Phase.THRUST: 0.005, Phase.FLIGHT: 0.005, Phase.LANDING: 0.02}
"""The same by phase, for a table that is made while the robot moves."""


def reference_table(
    plan: PlannedJump,
    robot: RobotDescription,
    stand_time: float,
    steps: Mapping[Phase, float] | None = None,
) -> JumpTable:
    """Return the plan as a table that begins with standing still for ``stand_time`` [s].

    Two rows are at most ``STEP`` apart, or what ``steps`` says for a phase [s].
    """
    dynamics = dynamics_of(plan.task.equipped(robot))
    states = _states(plan, dynamics, steps or {})
    instants, intervals = states.time, states.knot
    flat = plan.contact_force.reshape(len(plan.time), -1)
    loads = _middle_values(plan, np.hstack([flat, plan.joint_torque]), instants, intervals)
    force = loads[:, : flat.shape[1]].reshape(-1, *plan.contact_force.shape[1:])
    columns = _rows(dynamics, states.position, states.velocity, force)
    columns["joint_torque"] = loads[:, flat.shape[1] :]
    columns["angular_acceleration"], columns["joint_acceleration"] = (
        states.bend[:, :3], states.bend[:, 3:],
    )  # fmt: skip
    columns["foot_yaw"] = unwrapped(columns["foot_yaw"])
    _follow_one_sign(columns["orientation"])
    if plan.task.formulation != "full":
        for name in CENTROIDAL:
            own = getattr(plan, name)
            columns[name] = np.stack(
                [np.interp(instants, plan.time, own[:, i]) for i in range(3)], 1
            )
    for name in ("com_acceleration", "angular_momentum_rate"):
        columns[name][-1] = 0.0  # the plan has come to rest, and the last row stays
    # The table begins at rest in the first state, with two rows.
    rows = np.concatenate([[0, 0], np.arange(len(instants))])
    columns = {name: values[rows] for name, values in columns.items()}
    for name in (
        "com_acceleration",
        "angular_acceleration",
        "angular_momentum_rate",
        "joint_acceleration",
    ):
        columns[name][:2] = 0.0
    start = {
        phase: stand_time + float(plan.time[plan.phase == phase][0])
        for phase in (Phase.SQUAT, Phase.THRUST, Phase.RECOVER)
        if np.any(plan.phase == phase)
    }
    end = stand_time + float(plan.time[-1])
    return JumpTable(
        np.concatenate([[0.0, stand_time], stand_time + instants]),
        columns,
        stand_time,
        start.get(Phase.THRUST, start.get(Phase.SQUAT, stand_time)),
        stand_time + plan.lift_off_time,
        stand_time + plan.touchdown_time,
        start.get(Phase.RECOVER, end),
        tuple(_later_jumps(plan, stand_time)),
        _contacts(plan, intervals),
    )


def _later_jumps(plan: PlannedJump, stand_time: float) -> Iterator[tuple[float, float, float]]:
    """Yield when thrust, flight and landing of the jumps behind the first begin."""
    for before, (lift_off, touchdown) in zip(
        plan.touchdown_times, plan.later_flights, strict=False
    ):
        between = (plan.time > before - 1e-9) & (plan.time < lift_off - 1e-9)
        thrust = plan.time[between & (plan.phase == Phase.THRUST)]
        begin = float(thrust[0]) if len(thrust) else before
        yield stand_time + begin, stand_time + lift_off, stand_time + touchdown


def _contacts(plan: PlannedJump, intervals: NDArray[np.int64]) -> NDArray[np.bool_] | None:
    """Return by row which points carry load, where it is not always all of them or none."""
    if np.all(plan.contact == (plan.phase != Phase.FLIGHT)[:, None]):
        return None
    return np.concatenate([plan.contact[[0, 0]], plan.contact[intervals]])


class _States(NamedTuple):
    """The motion row by row: time and interval (n,), q and v of Pinocchio, and the accelerations of base (angular, in
    the body) and joints, (n, 3 + n_joints)."""

    time: Array
    knot: NDArray[np.int64]
    position: Array
    velocity: Array
    bend: Array


def _states(plan: PlannedJump, dynamics: ExactDynamics, steps: Mapping[Phase, float]) -> _States:
    """Return the motion, knots and what lies between them; two rows at an impact."""
    last = len(plan.time) - 1
    lengths = plan.steps
    longest = [steps.get(Phase(phase), STEP) for phase in plan.phase[:-1].tolist()]
    counts = np.maximum(np.ceil(lengths / longest - 1e-9), 1.0).astype(np.int64)
    knot = np.repeat(np.arange(last), counts)
    number = np.arange(len(knot)) - (np.cumsum(counts) - counts)[knot]
    between = number > 0
    passed = number * lengths[knot] / counts[knot]
    position, velocity = plan.position[knot], plan.velocity[knot]
    bend = plan.acceleration[knot, 3:]
    position[between], velocity[between], bend[between] = _between(
        plan, dynamics, knot[between], passed[between]
    )
    still = np.zeros((1, plan.velocity.shape[1] - 3))
    return _States(
        np.append(plan.time[knot] + passed, plan.time[last]),
        np.append(knot, last - 1),
        np.concatenate([position, plan.position[last:]]),
        np.concatenate([velocity, plan.velocity[last:]]),
        np.concatenate([bend, still]),
    )


def _between(
    plan: PlannedJump, dynamics: ExactDynamics, knot: NDArray[np.int64], passed: Array
) -> tuple[Array, Array, Array]:
    """Return Pinocchio's q and v at those times since knots, both (n,), and the accelerations of ``_States``: the cubics of
    base position, Euler angles and joints between two knots.
    """
    q, v = coordinates_of(plan.position, plan.velocity)
    # The plan's own matrices: a matrix of the angles has other last bits.
    v[:, :3] = times(matrices_of_quaternions(plan.position[:, 3:7]), plan.velocity[:, :3])
    place, rate, bend = states_between(q, v, plan.time, knot, passed)
    velocity, acceleration = twist_of(place, rate, bend)
    quaternions = pinocchio_quaternions(dynamics.pin, rotation(place[:, 3:6][:, ORDER]))
    return (
        np.hstack([place[:, :3], quaternions, place[:, 6:]]), velocity, acceleration[:, 3:],
    )  # fmt: skip


def pinocchio_quaternions(pin: Any, turns: Array) -> Array:
    """Return Pinocchio's quaternions (n, 4) of rotation matrices (n, 3, 3), with its bits; all with a positive trace,
    as those of an upright base, at once.
    """
    trace = turns[:, 0, 0] + (turns[:, 1, 1] + turns[:, 2, 2])
    root = np.sqrt(np.maximum(trace, 0.0) + 1.0)
    share = 0.5 / root
    found = np.stack(
        [*((turns[:, i, j] - turns[:, j, i]) * share for i, j in ((2, 1), (0, 2), (1, 0))), 0.5 * root],
        axis=1,
    )  # fmt: skip
    for row in np.flatnonzero(~(trace > 0.0)).tolist():
        found[row] = pin.Quaternion(turns[row]).coeffs()
    return found


def _middle_values(
    plan: PlannedJump, values: Array, instants: Array, intervals: NDArray[np.int64]
) -> Array:
    """Return what the intervals' values (n_knots, m) are at instants in those intervals: linear from one middle to the
    next, never across lift-off or touchdown.
    """
    lasting = plan.lasting
    ends = np.array([knot for flight in plan.flight_knots for knot in flight])
    middles = 0.5 * (plan.time[lasting] + plan.time[lasting + 1])
    # Each instant lies between two middles of its own group: what is before, between or behind those ends.
    bounds = np.concatenate([[0], np.searchsorted(lasting, ends), [len(lasting)]])
    number = np.searchsorted(ends, intervals, side="right")
    first, stop = bounds[number], bounds[number + 1]
    after = np.clip(np.searchsorted(middles, instants), first, stop)
    found = values[lasting[np.minimum(after, stop - 1)]]
    inside = np.flatnonzero((after > first) & (after < stop))
    after = after[inside]
    share = (instants[inside] - middles[after - 1]) / (middles[after] - middles[after - 1])
    before = values[lasting[after - 1]]
    found[inside] = before + share[:, None] * (values[lasting[after]] - before)
    return np.asarray(found)


def _rows(dynamics: ExactDynamics, q: Array, v: Array, force: Array) -> dict[str, Array]:
    """Return the reference's fields in n states under those forces (n, n_contacts, 3)."""
    feet = dynamics.feet(q, v)
    arms = feet.points - feet.com[:, None]
    moments = arms[:, :, AFTER] * force[:, :, BEFORE] - arms[:, :, BEFORE] * force[:, :, AFTER]
    return {
        "com": feet.com,
        "com_velocity": feet.com_velocity,
        "com_acceleration": force.sum(axis=1) / dynamics.mass + np.array([0.0, 0.0, -GRAVITY]),
        "orientation": q[:, 3:7].copy(),
        "angular_velocity": v[:, 3:6],
        "angular_momentum": feet.momentum,
        "angular_momentum_rate": moments.sum(axis=1),
        "foot_position": feet.soles,
        "foot_velocity": feet.sole_velocity,
        "foot_yaw": feet.yaw,
        "foot_pitch": feet.pitch,
        "joint_position": q[:, 7:],
        "joint_velocity": v[:, 6:],
    }


def _follow_one_sign(quaternions: Array) -> None:
    """Choose the sign of every quaternion that is nearest to the one before, in place."""
    flips = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(flips)[:, None]
