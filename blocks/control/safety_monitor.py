"""The last block before the drives: passes the command on, or after a fault only damps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import live_parameter, parameter
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
from ..signals.drive_conditions import HEALTHY
from .health_limits import UNSTAMPED, HealthLimits, HealthParameters, health_text
from .safety_faults import SWITCH_TEXTS, TEXTS, Fault, is_of_hardware

Array = NDArray[np.float64]

_DAMPED_SPEED = 20.0
"""Joint speed [rad/s] at which the default damping asks for the motors' peak torque."""


class SafetyState(Signal):
    """The state of ``SafetyMonitor``."""

    fault = Field(
        dtype="int64", values=Fault, text="why the robot is damped; the first reason stays"
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
    fault_place = Field(
        dtype="int64", text="index of the motor, or of the switch, that was at fault"
    )
    fault_value = Field(text="what it measured, in the unit of its signal")


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
      voltage, temperature or current is beyond its limit for ``health_hold``; joints, IMU or
      switches are marked as not valid for ``invalid_hold``; the time stamp stays for ``stamp_age``;
    * a foot switch is at fault, and ``SwitchMonitor`` asks to stop.

    In damping the command is zero torque and stiffness, the measured angle, zero velocity and the
    gain ``damping``; all values are finite whatever the inputs are. Every tick is judged, also
    after a fault. Limits and damping are given by joint name or pattern; by default they follow
    from the robot's motors. A fault of the hardware ends the run, with the drive and the value that
    was measured as its reason. After any other fault the run goes on, damped: the score ends it. The
    block does not watch deadlines.
    """

    class Params(HealthParameters):
        tilt_limit: float = parameter(1.2, unit="rad", gt=0.0, le=math.pi, text="largest lean")
        tilt_hold: float = parameter(
            0.02, unit="s", ge=0.0, text="how long the base may lean further"
        )
        limit_margin: float = parameter(
            0.05, unit="rad", ge=0.0, text="how far a joint may be beyond its limits"
        )
        speed_limit: PerJoint | None = parameter(
            None,
            unit="rad/s",
            gt=0.0,
            text="largest joint speed; none: twice what its motors reach",
        )
        joint_hold: float = parameter(
            0.02, unit="s", ge=0.0, text="for how long a joint may be further or faster"
        )
        torque_limit: PerJoint | None = parameter(
            None,
            unit="N m",
            gt=0.0,
            text="a joint torque beyond this is a mistake; none: ten times the motors' peak",
        )
        stale_ticks: int = parameter(0, ge=0, text="equal joint readings in a row; zero: any")
        unsolved_ticks: int = parameter(25, ge=0, text="ticks in a row without a solution")
        damping: PerJoint | None = live_parameter(
            None,
            unit="N m s/rad",
            ge=0.0,
            text="joint damping after a fault; none: the motors' peak torque at 20 rad/s",
        )

    needs = ("robot",)
    params: Params

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

    def setup(self) -> None:
        robot, p = self.robot, self.params
        n = len(robot.joints)
        self._lower = robot.joint_limits[:, 0] - p.limit_margin
        self._upper = robot.joint_limits[:, 1] + p.limit_margin
        motors, matrix = robot.motors, robot.joint_to_motor
        self._peak = np.abs(matrix).T @ motors.peak_torque
        fastest = np.abs(np.linalg.inv(matrix)) @ motors.no_load_speed
        given = p.speed_limit, p.torque_limit
        self._speed_limit = 2.0 * fastest if given[0] is None else given[0].resolve(robot)
        torque_limit = 10.0 * self._peak if given[1] is None else given[1].resolve(robot)
        self._damping = np.zeros(n)
        self.on_parameters()
        self._tilt_ticks = round(self.params.tilt_hold / self.period)
        self._joint_ticks = round(self.params.joint_hold / self.period)
        state = self.state
        self._health = HealthLimits(
            p, self.period, self.health, state.low, state.hot, state.strong, state.invalid, state.stamps
        )  # fmt: skip
        self._commands = (
            (self.desired.torque, torque_limit),
            (self.desired.position, np.full(n, 100.0)),
            (self.desired.velocity, np.full(n, 1000.0)),
            (self.desired.stiffness, np.full(n, 10000.0)),
            (self.desired.damping, np.full(n, 1000.0)),
        )

    def on_parameters(self) -> None:
        given = self.params.damping
        self._damping[:] = (
            self._peak / _DAMPED_SPEED if given is None else given.resolve(self.robot)
        )

    def step(self) -> None:
        fault = self._judge()
        state, desired, command = self.state, self.desired, self.command
        place, value = 0, 0.0
        if DrivePhase.OFF < self.health.state[()] < DrivePhase.DAMPED:
            of_health, place, value = self._health.judge()
            fault = fault or of_health
        if fault == Fault.NONE and self.switches.stop[()]:
            fault, place = Fault.SWITCH, int((self.switches.fault != SwitchFault.NONE).argmax())
            value = float(self.switches.fault[place])
        if fault != Fault.NONE and state.fault[()] == Fault.NONE:
            state.fault[()] = fault
            state.fault_tick[()] = self.tick
            state.fault_place[()] = place
            state.fault_value[()] = value
            if is_of_hardware(fault):
                self.request_stop(self._reason(fault))
        if state.fault[()] == Fault.NONE:
            command.mode[()] = desired.mode
            command.torque[...] = desired.torque
            command.position[...] = desired.position
            command.velocity[...] = desired.velocity
            command.stiffness[...] = desired.stiffness
            command.damping[...] = desired.damping
            return
        command.mode[()] = CommandMode.DAMPING
        command.torque.fill(0.0)
        command.velocity.fill(0.0)
        command.stiffness.fill(0.0)
        command.damping[...] = self._damping
        for joint in range(command.position.shape[0]):
            angle = float(self.joints.position[joint])
            command.position[joint] = angle if math.isfinite(angle) else 0.0

    def metrics(self) -> Mapping[str, Metric]:
        fault = Fault(int(self.state.fault[()]))
        result: dict[str, Metric] = {"safety_fault": fault.name.lower()}
        if fault != Fault.NONE:
            period = self.context.clock.base_period
            result["safety_fault_time_s"] = int(self.state.fault_tick[()]) * period
            result["safety_reason"] = self._reason(fault)
            if is_of_hardware(fault):
                result["success"] = False
                result["reason"] = f"{self.context.path}: {self._reason(fault)}"
        return result

    def _reason(self, fault: Fault) -> str:
        """A fault in words."""
        if not is_of_hardware(fault):
            return TEXTS[fault]
        if fault == Fault.SWITCH:
            point = self.robot.contacts[int(self.state.fault_place)].name
            return f"foot switch {point} {SWITCH_TEXTS[SwitchFault(int(self.state.fault_value))]}"
        motor = self.robot.transmission.motors[int(self.state.fault_place)]
        return health_text(fault, motor, float(self.state.fault_value), self.params)

    def _judge(self) -> Fault:
        """The gravest fault of this tick; all timers are updated."""
        state, params, joints, base = self.state, self.params, self.joints, self.base
        for values, limits in self._commands:
            if not within_each(values, limits):
                return Fault.ABSURD_COMMAND
        plausible = (
            within(joints.position, 100.0)
            and within(joints.velocity, 1000.0)
            and within(base.orientation, 2.0)
            and within(base.linear_velocity, 10.0)
            and within(base.angular_velocity, 100.0)
            and within(base.position, 1e6)
        )
        if not plausible:
            return Fault.ABSURD_STATE

        leans = tilt(base.orientation) > params.tilt_limit
        state.tilted[()] = int(state.tilted[()]) + 1 if leans else 0
        beyond = count_beyond(joints.position, self._lower, self._upper, state.beyond)
        fast = count_faster(joints.velocity, self._speed_limit, state.fast)
        changed = not state.started[()]
        for joint in range(joints.position.shape[0]):
            position, velocity = joints.position[joint], joints.velocity[joint]
            changed = changed or bool(
                position != state.last_position[joint] or velocity != state.last_velocity[joint]
            )
            state.last_position[joint] = position
            state.last_velocity[joint] = velocity
        state.started[()] = True
        state.stale[()] = 0 if changed else int(state.stale[()]) + 1
        state.unsolved[()] = 0 if self.wbc.solved[()] else int(state.unsolved[()]) + 1

        if state.tilted[()] > self._tilt_ticks:
            return Fault.TILT
        if beyond > self._joint_ticks:
            return Fault.JOINT_LIMIT
        if fast > self._joint_ticks:
            return Fault.JOINT_SPEED
        if 0 < params.stale_ticks <= int(state.stale[()]):
            return Fault.STALE_SENSORS
        if 0 < params.unsolved_ticks <= int(state.unsolved[()]):
            return Fault.SOLVER
        return Fault.NONE


@kernel
def within(values: Array, limit: float) -> bool:
    """Whether all values are finite and their magnitudes at most ``limit``."""
    inside = True
    for i in range(values.shape[0]):
        inside = inside and abs(float(values[i])) <= limit
    return inside


@kernel
def within_each(values: Array, limits: Array) -> bool:
    """Whether every value is finite and its magnitude at most its limit."""
    inside = True
    for i in range(values.shape[0]):
        inside = inside and abs(float(values[i])) <= float(limits[i])
    return inside


@kernel
def count_beyond(values: Array, lower: Array, upper: Array, counts: NDArray[np.int64]) -> int:
    """Count how many times in a row each value was out of bounds; returns the largest count."""
    largest = 0
    for i in range(values.shape[0]):
        out = not float(lower[i]) <= float(values[i]) <= float(upper[i])
        counts[i] = count = int(counts[i]) + 1 if out else 0
        largest = max(largest, count)
    return largest


@kernel
def count_faster(values: Array, limits: Array, counts: NDArray[np.int64]) -> int:
    """Count how many times in a row each value's magnitude was above its limit.

    Returns the largest count.
    """
    largest = 0
    for i in range(values.shape[0]):
        above = abs(float(values[i])) > float(limits[i])
        counts[i] = count = int(counts[i]) + 1 if above else 0
        largest = max(largest, count)
    return largest
