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

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ..checking.replay import flight_knots
from ..models.euler_angles import angular_motion, euler_angles, euler_rates, rotation
from ..models.exact_dynamics import AFTER, BEFORE, ExactDynamics, JointMotion, joint_motion
from ..task.plan import PlannedJump
from .jump_table import JumpTable

State = tuple[float, int, Array, Array, Array]
"""Time, interval, q, v and the accelerations of base (angular, in the body) and joints."""

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
    """The plan as a table that begins with standing still for ``stand_time`` [s].

    Two rows are at most ``STEP`` apart, or what ``steps`` says for a phase [s].
    """
    dynamics = ExactDynamics(plan.task.equipped(robot))
    forces = _MiddleValues(plan, plan.contact_force)
    torques = _MiddleValues(plan, plan.joint_torque)
    rows: dict[str, list[Array]] = {}
    times: list[float] = []
    intervals: list[int] = []
    for time, k, q, v, bend in _states(plan, dynamics, steps or {}):
        times.append(time)
        intervals.append(k)
        row = _row(dynamics, q, v, forces.at(time, k))
        row["joint_torque"] = torques.at(time, k)
        row["angular_acceleration"], row["joint_acceleration"] = bend[:3], bend[3:]
        for name, value in row.items():
            rows.setdefault(name, []).append(value)
    columns = {name: np.array(values) for name, values in rows.items()}
    for foot in range(len(robot.feet)):
        columns["foot_yaw"][:, foot] = np.unwrap(columns["foot_yaw"][:, foot])
    _follow_one_sign(columns["orientation"])
    if plan.task.formulation != "full":
        for name in CENTROIDAL:
            own = getattr(plan, name)
            columns[name] = np.stack([np.interp(times, plan.time, own[:, i]) for i in range(3)], 1)
    for name in ("com_acceleration", "angular_momentum_rate"):
        columns[name][-1] = 0.0  # the plan has come to rest, and the last row stays
    standing = {name: values[:1] for name, values in columns.items()}
    for name in (
        "com_acceleration",
        "angular_acceleration",
        "angular_momentum_rate",
        "joint_acceleration",
    ):
        standing[name] = np.zeros_like(standing[name])
    start = {
        phase: stand_time + float(plan.time[plan.phase == phase][0])
        for phase in (Phase.SQUAT, Phase.THRUST, Phase.RECOVER)
        if np.any(plan.phase == phase)
    }
    end = stand_time + float(plan.time[-1])
    return JumpTable(
        np.concatenate([[0.0, stand_time], stand_time + np.array(times)]),
        {n: np.concatenate([standing[n], standing[n], c]) for n, c in columns.items()},
        stand_time,
        start.get(Phase.THRUST, start.get(Phase.SQUAT, stand_time)),
        stand_time + plan.lift_off_time,
        stand_time + plan.touchdown_time,
        start.get(Phase.RECOVER, end),
        tuple(_later_jumps(plan, stand_time)),
        _contacts(plan, intervals),
    )


def _later_jumps(plan: PlannedJump, stand_time: float) -> Iterator[tuple[float, float, float]]:
    """When thrust, flight and landing of the jumps behind the first begin."""
    for before, (lift_off, touchdown) in zip(
        plan.touchdown_times, plan.later_flights, strict=False
    ):
        between = (plan.time > before - 1e-9) & (plan.time < lift_off - 1e-9)
        thrust = plan.time[between & (plan.phase == Phase.THRUST)]
        begin = float(thrust[0]) if len(thrust) else before
        yield stand_time + begin, stand_time + lift_off, stand_time + touchdown


def _contacts(plan: PlannedJump, intervals: list[int]) -> NDArray[np.bool_] | None:
    """By row which points carry load, where it is not always all of them or none."""
    if np.all(plan.contact == (plan.phase != Phase.FLIGHT)[:, None]):
        return None
    return np.concatenate([plan.contact[[0, 0]], plan.contact[intervals]])


