"""What ``SafetyMonitor`` does in every tick, as kernels: judging the robot, and the command it gets."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import Array, Array1D, Flags0D, Indices0D, Indices1D
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ..signals import CommandMode, DrivePhase, SwitchFault
from .health_limits import Health, judge_health, measured
from .safety_faults import Fault

# What a compiled kernel can return.
_TILT, _JOINT_LIMIT, _JOINT_SPEED = int(Fault.TILT), int(Fault.JOINT_LIMIT), int(Fault.JOINT_SPEED)
_STALE_SENSORS, _SOLVER = int(Fault.STALE_SENSORS), int(Fault.SOLVER)
_ABSURD_STATE, _ABSURD_COMMAND = int(Fault.ABSURD_STATE), int(Fault.ABSURD_COMMAND)
_SWITCH, _GOOD_SWITCH = int(Fault.SWITCH), int(SwitchFault.NONE)
_OFF, _DAMPED = int(DrivePhase.OFF), int(DrivePhase.DAMPED)
_DAMPING_MODE = int(CommandMode.DAMPING)


class Command(NamedTuple):
    """The fields of ``JointCommand``."""

    mode: Indices0D
    torque: Array1D
    position: Array1D
    velocity: Array1D
    stiffness: Array1D
    damping: Array1D


class RobotState(NamedTuple):
    """What is known of the robot: the fields of ``BaseState``, the joints' position and velocity, and
    whether the controller has solved."""

    position: Array1D
    orientation: Array1D
    linear_velocity: Array1D
    angular_velocity: Array1D
    joint_position: Array1D
    joint_velocity: Array1D
    solved: Flags0D


class Timers(NamedTuple):
    """The fields of ``SafetyState`` that are counts of ticks, and the joints of the last tick."""

    tilted: Indices0D
    beyond: Indices1D
    fast: Indices1D
    stale: Indices0D
    unsolved: Indices0D
    last_position: Array1D
    last_velocity: Array1D
    started: Flags0D


class Bounds(NamedTuple):
    """The limits of joints and torques, each (n_joints,), the tilt's [rad], and how many ticks each
    may be beyond: ``stale`` and ``unsolved`` are not judged if zero."""

    lower: Array1D
    upper: Array1D
    speed: Array1D
    torque: Array1D
    tilt: float
    tilt_ticks: int
    joint_ticks: int
    stale_ticks: int
    unsolved_ticks: int


class Switches(NamedTuple):
    """The fields of ``SwitchHealth``."""

    fault: Indices1D
    stop: Flags0D


class Verdict(NamedTuple):
    """The fault of this tick and the place where it befell, (2,), and what was measured, (1,)."""

    fault: Indices1D
    value: Array1D


@kernel
def is_plausible(command: Command, torque: Array1D) -> bool:
    """Whether a command is finite and within what drives can do."""
    return (
        within_each(command.torque, torque)
        and within(command.position, 100.0)
        and within(command.velocity, 1000.0)
        and within(command.stiffness, 10000.0)
        and within(command.damping, 1000.0)
    )


@kernel
def is_possible(robot: RobotState) -> bool:
    """Whether a state is finite and within what the robot can do."""
    return (
        within(robot.joint_position, 100.0)
        and within(robot.joint_velocity, 1000.0)
        and within(robot.orientation, 2.0)
        and within(robot.linear_velocity, 10.0)
        and within(robot.angular_velocity, 100.0)
        and within(robot.position, 1e6)
    )


@kernel
def note_change(robot: RobotState, timers: Timers) -> None:
    """Count the ticks since a joint reading changed."""
    changed = not timers.started[()]
    for joint in range(robot.joint_position.shape[0]):
        position, velocity = robot.joint_position[joint], robot.joint_velocity[joint]
        if position != timers.last_position[joint] or velocity != timers.last_velocity[joint]:
            changed = True
        timers.last_position[joint] = position
        timers.last_velocity[joint] = velocity
    timers.started[()] = True
    timers.stale[()] = 0 if changed else timers.stale[()] + 1


@kernel
def judge(desired: Command, robot: RobotState, bounds: Bounds, timers: Timers) -> int:
    """The gravest fault of this tick but those of the hardware; all timers are updated."""
    if not is_plausible(desired, bounds.torque):
        return _ABSURD_COMMAND
    if not is_possible(robot):
        return _ABSURD_STATE
    leans = tilt(robot.orientation) > bounds.tilt
    timers.tilted[()] = timers.tilted[()] + 1 if leans else 0
    beyond = count_beyond(robot.joint_position, bounds.lower, bounds.upper, timers.beyond)
    fast = count_faster(robot.joint_velocity, bounds.speed, timers.fast)
    note_change(robot, timers)
    timers.unsolved[()] = 0 if robot.solved[()] else timers.unsolved[()] + 1
    if timers.tilted[()] > bounds.tilt_ticks:
        return _TILT
    if beyond > bounds.joint_ticks:
        return _JOINT_LIMIT
    if fast > bounds.joint_ticks:
        return _JOINT_SPEED
    if 0 < bounds.stale_ticks <= timers.stale[()]:
        return _STALE_SENSORS
    if 0 < bounds.unsolved_ticks <= timers.unsolved[()]:
        return _SOLVER
    return 0


@kernel
def pass_on(desired: Command, command: Command) -> None:
    """Pass the command on."""
    command.mode[()] = desired.mode[()]
    for joint in range(command.torque.shape[0]):
        command.torque[joint] = desired.torque[joint]
        command.position[joint] = desired.position[joint]
        command.velocity[joint] = desired.velocity[joint]
        command.stiffness[joint] = desired.stiffness[joint]
        command.damping[joint] = desired.damping[joint]


@kernel
def damp(position: Array, damping: Array, command: Command) -> None:
    """Command damping where the joints are; all values are finite."""
    command.mode[()] = _DAMPING_MODE
    for joint in range(command.torque.shape[0]):
        angle = float(position[joint])
        command.position[joint] = angle if math.isfinite(angle) else 0.0
        command.torque[joint] = command.velocity[joint] = command.stiffness[joint] = 0.0
        command.damping[joint] = damping[joint]


@kernel
def watch(
    desired: Command,
    robot: RobotState,
    bounds: Bounds,
    timers: Timers,
    health: Health,
    switches: Switches,
    damping: Array1D,
    lasting: Indices0D,
    command: Command,
    verdict: Verdict,
) -> None:
    """Judge this tick, and pass the command on or damp.

    Args:
        damping: of the joints after a fault [N m s/rad], (n_joints,).
        lasting: the fault of an earlier tick, without a dimension.
    """
    fault, place, value = judge(desired, robot, bounds, timers), 0, 0.0
    if _OFF < health.state[()] < _DAMPED:
        judge_health(health.drives, health.sensors, health.limits, health.verdict)
        found, place = health.verdict[0], health.verdict[1]
        value = measured(health, found, place)
        if fault == 0:
            fault = found
    if fault == 0 and switches.stop[()]:
        fault, place = _SWITCH, 0
        while place < switches.fault.shape[0] - 1 and switches.fault[place] == _GOOD_SWITCH:
            place += 1
        value = float(switches.fault[place])
    verdict.fault[0], verdict.fault[1], verdict.value[0] = fault, place, value
    if fault == 0 and lasting[()] == 0:
        pass_on(desired, command)
    else:
        damp(robot.joint_position, damping, command)


@kernel
def within(values: Array1D, limit: float) -> bool:
    """Whether all values are finite and their magnitudes at most ``limit``."""
    inside = True
    for i in range(values.shape[0]):
        inside = inside and abs(values[i]) <= limit
    return inside


@kernel
def within_each(values: Array1D, limits: Array1D) -> bool:
    """Whether every value is finite and its magnitude at most its limit."""
    inside = True
    for i in range(values.shape[0]):
        inside = inside and abs(values[i]) <= limits[i]
    return inside


@kernel
def count_beyond(values: Array1D, lower: Array1D, upper: Array1D, counts: Indices1D) -> int:
    """Count how many times in a row each value was out of bounds; returns the largest count."""
    largest = 0
    for i in range(values.shape[0]):
        out = not lower[i] <= values[i] <= upper[i]
        counts[i] = count = counts[i] + 1 if out else 0
        largest = max(largest, count)
    return largest


@kernel
def count_faster(values: Array1D, limits: Array1D, counts: Indices1D) -> int:
    """Count how many times in a row each value's magnitude was above its limit.

    Returns the largest count.
    """
    largest = 0
    for i in range(values.shape[0]):
        above = abs(values[i]) > limits[i]
        counts[i] = count = counts[i] + 1 if above else 0
        largest = max(largest, count)
    return largest
