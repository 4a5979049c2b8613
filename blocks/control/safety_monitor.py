"""The last block before the drives: passes the command on, or after a fault only damps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array1D
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import inverse, multiply_vector, product
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Clock, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import (
    BaseState,
    CommandMode,
    DrivePhase,
    JointCommand,
    JointState,
    RobotHealth,
    SwitchFault,
    SwitchHealth,
    WholeBodyCommand,
)
from ..signals.robot import HEALTHY, describe_conditions
from .safety_faults import SWITCH_TEXTS, TEXTS, SafetyFault, is_of_hardware

_DAMPED_SPEED = 20.0
"""Joint speed [rad/s] at which the default damping asks for the motors' peak torque."""
_CRITICAL = 0x7C
"""The bits of a drive's condition with which it has switched its torque off."""
_ANSWERED = 0x80
"""The bit that every condition has."""
UNSTAMPED = -1.0
"""The time stamp of a robot that does not report when it measured."""


class SafetyParams(Parameters):
    """The parameters of ``SafetyMonitor``."""

    tilt_limit: float = parameter(1.2, unit="rad", gt=0.0, le=math.pi, text="largest lean")
    tilt_hold: float = parameter(0.02, unit="s", ge=0.0, text="how long the base may lean further")
    limit_margin: float = parameter(
        0.05, unit="rad", ge=0.0, text="how far a joint may be beyond its limits"
    )
    speed_limit: PerJoint | None = parameter(
        None, unit="rad/s", gt=0.0, text="largest joint speed; none: twice what its motors reach"
    )
    joint_hold: float = parameter(
        0.02, unit="s", ge=0.0, text="for how long a joint may be further or faster"
    )
    torque_limit: PerJoint | None = parameter(
        None, unit="N m", gt=0.0,
        text="a joint torque beyond this is a mistake; none: ten times the motors' peak",
    )  # fmt: skip
    stale_ticks: int = parameter(0, ge=0, text="equal joint readings in a row; zero: any")
    unsolved_ticks: int = parameter(25, ge=0, text="ticks in a row without a solution")
    damping: PerJoint | None = live_parameter(
        None, unit="N m s/rad", ge=0.0,
        text="joint damping after a fault; none: the motors' peak torque at 20 rad/s",
    )  # fmt: skip
    lowest_voltage: float | None = parameter(
        None, unit="V", gt=0.0, text="lowest voltage of the pack without load; none: not judged"
    )
    brown_out_voltage: float = parameter(
        0.0, unit="V", ge=0.0, text="lowest voltage of a drive under any load"
    )
    pack_resistance: float = parameter(
        0.0,
        unit="ohm",
        ge=0.0,
        text="of the pack and its leads: under load the voltage may be lower",
    )
    winding_resistance: float = parameter(0.2, unit="ohm", ge=0.0, text="of a motor, for its load")
    torque_constant: float = parameter(0.35, unit="N m/A", gt=0.0, text="of a motor, for its load")
    highest_temperature: float = parameter(
        80.0, gt=0.0, le=200.0, text="highest temperature of a winding [deg C]"
    )
    largest_current: float | None = parameter(
        None, unit="A", gt=0.0, text="largest measured current of a drive; none: not judged"
    )
    health_hold: float = parameter(
        0.02, unit="s", ge=0.0, text="how long voltage, temperature or current may be beyond"
    )
    answer_age: float = parameter(
        0.02, unit="s", gt=0.0, text="oldest answer of a drive that may be used"
    )
    imu_age: float = parameter(
        0.02, unit="s", gt=0.0, text="oldest packet of the sensor board that may be used"
    )
    invalid_hold: float = parameter(
        0.1, unit="s", ge=0.0,
        text="how long joints, IMU or switches may be marked as not valid",
    )  # fmt: skip
    stamp_age: float = parameter(
        0.05, unit="s", gt=0.0, text="how long the robot's time stamp may stay the same"
    )