def _states(
    plan: PlannedJump, dynamics: ExactDynamics, steps: Mapping[Phase, float]
) -> Iterator[State]:
    """The motion, knots and what lies between them; two rows at an impact."""
    angles = euler_angles(plan.position[:, 3:7])
    last = len(plan.time) - 1
    for k in range(last):
        start, h = float(plan.time[k]), float(plan.time[k + 1] - plan.time[k])
        yield start, k, plan.position[k], plan.velocity[k], plan.acceleration[k, 3:]
        if h <= 0.0:
            continue
        joints = joint_motion(plan.position, plan.velocity, plan.time, k)
        base = _base_motion(plan, dynamics, angles, k, h)
        step = steps.get(Phase(int(plan.phase[k])), STEP)
        count = math.ceil(h / step - 1e-9)
        for i in range(1, count):
            yield start + i * h / count, k, *_between(base, joints, i * h / count, dynamics)
    still = np.zeros(plan.velocity.shape[1] - 3)
    yield float(plan.time[last]), last - 1, plan.position[last], plan.velocity[last], still


def _base_motion(
    plan: PlannedJump, dynamics: ExactDynamics, angles: Array, k: int, h: float
) -> JointMotion:
    """The cubic of base position and Euler angles between two knots."""
    ends = []
    for knot in (k, k + 1):
        turn = dynamics.pin.Quaternion(plan.position[knot, 3:7]).toRotationMatrix()
        v = plan.velocity[knot]
        ends.append(np.concatenate([product(turn, v[:3]), euler_rates(angles[knot], v[3:6])]))
    places = [np.concatenate([plan.position[i, :3], angles[i]]) for i in (k, k + 1)]
    return JointMotion(places[0], places[1], ends[0], ends[1], h)


def _between(
    base: JointMotion, joints: JointMotion, time: float, dynamics: ExactDynamics
) -> tuple[Array, Array, Array]:
    """Pinocchio's q and v between two knots, and the accelerations of a ``State``."""
    place, rate, bend = base.at(time)
    position, velocity, acceleration = joints.at(time)
    turn = rotation(place[3:])
    spin, bent = angular_motion(place[3:], rate[3:], bend[3:])
    quaternion = dynamics.pin.Quaternion(turn).coeffs()
    return (
        np.concatenate([place[:3], quaternion, position]),
        np.concatenate([product(turn.T, rate[:3]), spin, velocity]),
        np.concatenate([bent, acceleration]),
    )


class _MiddleValues:
    """What holds in the middle of the intervals, at any time: linear from one middle to the next,
    never across lift-off or touchdown."""

    def __init__(self, plan: PlannedJump, values: Array) -> None:
        self._time, self._values = plan.time, values
        lasting = np.flatnonzero(np.diff(plan.time) > 0.0)
        ends = [knot for flight in flight_knots(plan) for knot in flight]
        self._groups = np.split(lasting, np.searchsorted(lasting, ends))
        self._ends = np.array(ends)

    def at(self, time: float, interval: int) -> Array:
        """The values at an instant of that interval."""
        group = self._groups[int(np.searchsorted(self._ends, interval, side="right"))]
        middles = 0.5 * (self._time[group] + self._time[group + 1])
        after = int(np.searchsorted(middles, time))
        if after in (0, len(middles)):
            return np.asarray(self._values[group[min(after, len(middles) - 1)]])
        before = after - 1
        share = (time - middles[before]) / (middles[after] - middles[before])
        first, second = self._values[group[before]], self._values[group[after]]
        return np.asarray(first + share * (second - first))


def _row(dynamics: ExactDynamics, q: Array, v: Array, force: Array) -> dict[str, Array]:
    """The reference's fields in one state under those forces."""
    com, com_velocity, momentum = dynamics.centroidal(q, v)
    points = dynamics.evaluated_points(q)
    yaw, pitch = dynamics.foot_angles()
    arms = points - com
    moments = arms[:, AFTER] * force[:, BEFORE] - arms[:, BEFORE] * force[:, AFTER]
    return {
        "com": com,
        "com_velocity": com_velocity,
        "com_acceleration": force.sum(axis=0) / dynamics.mass + np.array([0.0, 0.0, -GRAVITY]),
        "orientation": q[3:7].copy(),
        "angular_velocity": v[3:6].copy(),
        "angular_momentum": momentum,
        "angular_momentum_rate": moments.sum(axis=0),
        "foot_position": dynamics.sole_places(),
        "foot_velocity": dynamics.sole_velocities(v),
        "foot_yaw": yaw,
        "foot_pitch": pitch,
        "joint_position": q[7:].copy(),
        "joint_velocity": v[6:].copy(),
    }


def _follow_one_sign(quaternions: Array) -> None:
    """Choose the sign of every quaternion that is nearest to the one before, in place."""
    flips = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(flips)[:, None]
