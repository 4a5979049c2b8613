"""The last block before the drives: passes the command on, or after a fault only damps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array1D
from ...mathematics.joint_feedback import expected_torques
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import inverse, multiply_vector, product
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Clock, Input, Metric, Output, State
from ..signals import (
    BaseState,
    CommandMode,
    DrivePhase,
    ImuReading,
    JointCommand,
    JointState,
    RobotHealth,
    SwitchFault,
    SwitchHealth,
    WholeBodyCommand,
)
from ..signals.robot import HEALTHY, describe_conditions
from .safety_faults import SWITCH_TEXTS, TEXTS, SafetyFault, is_of_hardware
from .safety_state import SafetyConstants, SafetyParams, SafetyState

_DAMPED_SPEED = 20.0
"""Joint speed [rad/s] at which the default damping asks for the motors' peak torque."""
_SMOOTHING = 0.05
"""Time constant [s] with which commanded and measured torques are compared."""
_SLIGHT = 0.03
"""The share of a joint's peak torque that its torque may always be off."""
_CRITICAL = 0x7C
"""The bits of a drive's condition with which it has switched its torque off."""
_ANSWERED = 0x80
"""The bit that every condition has."""
UNSTAMPED = -1.0
"""The time stamp of a robot that does not report when it measured."""


class SafetyMonitor(Block):
    """Passes the joint command on until something is wrong, and from then on only damps.

    A fault lasts to the end of the run. The first fault is kept in the state and in the metrics
    ``safety_fault`` and ``safety_fault_time_s``. It is a fault when

    * the base leans more than ``tilt_limit`` for ``tilt_hold``;
    * a joint is more than ``limit_margin`` beyond its limits, or faster than its ``speed_limit``,
      for ``joint_hold``; a joint without limits is never beyond them;
    * a state or a command is not finite, or beyond 10 m/s, 100 rad/s or its ``torque_limit``;
    * the whole-body controller has not solved for ``unsolved_ticks`` ticks in a row;
    * while the drives are on, the robot's own report (``health``) is bad: a drive reports an error,
      its last answer is older than ``answer_age`` or the sensor board's packet than ``imu_age``; a
      voltage, temperature or current is beyond its limit for ``health_hold`` (under load the voltage may
      be lower, by ``pack_resistance``, but not below ``brown_out_voltage``); joints, IMU or
      switches are marked as not valid for ``invalid_hold``; the time stamp stays for ``stamp_age``;
    * while the drives are on, angle and speed of a joint, or an axis of the gyroscope or accelerometer where ``imu`` is wired,
      have not changed by a single bit for ``stuck_time``: a sensor that works has noise;
    * while the drives are on, the torque that a joint measures is off what its command asks for by more than ``torque_error`` of it
      and 3 % of its peak, both smoothed over 50 ms, for ``torque_hold``: a motor that spins freely, or does not obey;
    * a foot switch is at fault, and ``SwitchMonitor`` asks to stop.

    In damping the command is zero torque and stiffness, the measured angle, zero velocity and the
    gain ``damping``; all values are finite whatever the inputs are. Every tick is judged, also
    after a fault. Limits and damping are given by joint name or pattern; by default they follow
    from the robot's motors. A fault of the hardware ends the run, with the drive and the value that
    was measured as its reason. After any other fault the run goes on, damped: the score ends it, and
    without one it is no success. The block does not watch deadlines.
    """

    Params = SafetyParams
    Constants = SafetyConstants
    needs = ("robot",)
    params: SafetyParams
    constants: SafetyConstants

    desired = Input(JointCommand, text="the controller's command")
    base = Input(BaseState, text="the estimated base")
    joints = Input(JointState, text="the measured joints")
    wbc = Input(WholeBodyCommand, text="success of the controller's solution")
    imu = Input(ImuReading, default={}, text="the IMU's readings; not judged where it is not wired")
    health = Input(
        RobotHealth,
        default={
            "state": int(DrivePhase.DRIVING), "condition": HEALTHY, "stamp": UNSTAMPED,
            "joints_valid": True, "imu_valid": True, "contacts_valid": True,
        },
        text="condition of drives and sensors; not judged where it is not wired",
    )  # fmt: skip
    switches = Input(SwitchHealth, default={}, text="faults of the foot switches")
    command = Output(JointCommand, text="command to the drives")
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
        constants.peak[:] = peak
        constants.fading = min(1.0, period / _SMOOTHING)
        constants.imu_wired = "imu" in self.context.wired
        constants.torque_ticks = round(p.torque_hold / period)
        constants.stuck_ticks = round(p.stuck_time / period)
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
        imu: ImuReading,
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
        count_stuck(joints, imu, state)
        compare_torques(joints, state, constants, params.torque_error)
        place, value = 0, 0.0
        if health.state > DrivePhase.OFF and health.state < DrivePhase.DAMPED:
            found, drive = judge_health(health, joints, state, params, constants)
            if fault == SafetyFault.NONE:
                fault, place, value = found, drive, measured_value(health, found, drive)
            if fault == SafetyFault.NONE:
                fault, place = judge_readings(state, constants)
                value = state.missing[place] if fault == SafetyFault.TORQUE else 0.0
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
        expected_torques(
            command.torque, command.stiffness, command.damping, command.position, command.velocity,
            joints.position, joints.velocity, constants.peak, state.expected,
        )  # fmt: skip
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
            reason = f"{self.context.path}: {self._reason(fault)}"
            if is_of_hardware(fault):
                result["success"] = False
                result["reason"] = reason
            else:
                time = int(self.state.fault_tick) * period
                result["veto"] = f"{reason}; the robot was damped from {time:.6g} s on"
        return result

    def _reason(self, fault: SafetyFault) -> str:
        """Describe a fault in words."""
        if not is_of_hardware(fault):
            return TEXTS[fault]
        if fault == SafetyFault.SWITCH:
            point = self.robot.contacts[int(self.state.fault_place)].name
            return f"foot switch {point} {SWITCH_TEXTS[SwitchFault(int(self.state.fault_value))]}"
        if fault in (SafetyFault.STUCK_JOINT, SafetyFault.STUCK_IMU, SafetyFault.TORQUE):
            return self._reading_reason(fault)
        motor = self.robot.transmission.motors[int(self.state.fault_place)]
        return health_text(fault, motor, float(self.state.fault_value), self.params)

    def _reading_reason(self, fault: SafetyFault) -> str:
        """Describe a fault of readings in words, with its limit."""
        place, limit = int(self.state.fault_place), self.params
        if fault == SafetyFault.STUCK_IMU:
            sensor = f"{('gyroscope', 'accelerometer')[place // 3]}, axis {'xyz'[place % 3]},"
            return f"{sensor} has read the very same for {1e3 * limit.stuck_time:g} ms"
        joint = self.robot.joints[place].name
        if fault == SafetyFault.STUCK_JOINT:
            return f"joint {joint} has read the very same for {1e3 * limit.stuck_time:g} ms"
        return (
            f"joint {joint}: its torque is {float(self.state.fault_value):+.1f} N m off its command; torque_error "
            f"is {100.0 * limit.torque_error:g} %"
        )


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
    """Find the gravest fault of this tick in motion and computation; updates their timers."""
    if not is_plausible(desired, constants.torque):
        return SafetyFault.ABSURD_COMMAND
    if not is_possible(base, joints):
        return SafetyFault.ABSURD_STATE
    state.tilted = state.tilted + 1 if tilt(base.orientation) > params.tilt_limit else 0
    state.unsolved = 0 if wbc.solved else state.unsolved + 1
    beyond, fast = count_beyond(joints, state, constants)
    if state.tilted > constants.tilt_ticks:
        return SafetyFault.TILT
    if beyond > constants.joint_ticks:
        return SafetyFault.JOINT_LIMIT
    if fast > constants.joint_ticks:
        return SafetyFault.JOINT_SPEED
    if params.unsolved_ticks > 0 and state.unsolved >= params.unsolved_ticks:
        return SafetyFault.SOLVER
    return SafetyFault.NONE