class SafetyState(Signal):
    """The state of ``SafetyMonitor``."""

    fault = Field(
        dtype="int64", values=SafetyFault, text="why the robot is damped; the first reason stays"
    )
    fault_tick = Field(dtype="int64", text="when")
    tilted = Field(dtype="int64", text="ticks in a row the base has leant too far")
    beyond = Field("n_joints", dtype="int64", text="ticks in a row each joint was out of limits")
    fast = Field("n_joints", dtype="int64", text="ticks in a row each joint was too fast")
    stale = Field(dtype="int64", text="ticks in a row without a changed joint reading")
    unsolved = Field(dtype="int64", text="ticks in a row without a solution")
    last_position = Field("n_joints", unit="rad", text="joint angles of the last tick")
    last_velocity = Field("n_joints", unit="rad/s", text="joint velocities of the last tick")
    started = Field(dtype="bool", text="whether there was a last tick")
    low = Field("n_joints", dtype="int64", text="ticks in a row each voltage was too low")
    hot = Field("n_joints", dtype="int64", text="ticks in a row each winding was too hot")
    strong = Field("n_joints", dtype="int64", text="ticks in a row each current was too large")
    invalid = Field(3, dtype="int64", text="ticks in a row joints, IMU, switches were not valid")
    stamps = Field(2, text="the last time stamp [s], and the ticks since it changed")
    motor_torque = Field("n_joints", unit="N m", text="measured torques of the motors")
    heat = Field("n_joints", unit="J", text="the windings' heat so far")
    fault_place = Field(dtype="int64", text="index of the motor or switch that was at fault")
    fault_value = Field(text="what it measured, in the unit of its signal")


class SafetyConstants(Signal):
    """Limits and durations that follow from the parameters and the robot."""

    lower = Field("n_joints", unit="rad", text="least joint positions")
    upper = Field("n_joints", unit="rad", text="greatest joint positions")
    speed = Field("n_joints", unit="rad/s", text="greatest joint speeds")
    torque = Field("n_joints", unit="N m", text="greatest torques of a command")
    damping = Field("n_joints", unit="N m s/rad", text="joint damping after a fault")
    lowest_voltage = Field(unit="V", text="zero: not judged")
    torque_to_motor = Field(("n_joints", "n_joints"), text="joint torques to those of the motors")
    largest_current = Field(unit="A", text="infinite: not judged")
    heating = Field(text="heat of a winding in a tick for its squared torque [J/(N m)^2]")
    tilt_ticks = Field(dtype="int64", text="how many ticks the base may lean too far")
    joint_ticks = Field(dtype="int64", text="how many a joint may be beyond its limits")
    health_ticks = Field(dtype="int64", text="how many a drive may be beyond a limit")
    invalid_ticks = Field(dtype="int64", text="how many readings may be marked as not valid")
    stamp_ticks = Field(dtype="int64", text="how many the time stamp may stay the same")


