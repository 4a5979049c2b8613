"""Deviations of a run from the truth, its plan, the limits of its motors and an undisturbed run.

Each ``Measure`` is one quantity over time with the limit that successful jumps in the standard trial stay below.
A deviation is a stretch of time in which it is above.

Measurements are late, so they are compared with all that the truth was in the last ``LATEST`` ticks, and
averaged over some ticks, which takes noise and what happens within an impact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...blocks.signals import CommandMode, ImuReading, JointState, Phase
from ...mathematics.arrays import Array
from ...mathematics.capture_step import support_margin
from ...mathematics.constants import GRAVITY
from ...mathematics.rotations import matrices_of_quaternions
from ...runtime.language.signal_error import SignalError, SignalErrorParameters
from .robot_run import RobotRun

Kind = Literal[
    "fault", "world", "sensor", "actuator", "contact", "estimate", "limit", "plan", "body"
]
KINDS: tuple[Kind, ...] = (
    "fault", "world", "sensor", "actuator", "contact", "estimate", "limit", "plan", "body",
)  # fmt: skip
"""Kinds in the order of cause and effect: of deviations that begin together the first is the cause."""

LATEST = 0.01
"""Greatest age of a measurement [s]."""
MERGED = 0.05
"""See ``Measure.merged``."""

TILT = "tilt beyond the plan"
FORBIDDEN = "something but a contact point touches the ground, or a leg another"
DAMPED = "the drives are damped"
SMALL_TORQUE = 0.2
"""Share of its peak torque below which a motor's torque is not compared in relation to itself."""


@dataclass(frozen=True)
class Deviation:
    """A stretch of time in which a quantity was beyond its limit.

    Attributes:
        kind: what deviates.
        name: the quantity, in words.
        begin, end: when it was beyond the limit [s].
        phase: in which phase it began.
        size: the largest value.
        at: when that was [s].
        limit: what it should stay below.
        unit: of size and limit.
        effect: what it did, where that is known.
    """

    kind: Kind
    name: str
    begin: float
    end: float
    phase: str
    size: float
    at: float
    limit: float
    unit: str
    effect: str = ""

    @property
    def text(self) -> str:
        """The deviation in words."""
        if not self.unit:  # a thing that is so, or is not
            return self.name
        size = f"{self.size:.3g} {self.unit}"
        return f"{self.name}: {size}{f' ({self.effect})' if self.effect else ''}"


@dataclass(frozen=True)
class Measure:
    """A quantity at every tick, (n,), in ``unit``, and the ``limit`` that it should stay below for all but
    ``shortest`` [s]; where it is below for less than ``merged`` [s] it has not recovered."""

    kind: Kind
    name: str
    values: Array
    limit: float
    unit: str
    shortest: float = 0.0
    merged: float = MERGED

    def deviations(self, run: RobotRun) -> Iterator[Deviation]:
        """Yield every stretch beyond the limit."""
        for first, last in stretches(self.values > self.limit, round(self.merged / run.period)):
            duration = (last - first + 1) * run.period
            if duration < self.shortest - 1e-9:
                continue
            peak = first + int(np.argmax(self.values[first : last + 1]))
            yield Deviation(
                self.kind, self.name, float(run.time[first]), float(run.time[last]),
                run.phase_at(first), float(self.values[peak]), float(run.time[peak]), self.limit, self.unit,
            )  # fmt: skip


def stretches(beyond: np.ndarray, gap: int = 0) -> Iterator[tuple[int, int]]:
    """Yield the first and last index of every stretch of true values (n,); gaps of up to ``gap`` are none."""
    found = np.flatnonzero(beyond)
    if not len(found):
        return
    cuts = np.flatnonzero(np.diff(found) > gap + 1)
    for first, last in zip([0, *(cuts + 1)], [*cuts, len(found) - 1], strict=True):
        yield int(found[first]), int(found[last])


def all_deviations(run: RobotRun) -> list[Deviation]:
    """Return every deviation of the run but those of contacts, by when they begin."""
    parts = (
        _faults, _disturbances, _sensors, _actuators, _estimates, _limits, _plan, _hanging_feet, _body,
    )  # fmt: skip
    found = [d for part in parts for measure in part(run) for d in measure.deviations(run)]
    return sorted(found, key=lambda d: d.begin)