@kernel
def is_plausible(command: JointCommand, torque: Array1D) -> bool:
    """Check whether a command is finite and within what drives can do, its torques within ``torque``."""
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
    """Check whether a state is finite and within what a robot can do."""
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
    """Check whether all values are finite and their magnitudes at most ``limit``."""
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


# What is measured, against itself and against the command


@kernel
def count_stuck(joints: JointState, imu: ImuReading, state: SafetyState) -> None:
    """Count the ticks since each joint, and each axis of the IMU, read something else."""
    for k in range(joints.position.shape[0]):
        same = (
            joints.position[k] == state.last_position[k]
            and joints.velocity[k] == state.last_velocity[k]
        )
        state.stuck_joints[k] = state.stuck_joints[k] + 1 if same else 0
    for k in range(6):
        reading = imu.angular_velocity[k] if k < 3 else imu.specific_force[k - 3]
        state.stuck_imu[k] = state.stuck_imu[k] + 1 if reading == state.last_imu[k] else 0
        state.last_imu[k] = reading
    state.last_position[:] = joints.position
    state.last_velocity[:] = joints.velocity


@kernel
def compare_torques(
    joints: JointState, state: SafetyState, constants: SafetyConstants, error: float
) -> None:
    """Count the ticks in a row in which each measured torque was off what the last command asks for."""
    for k in range(joints.torque.shape[0]):
        state.measures = state.measures or joints.torque[k] != 0.0
        off = joints.torque[k] - state.expected[k] - state.missing[k]
        state.missing[k] += constants.fading * off
        state.asked[k] += constants.fading * (abs(state.expected[k]) - state.asked[k])
        most = error * (state.asked[k] + _SLIGHT * constants.peak[k])
        beyond = error > 0.0 and state.measures and abs(state.missing[k]) > most
        state.off[k] = state.off[k] + 1 if beyond else 0


@kernel
def judge_readings(state: SafetyState, constants: SafetyConstants) -> tuple[int, int]:
    """Find the first reading that is stuck, or torque that is off, and its joint or axis."""
    if constants.stuck_ticks > 0:
        for k in range(state.stuck_joints.shape[0]):
            if state.stuck_joints[k] >= constants.stuck_ticks:
                return SafetyFault.STUCK_JOINT, k
        for k in range(6):
            if constants.imu_wired and state.stuck_imu[k] >= constants.stuck_ticks:
                return SafetyFault.STUCK_IMU, k
    for k in range(state.off.shape[0]):
        if state.off[k] > constants.torque_ticks:
            return SafetyFault.TORQUE, k
    return SafetyFault.NONE, 0


# What the robot reports of its hardware


@kernel
def judge_health(
    health: RobotHealth,
    joints: JointState,
    state: SafetyState,
    params: SafetyParams,
    constants: SafetyConstants,
) -> tuple[int, int]:
    """Find the gravest fault of the hardware, and the drive that has it; updates all counts."""
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
    """Return the drop [V] of the pack's voltage below that without load, from the work of the motors and the heat of
    their windings."""
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
    """Find the gravest fault of drive ``k``, whose voltage may be as low as ``lowest`` [V]; updates its counts. A
    voltage of zero was not measured."""
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
    """Find the gravest fault of the sensors; updates all counts."""
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
    """Return the measured value of a fault, in the unit of its signal."""
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
    """Find the first foot switch that is at fault; the last one if none is."""
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
    """Describe a fault of the hardware in words, with its limit and the measured value.

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