class SafetyMonitor(Block):
    """Passes the joint command on until something is wrong, and from then on only damps.

    A fault lasts to the end of the run. The first fault is kept in the state and in the metrics
    ``safety_fault`` and ``safety_fault_time_s``. It is a fault when

    * the base leans more than ``tilt_limit`` for ``tilt_hold``;
    * a joint is more than ``limit_margin`` beyond its limits, or faster than its ``speed_limit``,
      for ``joint_hold``; a joint without limits is never beyond them;
    * joint readings have not changed by a single bit for ``stale_ticks`` ticks (zero: never;
      a simulator without noise may stand that still);
    * a state or a command is not finite, or beyond 10 m/s, 100 rad/s or its ``torque_limit``;
    * the whole-body controller has not solved for ``unsolved_ticks`` ticks in a row;
    * while the drives are on, the robot's own report (``health``) is bad: a drive reports an error,
      its last answer is older than ``answer_age`` or the sensor board's packet than ``imu_age``; a
      voltage, temperature or current is beyond its limit for ``health_hold`` (under load the voltage may
      be lower, by ``pack_resistance``, but not below ``brown_out_voltage``); joints, IMU or
      switches are marked as not valid for ``invalid_hold``; the time stamp stays for ``stamp_age``;
    * a foot switch is at fault, and ``SwitchMonitor`` asks to stop.

    In damping the command is zero torque and stiffness, the measured angle, zero velocity and the
    gain ``damping``; all values are finite whatever the inputs are. Every tick is judged, also
    after a fault. Limits and damping are given by joint name or pattern; by default they follow
    from the robot's motors. A fault of the hardware ends the run, with the drive and the value that
    was measured as its reason. After any other fault the run goes on, damped: the score ends it. The
    block does not watch deadlines.
    """

    Params = SafetyParams
    Constants = SafetyConstants
    needs = ("robot",)
    params: SafetyParams
    constants: SafetyConstants

    desired = Input(JointCommand, text="the controller's command")
    base = Input(BaseState, text="the estimated base")
    joints = Input(JointState, text="the measured joints")
    wbc = Input(WholeBodyCommand, text="whether the controller has solved")
    health = Input(
        RobotHealth,
        default={
            "state": int(DrivePhase.DRIVING), "condition": HEALTHY, "stamp": UNSTAMPED,
            "joints_valid": True, "imu_valid": True, "contacts_valid": True,
        },
        text="how drives and sensors are; not judged where it is not wired",
    )  # fmt: skip
    switches = Input(SwitchHealth, default={}, text="which foot switches are at fault")
    command = Output(JointCommand, text="what the drives get")
    state = State(SafetyState, text="timers and the fault")

    def prepare(self) -> None:
        p, robot, constants, period = self.params, self.robot, self.constants, self.period
        motors, matrix = robot.motors, robot.joint_to_motor
        peak = product(np.abs(matrix).T, motors.peak_torque)
        fastest = product(np.abs(inverse(matrix)), motors.no_load_speed)
        given = p.speed_limit, p.torque_limit, p.damping
        constants.lower[:] = robot.joint_limits[:, 0] - p.limit_margin
        constants.upper[:] = robot.joint_limits[:, 1] + p.limit_margin
        constants.speed[:] = 2.0 * fastest if given[0] is None else given[0].resolve(robot)
        constants.torque[:] = 10.0 * peak if given[1] is None else given[1].resolve(robot)
        constants.damping[:] = peak / _DAMPED_SPEED if given[2] is None else given[2].resolve(robot)
        constants.lowest_voltage = p.lowest_voltage or 0.0
        constants.torque_to_motor[:] = robot.torque_to_motor
        constants.heating = p.winding_resistance / p.torque_constant**2 * period
        constants.largest_current = p.largest_current or np.inf
        constants.tilt_ticks = round(p.tilt_hold / period)
        constants.joint_ticks = round(p.joint_hold / period)
        constants.health_ticks = round(p.health_hold / period)
        constants.invalid_ticks = round(p.invalid_hold / period)
        constants.stamp_ticks = max(1, round(p.stamp_age / period))

    @kernel
    @staticmethod
    def step(
        desired: JointCommand,
        base: BaseState,
        joints: JointState,
        wbc: WholeBodyCommand,
        health: RobotHealth,
        switches: SwitchHealth,
        command: JointCommand,
        state: SafetyState,
        params: SafetyParams,
        constants: SafetyConstants,
        clock: Clock,
    ) -> bool:
        fault = judge_motion(desired, base, joints, wbc, state, params, constants)
        heat_windings(joints, state, constants)
        place, value = 0, 0.0
        if health.state > DrivePhase.OFF and health.state < DrivePhase.DAMPED:
            found, drive = judge_health(health, joints, state, params, constants)
            if fault == SafetyFault.NONE:
                fault, place, value = found, drive, measured_value(health, found, drive)
        if fault == SafetyFault.NONE and switches.stop:
            fault, place = SafetyFault.SWITCH, first_bad_switch(switches)
            value = float(switches.fault[place])
        begins = fault != SafetyFault.NONE and state.fault == SafetyFault.NONE
        if begins:
            state.fault = fault
            state.fault_tick = clock.tick
            state.fault_place = place
            state.fault_value = value
        if state.fault == SafetyFault.NONE:
            pass_on(desired, command)
        else:
            damp(joints.position, constants.damping, command)
        return begins

    def on_event(self) -> None:
        fault = SafetyFault(int(self.state.fault))  # begins in this tick
        if is_of_hardware(fault):
            self.request_stop(self._reason(fault))

    def metrics(self) -> Mapping[str, Metric]:
        fault = SafetyFault(int(self.state.fault))
        result: dict[str, Metric] = {"safety_fault": fault.name.lower()}
        hottest = int(np.argmax(self.state.heat))
        if self.state.heat[hottest] > 0.0:
            result["most_heated_winding"] = self.robot.transmission.motors[hottest]
            result["winding_heat_j"] = float(self.state.heat[hottest])
        if fault != SafetyFault.NONE:
            period = self.context.clock.base_period
            result["safety_fault_time_s"] = int(self.state.fault_tick) * period
            result["safety_reason"] = self._reason(fault)
            if is_of_hardware(fault):
                result["success"] = False
                result["reason"] = f"{self.context.path}: {self._reason(fault)}"
        return result

    def _reason(self, fault: SafetyFault) -> str:
        """A fault in words."""
        if not is_of_hardware(fault):
            return TEXTS[fault]
        if fault == SafetyFault.SWITCH:
            point = self.robot.contacts[int(self.state.fault_place)].name
            return f"foot switch {point} {SWITCH_TEXTS[SwitchFault(int(self.state.fault_value))]}"
        motor = self.robot.transmission.motors[int(self.state.fault_place)]
        return health_text(fault, motor, float(self.state.fault_value), self.params)


