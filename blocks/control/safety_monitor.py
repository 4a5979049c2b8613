"""The last block before the drives: passes the command on, or after a fault only damps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.linear_algebra import inverse, product
from ...runtime.language.block import Input, Metric, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import (
    BaseState,
    DrivePhase,
    JointCommand,
    JointState,
    RobotHealth,
    SwitchFault,
    SwitchHealth,
    WholeBodyCommand,
)
from ..signals.drive_conditions import HEALTHY
from .health_limits import UNSTAMPED, HealthParameters, health_of, health_text
from .safety_faults import SWITCH_TEXTS, TEXTS, Fault, is_of_hardware
from .safety_watch import Bounds, Command, RobotState, Switches, Timers, Verdict, watch

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


class SafetyMonitor(KernelBlock):
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
        self._peak = product(np.abs(matrix).T, motors.peak_torque)
        fastest = product(np.abs(inverse(matrix)), motors.no_load_speed)
        given = p.speed_limit, p.torque_limit
        self._speed_limit = 2.0 * fastest if given[0] is None else given[0].resolve(robot)
        torque_limit = 10.0 * self._peak if given[1] is None else given[1].resolve(robot)
        self._damping = np.zeros(n)
        self.on_parameters()
        bounds = Bounds(
            self._lower, self._upper, self._speed_limit, torque_limit, float(p.tilt_limit),
            round(p.tilt_hold / self.period), round(p.joint_hold / self.period), p.stale_ticks,
            p.unsolved_ticks,
        )  # fmt: skip
        base, joints, state = self.base, self.joints, self.state
        self._verdict = Verdict(np.zeros(2, np.int64), np.zeros(1))
        watching = KernelCall(
            watch, Command(*(getattr(self.desired, name) for name in Command._fields)),
            RobotState(
                base.position, base.orientation, base.linear_velocity, base.angular_velocity,
                joints.position, joints.velocity, self.wbc.solved,
            ),
            bounds, Timers(*(getattr(state, name) for name in Timers._fields)),
            health_of(p, self.period, self.health, state), Switches(*(
                getattr(self.switches, name) for name in Switches._fields
            )),
            self._damping, state.fault,
            Command(*(getattr(self.command, name) for name in Command._fields)), self._verdict,
        )  # fmt: skip
        self.kernel_calls = (watching,)
        self.event = self._verdict.fault[:1]

    def on_parameters(self) -> None:
        given = self.params.damping
        self._damping[:] = (
            self._peak / _DAMPED_SPEED if given is None else given.resolve(self.robot)
        )

    def on_event(self) -> None:
        state, verdict = self.state, self._verdict
        if state.fault[()] == Fault.NONE:
            fault = Fault(int(verdict.fault[0]))
            state.fault[()] = fault
            state.fault_tick[()] = self.tick
            state.fault_place[()] = verdict.fault[1]
            state.fault_value[()] = verdict.value[0]
            if is_of_hardware(fault):
                self.request_stop(self._reason(fault))

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