def outside(run: RobotRun, measured: Array, truth: Array, window: float = 0.0) -> Array:
    """Return the signed distance of measured values (n, ...) from the range of the truth in the last ``LATEST``
    seconds, averaged over ``window`` [s].
    """
    low = high = truth
    for k in range(1, round(LATEST / run.period) + 1):
        earlier = np.concatenate([np.repeat(truth[:1], k, axis=0), truth[:-k]])[: len(truth)]
        low, high = np.minimum(low, earlier), np.maximum(high, earlier)
    return mean(measured - np.clip(measured, low, high), round(window / run.period))


def mean(values: Array, size: int) -> Array:
    """Return the mean over ``size`` ticks about each tick, (n, ...); less at the ends."""
    if size < 2:
        return values
    n = len(values)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    first = np.clip(np.arange(n) - size // 2, 0, n)
    last = np.clip(np.arange(n) - size // 2 + size, 0, n)
    averaged: Array = (total[last] - total[first]) / (last - first).reshape(
        -1, *[1] * (values.ndim - 1)
    )
    return averaged


def length(vectors: Array) -> Array:
    """Return the Euclidean norms of (n, k) vectors."""
    norms: Array = np.linalg.norm(vectors, axis=-1)
    return norms


def _faults(run: RobotRun) -> Iterator[Measure]:
    """Yield the faults that the graph declares."""
    for spec in run.run.graph.blocks:
        if issubclass(spec.block_type, SignalError) and isinstance(
            spec.params, SignalErrorParameters
        ):
            active = run(f"{spec.path}.state", "active").astype(float)
            name = f"{spec.block_type.target} is {spec.params.kind} ({spec.path})"
            yield Measure("fault", name, active, 0.5, "")


def _disturbances(run: RobotRun) -> Iterator[Measure]:
    """Yield the disturbances unknown to the controller: pushes, ground, sliding feet, loads off the contact points."""
    truth, robot = run.truth, run.robot
    if run.push:
        yield Measure("world", "push", length(run(run.push, "force")), 1.0, "N")
    point, ground = run(truth, "contact_position"), run(truth, "ground_height")
    if run.reference:
        planned = planned_ground(run)
        for k, foot in enumerate(robot.foot_of_contact()):
            error = np.where(run.touched[:, k], np.abs(ground[:, k] - planned[:, foot]), 0.0)
            name = f"ground under {robot.contacts[k].name} off the planned height"
            yield Measure("world", name, 1e3 * error, 2.5, "mm")
    window = round(0.05 / run.period)
    if len(point) > window:
        for k, contact in enumerate(robot.contacts):
            moved = np.zeros(len(point))
            moved[window:] = length(point[window:, k, :2] - point[:-window, k, :2])
            loaded = mean(run.touched[:, k].astype(float), 1)
            whole = np.convolve(loaded, np.ones(window + 1))[: len(loaded)] > window + 0.5
            yield Measure(
                "world", f"{contact.name} slides (in 50 ms)", 1e3 * moved * whole, 4.0, "mm"
            )
    velocity, force = (
        run(truth, "com_velocity")[:, 2],
        run(truth, "contact_force")[:, :, 2].sum(axis=1),
    )
    rate = np.gradient(velocity, run.period) + GRAVITY
    pushed = run(run.push, "force")[:, 2] if run.push else 0.0
    unseen = mean(run.true_mass * rate - force - pushed, round(0.03 / run.period))
    yield Measure("world", "upward force beside the contact points", unseen, 8.0, "N", 0.02)


def planned_ground(run: RobotRun) -> Array:
    """Return the height [m] at which the plan has each foot when all of its points next carry load, or last did if it
    has not been in the air since, (n, n_feet).
    """
    feet, contact = run(run.reference, "foot_position")[:, :, 2], run(run.reference, "contact")
    planned = np.empty_like(feet)
    for foot in range(feet.shape[1]):
        points = [k for k, of in enumerate(run.robot.foot_of_contact()) if of == foot]
        down = np.flatnonzero(contact[:, points].all(axis=1))
        if not len(down):
            planned[:, foot] = np.nan
            continue
        row = np.arange(len(feet))
        following = np.searchsorted(down, row, side="right")
        last, upcoming = (
            down[np.maximum(following - 1, 0)],
            down[np.minimum(following, len(down) - 1)],
        )
        in_air = np.maximum.accumulate(np.where(run.touched[:, points].any(axis=1), -1, row))
        planned[:, foot] = feet[np.where((last <= row) & (in_air < last), last, upcoming), foot]
    return planned


def _sensors(run: RobotRun) -> Iterator[Measure]:
    """Yield the measurements that differ from the truth."""
    truth, robot = run.truth, run.robot
    joints, imu = run.sensor(JointState), run.sensor(ImuReading)
    if joints:
        off = outside(run, run(joints, "position"), run(truth, "joint_position"), 0.02)
        for k, joint in enumerate(robot.joints):
            yield Measure("sensor", f"measured angle of {joint.name} off the truth", 1e3 * np.abs(off[:, k]), 8.0, "mrad")  # fmt: skip
        off = outside(run, run(joints, "velocity"), run(truth, "joint_velocity"), 0.05)
        for k, joint in enumerate(robot.joints):
            yield Measure("sensor", f"measured speed of {joint.name} off the truth", np.abs(off[:, k]), 0.2, "rad/s")  # fmt: skip
    if run.switches:
        closed = run(run.switches, "closed")
        load = mean(length(run(truth, "contact_force")), 3)
        for k, contact in enumerate(robot.contacts):
            open_ = np.where(closed[:, k], 0.0, load[:, k])
            yield Measure(
                "sensor", f"switch of {contact.name} open under a load", open_, 4.0, "N", 0.05, 0.0
            )
            free = (closed[:, k] & (load[:, k] == 0.0)).astype(float)
            yield Measure(
                "sensor",
                f"switch of {contact.name} closed without a load",
                free,
                0.5,
                "",
                0.05,
                0.0,
            )
    if not imu:
        return
    off = outside(run, run(imu, "angular_velocity"), run(truth, "base_angular_velocity"), 0.05)
    for k, axis in enumerate("xyz"):
        yield Measure("sensor", f"gyroscope about {axis} off the truth", np.abs(off[:, k]), 0.05, "rad/s")  # fmt: skip
    body = matrices_of_quaternions(run(truth, "base_orientation"))
    rate = np.gradient(run(truth, "base_linear_velocity"), run.period, axis=0)
    force = np.einsum("nji,nj->ni", body, rate + np.array([0.0, 0.0, GRAVITY]))
    off = mean(run(imu, "specific_force") - force, round(0.06 / run.period))
    for k, axis in enumerate("xyz"):
        yield Measure("sensor", f"accelerometer along {axis} off the truth", np.abs(off[:, k]), 1.2, "m/s^2", 0.03)  # fmt: skip


def _actuators(run: RobotRun) -> Iterator[Measure]:
    """Yield the motors that do not do what they are commanded, by their measured current and by the truth."""
    truth, robot, joints = run.truth, run.robot, run.port(JointState)
    if not (run.command and joints):
        return
    command = {name: run(run.command, name) for name in
               ("torque", "position", "velocity", "stiffness", "damping")}  # fmt: skip
    position, velocity = run(truth, "joint_position"), run(truth, "joint_velocity")
    desired = command["torque"] + command["stiffness"] * (command["position"] - position)
    desired = desired + command["damping"] * (command["velocity"] - velocity)
    desired[run(run.command, "mode") != CommandMode.ACTIVE] = np.nan
    motors = np.asarray(robot.torque_to_motor)
    size = round(0.05 / run.period)
    off = np.nan_to_num(outside(run, run(truth, "motor_torque"), desired @ motors.T, 0.05))
    peak, wanted = robot.motors.peak_torque, np.nan_to_num(np.abs(mean(desired @ motors.T, size)))
    for k, motor in enumerate(robot.transmission.motors):
        share = np.abs(off[:, k]) / np.maximum(wanted[:, k], SMALL_TORQUE * peak[k])
        yield Measure(
            "actuator", f"torque of {motor} off its command", 100 * share, 60.0, "%", 0.03
        )


def _estimates(run: RobotRun) -> Iterator[Measure]:
    """Yield the estimates that differ from the truth."""
    truth, base = run.truth, run.base
    if run.delay:
        measured, used = run(run.delay, "measured"), run(run.delay, "delay")
        unknown = np.where(run(run.delay, "known"), np.abs(measured - used), 0.0)
        yield Measure("estimate", "measured delay off the one that the controller counts with", 1e3 * unknown, 2.0, "ms")  # fmt: skip
    if not base:
        return
    off = outside(run, run(base, "position"), run(truth, "base_position"))
    yield Measure("estimate", "estimated height off the truth", 1e3 * np.abs(off[:, 2]), 8.0, "mm")
    yield Measure("estimate", "estimated place off the truth", 1e3 * length(off[:, :2]), 60.0, "mm")
    if run.terms:
        arm = run(run.terms, "com") - run(run.terms, "base_position")
        off = mean(
            arm - (run(truth, "com") - run(truth, "base_position")), round(0.02 / run.period)
        )
        yield Measure(
            "estimate",
            "estimated centre of mass off the truth, seen from the base",
            1e3 * length(off),
            10.0,
            "mm",
        )
    if run.mass:
        felt = run(run.mass, "mass")
        off = np.where(felt > 0.0, np.abs(felt - run.true_mass), 0.0)
        yield Measure(
            "estimate",
            "felt mass off the truth, by a wrong mass or weak motors",
            100 * off / run.true_mass,
            8.0,
            "%",
        )
    off = outside(run, run(base, "linear_velocity"), run(truth, "base_linear_velocity"), 0.02)
    yield Measure("estimate", "estimated velocity off the truth", length(off), 0.12, "m/s", 0.02)
    estimated = matrices_of_quaternions(run(base, "orientation"))
    true = matrices_of_quaternions(run(truth, "base_orientation"))
    off = outside(
        run, estimated[:, 2], true[:, 2], 0.02
    )  # the world's vertical, seen from the base
    yield Measure("estimate", "estimated tilt off the truth", np.degrees(length(off)), 1.2, "deg")
    turn = np.unwrap(np.arctan2(estimated[:, 1, 0], estimated[:, 0, 0]) - np.arctan2(true[:, 1, 0], true[:, 0, 0]))  # fmt: skip
    level = (estimated[:, 2, 2] > 0.7) & (true[:, 2, 2] > 0.7)
    yield Measure("estimate", "estimated heading off the truth", np.degrees(np.abs(turn - turn[0])) * level, 2.0, "deg")  # fmt: skip


def _limits(run: RobotRun) -> Iterator[Measure]:
    """Yield the motors and joints at their limits, programs without a solution, what was warned of, and the safety
    stop.
    """
    truth, robot = run.truth, run.robot
    torque, speed, motors = run(truth, "motor_torque"), run(truth, "motor_speed"), robot.motors
    slope = motors.peak_torque / (motors.no_load_speed - motors.corner_speed)
    most = np.minimum(motors.peak_torque, (motors.no_load_speed - np.abs(speed)) * slope)
    driving, used = torque * speed > 0, np.abs(torque)
    share = used / np.maximum(np.where(driving, most, motors.peak_torque), 1e-3)
    saturated = run(truth, "saturated_share") > 0
    for k, motor in enumerate(robot.transmission.motors):
        values = np.where(saturated, 100 * np.minimum(share[:, k], 1.0), 0.0)
        yield Measure("limit", f"{motor} at its torque limit", values, 97.0, "%", 0.01)
    violation = np.degrees(run(truth, "joint_limit_violation"))
    yield Measure("limit", "a joint beyond its limit", violation, 0.0, "deg")
    if run.solver:
        failed = np.diff(run(run.solver, "failures"), prepend=0).astype(float)
        yield Measure("limit", "the whole-body program has no solution", failed, 0.5, "")
    outcome = run.outcome.get("metrics", {})
    if "suspect_time_s" in outcome:
        since = (run.time >= outcome["suspect_time_s"]).astype(float)
        yield Measure(
            "sensor", f"the fault detector suspects: {outcome['suspect']}", since, 0.5, ""
        )
    if run.command:
        damped = (run(run.command, "mode") == CommandMode.DAMPING).astype(float)
        fault = outcome.get("safety_fault", "")
        yield Measure("limit", f"{DAMPED} ({fault})" if fault else DAMPED, damped, 0.5, "")  # fmt: skip


def _plan(run: RobotRun) -> Iterator[Measure]:
    """Yield the deviations of the robot from its plan."""
    if not run.reference:
        return
    truth, reference = run.truth, run.reference
    before = run(reference, "time") >= 0.0
    com, planned = run(truth, "com"), run(reference, "com")
    off = (com - com[0]) - (planned - planned[0])
    standing = before & np.isin(run.phase, (Phase.STAND, Phase.SQUAT, Phase.THRUST))
    yield Measure("plan", "centre of mass behind the planned height before lift-off", -1e3 * off[:, 2] * standing, 5.0, "mm", 0.01)  # fmt: skip
    yield Measure("plan", "centre of mass above the planned height before lift-off", 1e3 * off[:, 2] * standing, 5.0, "mm", 0.01)  # fmt: skip
    yield Measure("plan", "centre of mass aside of the plan before lift-off", 1e3 * length(off[:, :2]) * standing, 10.0, "mm")  # fmt: skip
    flying = run.phase == Phase.FLIGHT
    momentum = run(truth, "angular_momentum") - run(reference, "angular_momentum")
    yield Measure("plan", "angular momentum in flight off the plan", length(momentum) * flying, 0.2, "N m s", 0.02)  # fmt: skip
    should, does = run(reference, "contact").any(axis=1), run.touched.any(axis=1)
    yield Measure("plan", "feet in the air that should stand", (before & should & ~does).astype(float), 0.5, "", 0.05)  # fmt: skip
    yield Measure("plan", "feet on the ground that should fly", (before & ~should & does).astype(float), 0.5, "", 0.05)  # fmt: skip


def _hanging_feet(run: RobotRun) -> Iterator[Measure]:
    """Yield the feet in the air beside one that stands after touchdown, which do not go down to the ground."""
    point, ground = run(run.truth, "contact_position")[:, :, 2], run(run.truth, "ground_height")
    of, robot = np.array(run.robot.foot_of_contact()), run.robot
    landing = np.isin(run.phase, (Phase.LANDING, Phase.RECOVER))
    for foot, each in enumerate(robot.feet):
        mine = of == foot
        height = (point - ground)[:, mine].min(axis=1)
        sinking = -np.gradient(mean(height, round(0.02 / run.period)), run.period)
        alone = landing & run.touched[:, ~mine].any(axis=1) & ~run.touched[:, mine].any(axis=1)
        hangs = alone & (sinking < 0.05) & (height < 0.03)
        yield Measure("plan", f"{each.name} hangs above the ground while another stands", 1e3 * height * hangs, 0.0, "mm", 0.05)  # fmt: skip


def _body(run: RobotRun) -> Iterator[Measure]:
    """Yield loss of balance, forbidden touches and falls of the robot."""
    truth = run.truth
    com, velocity = run(truth, "com"), run(truth, "com_velocity")
    point, ground = run(truth, "contact_position"), run(truth, "ground_height")
    up = matrices_of_quaternions(run(truth, "base_orientation"))[:, 2, 2]
    tilt = np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))
    if run.reference:
        planned = matrices_of_quaternions(run(run.reference, "orientation"))[:, 2, 2]
        tilt = np.maximum(0.0, tilt - np.degrees(np.arccos(np.clip(planned, -1.0, 1.0))))
    height = np.maximum(com[:, 2] - ground.mean(axis=1), 1e-3)
    ahead = com[:, :2] + velocity[:, :2] * np.sqrt(height / GRAVITY)[:, None]
    near = np.ascontiguousarray((point[:, :, 2] - ground) < 0.02)
    standing = run.touched.any(axis=1) & np.isin(
        run.phase, (Phase.STAND, Phase.LANDING, Phase.RECOVER)
    )
    margin = np.array(
        [support_margin(p, n, x, y) for p, n, (x, y) in zip(point, near, ahead, strict=True)]
    )
    yield Measure("body", "capture point outside the support", -1e3 * margin * standing, 10.0, "mm", 0.02)  # fmt: skip
    yield Measure("body", TILT, tilt, 20.0, "deg")
    touching = run(truth, "forbidden_contacts").astype(float)
    yield Measure("body", FORBIDDEN, touching, 0.5, "physics steps")  # fmt: skip


__all__ = [
    "KINDS",
    "Deviation",
    "Kind",
    "Measure",
    "all_deviations",
    "mean",
    "outside",
    "stretches",
]