# Motion and computation


@kernel
def judge_motion(
    desired: JointCommand,
    base: BaseState,
    joints: JointState,
    wbc: WholeBodyCommand,
    state: SafetyState,
    params: SafetyParams,
    constants: SafetyConstants,
) -> int:
    """The gravest fault of this tick in motion and computation; updates their timers."""
    if not is_plausible(desired, constants.torque):
        return SafetyFault.ABSURD_COMMAND
    if not is_possible(base, joints):
        return SafetyFault.ABSURD_STATE
    state.tilted = state.tilted + 1 if tilt(base.orientation) > params.tilt_limit else 0
    state.unsolved = 0 if wbc.solved else state.unsolved + 1
    beyond, fast = count_beyond(joints, state, constants)
    count_unchanged(joints, state)
    if state.tilted > constants.tilt_ticks:
        return SafetyFault.TILT
    if beyond > constants.joint_ticks:
        return SafetyFault.JOINT_LIMIT
    if fast > constants.joint_ticks:
        return SafetyFault.JOINT_SPEED
    if params.stale_ticks > 0 and state.stale >= params.stale_ticks:
        return SafetyFault.STALE_SENSORS
    if params.unsolved_ticks > 0 and state.unsolved >= params.unsolved_ticks:
        return SafetyFault.SOLVER
    return SafetyFault.NONE


@kernel
def is_plausible(command: JointCommand, torque: Array1D) -> bool:
    """Whether a command is finite and within what drives can do, its torques within ``torque``."""
    for joint in range(torque.shape[0]):
        if not abs(command.torque[joint]) <= torque[joint]:
            return False
    return (
        within(command.position, 100.0)
        and within(command.velocity, 1000.0)
        and within(command.stiffness, 10000.0)
        and within(command.damping, 1000.0)
    )


@kernel
def is_possible(base: BaseState, joints: JointState) -> bool:
    """Whether a state is finite and within what a robot can do."""
    return (
        within(joints.position, 100.0)
        and within(joints.velocity, 1000.0)
        and within(base.orientation, 2.0)
        and within(base.linear_velocity, 10.0)
        and within(base.angular_velocity, 100.0)
        and within(base.position, 1e6)
    )


@kernel
def within(values: Array1D, limit: float) -> bool:
    """Whether all values are finite and their magnitudes at most ``limit``."""
    inside = True
    for i in range(values.shape[0]):
        inside = inside and abs(values[i]) <= limit
    return inside


@kernel
def count_beyond(
    joints: JointState, state: SafetyState, constants: SafetyConstants
) -> tuple[int, int]:
    """Count the ticks in a row each joint was out of its limits, or too fast; returns the largest counts."""
    beyond, fast = 0, 0
    for k in range(joints.position.shape[0]):
        outside = not constants.lower[k] <= joints.position[k] <= constants.upper[k]
        above = abs(joints.velocity[k]) > constants.speed[k]
        state.beyond[k] = state.beyond[k] + 1 if outside else 0
        state.fast[k] = state.fast[k] + 1 if above else 0
        beyond, fast = max(beyond, state.beyond[k]), max(fast, state.fast[k])
    return beyond, fast


@kernel
def count_unchanged(joints: JointState, state: SafetyState) -> None:
    """Count the ticks since a joint reading changed."""
    changed = not state.started
    for joint in range(joints.position.shape[0]):
        if joints.position[joint] != state.last_position[joint]:
            changed = True
        if joints.velocity[joint] != state.last_velocity[joint]:
            changed = True
    state.last_position[:] = joints.position
    state.last_velocity[:] = joints.velocity
    state.started = True
    state.stale = 0 if changed else state.stale + 1


# What the robot reports of its hardware


@kernel
def judge_health(
    health: RobotHealth,
    joints: JointState,
    state: SafetyState,
    params: SafetyParams,
    constants: SafetyConstants,
) -> tuple[int, int]:
    """The gravest fault of the hardware, and the drive that has it; updates all counts."""
    fault, place = 0, 0
    lowest = constants.lowest_voltage
    if params.pack_resistance > 0.0:
        lowest -= sag_under_load(health, joints, state, params, constants)
    lowest = max(lowest, params.brown_out_voltage)
    for k in range(health.condition.shape[0]):
        found = judge_drive(health, state, params, constants, lowest, k)
        if found != 0 and (fault == 0 or found < fault):
            fault, place = found, k
    found = judge_sensors(health, state, params, constants)
    if fault == 0:
        fault = found
    return fault, place


@kernel
def heat_windings(joints: JointState, state: SafetyState, constants: SafetyConstants) -> None:
    """Add the copper heat of this tick to every winding's."""
    multiply_vector(constants.torque_to_motor, joints.torque, state.motor_torque)
    for k in range(state.heat.shape[0]):
        torque = state.motor_torque[k]
        state.heat[k] += constants.heating * torque * torque


@kernel
def sag_under_load(
    health: RobotHealth,
    joints: JointState,
    state: SafetyState,
    params: SafetyParams,
    constants: SafetyConstants,
) -> float:
    """By how much [V] the pack's voltage is below that without load, from the work of the motors and
    the heat of their windings."""
    count = health.voltage.shape[0]
    power, total = 0.0, 0.0
    for k in range(count):
        current = state.motor_torque[k] / params.torque_constant
        power += joints.torque[k] * joints.velocity[k]
        power += params.winding_resistance * current * current
        total += health.voltage[k]
    if not (power > 0.0 and total > 0.0):
        return 0.0
    return float(params.pack_resistance * power * count / total)


@kernel
def judge_drive(
    health: RobotHealth,
    state: SafetyState,
    params: SafetyParams,
    constants: SafetyConstants,
    lowest: float,
    k: int,
) -> int:
    """The gravest fault of drive ``k``, whose voltage may be as low as ``lowest`` [V]; updates its counts.
    A voltage of zero was not measured."""
    condition, voltage = health.condition[k], health.voltage[k]
    low = 0.0 < voltage < lowest
    hot = not health.temperature[k] <= params.highest_temperature
    strong = not abs(health.current[k]) <= constants.largest_current
    state.low[k] = state.low[k] + 1 if low else 0
    state.hot[k] = state.hot[k] + 1 if hot else 0
    state.strong[k] = state.strong[k] + 1 if strong else 0
    if condition & _CRITICAL != 0 or condition & _ANSWERED == 0:
        return SafetyFault.DRIVE
    if not health.age[k] <= params.answer_age:
        return SafetyFault.SILENT_DRIVE
    if state.low[k] > constants.health_ticks:
        return SafetyFault.VOLTAGE
    if state.hot[k] > constants.health_ticks:
        return SafetyFault.TEMPERATURE
    if state.strong[k] > constants.health_ticks:
        return SafetyFault.CURRENT
    return SafetyFault.NONE


@kernel
def judge_sensors(
    health: RobotHealth, state: SafetyState, params: SafetyParams, constants: SafetyConstants
) -> int:
    """The gravest fault of the sensors; updates all counts."""
    invalid, stamps, stamp = state.invalid, state.stamps, health.stamp
    invalid[0] = 0 if health.joints_valid else invalid[0] + 1
    invalid[1] = 0 if health.imu_valid else invalid[1] + 1
    invalid[2] = 0 if health.contacts_valid else invalid[2] + 1
    same = stamp >= 0.0 and stamp == stamps[0]
    stamps[1] = stamps[1] + 1.0 if same else 0.0
    stamps[0] = stamp
    if not health.imu_age <= params.imu_age:
        return SafetyFault.SILENT_IMU
    for k in range(3):
        if invalid[k] > constants.invalid_ticks:
            return SafetyFault.INVALID_JOINTS + k
    if stamps[1] > constants.stamp_ticks:
        return SafetyFault.STALE_HEALTH
    return SafetyFault.NONE


@kernel
def measured_value(health: RobotHealth, fault: int, place: int) -> float:
    """The measured value of a fault, in the unit of its signal."""
    if fault == SafetyFault.DRIVE:
        return float(health.condition[place])
    if fault == SafetyFault.SILENT_DRIVE:
        return float(health.age[place])
    if fault == SafetyFault.VOLTAGE:
        return float(health.voltage[place])
    if fault == SafetyFault.TEMPERATURE:
        return float(health.temperature[place])
    if fault == SafetyFault.CURRENT:
        return float(health.current[place])
    if fault == SafetyFault.SILENT_IMU:
        return float(health.imu_age)
    return 0.0


@kernel
def first_bad_switch(switches: SwitchHealth) -> int:
    """The first foot switch that is at fault; the last one if none is."""
    place, fault = 0, switches.fault
    while place < fault.shape[0] - 1 and (fault[place] == 0 or fault[place] == SwitchFault.HEAVY):
        place += 1
    return place


# What the drives get


@kernel
def pass_on(desired: JointCommand, command: JointCommand) -> None:
    """Pass the command on."""
    command.mode = desired.mode
    command.torque[:] = desired.torque
    command.position[:] = desired.position
    command.velocity[:] = desired.velocity
    command.stiffness[:] = desired.stiffness
    command.damping[:] = desired.damping


@kernel
def damp(position: Array1D, damping: Array1D, command: JointCommand) -> None:
    """Command damping where the joints are; all values are finite."""
    command.mode = CommandMode.DAMPING
    command.torque[:] = 0.0
    command.velocity[:] = 0.0
    command.stiffness[:] = 0.0
    command.damping[:] = damping
    for joint in range(position.shape[0]):
        angle = position[joint]
        command.position[joint] = angle if math.isfinite(angle) else 0.0


# Reasons in words


def health_text(fault: SafetyFault, motor: str, value: float, params: SafetyParams) -> str:
    """A fault of the hardware in words, with its limit and the measured value.

    Args:
        motor: the motor of the drive that is at fault.
        value: the measured value, in the unit of its signal.
    """
    match fault:
        case SafetyFault.DRIVE:
            return f"drive {motor}: {describe_conditions(int(value))}"
        case SafetyFault.SILENT_DRIVE:
            return (
                f"drive {motor} has not answered for {1e3 * value:.0f} ms; answer_age is "
                f"{1e3 * params.answer_age:g} ms"
            )
        case SafetyFault.VOLTAGE:
            if value < params.brown_out_voltage:
                limit = f"brown_out_voltage, {params.brown_out_voltage:g} V"
            elif params.pack_resistance > 0.0:
                limit = f"lowest_voltage, {params.lowest_voltage:g} V without load"
            else:
                limit = f"lowest_voltage, {params.lowest_voltage:g} V"
            return f"drive {motor}: {value:.1f} V is below {limit}"
        case SafetyFault.TEMPERATURE:
            return (
                f"drive {motor}: its winding has {value:.0f} deg C; highest_temperature is "
                f"{params.highest_temperature:g}"
            )
        case SafetyFault.CURRENT:
            return f"drive {motor}: {value:.1f} A; largest_current is {params.largest_current:g} A"
        case SafetyFault.SILENT_IMU:
            return (
                f"the sensor board has sent nothing for {1e3 * value:.0f} ms; imu_age is "
                f"{1e3 * params.imu_age:g} ms"
            )
        case SafetyFault.STALE_HEALTH:
            return f"the robot has measured nothing new for {1e3 * params.stamp_age:g} ms"
    sensor = {
        SafetyFault.INVALID_JOINTS: "joint",
        SafetyFault.INVALID_IMU: "IMU's",
        SafetyFault.INVALID_CONTACTS: "foot switches'",
    }[fault]
    return f"the {sensor} readings were marked as not valid for more than {1e3 * params.invalid_hold:g} ms"
