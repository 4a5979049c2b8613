"""The parameters, memory and constants of ``SafetyMonitor``."""

from __future__ import annotations

import math

from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from .safety_faults import SafetyFault


class SafetyParams(Parameters):
    """The parameters of ``SafetyMonitor``."""

    tilt_limit: float = parameter(1.2, unit="rad", gt=0.0, le=math.pi, text="largest lean")
    tilt_hold: float = parameter(
        0.02, unit="s", ge=0.0, text="time for which the base may lean further"
    )
    limit_margin: float = parameter(
        0.05, unit="rad", ge=0.0, text="distance by which a joint may be beyond its limits"
    )
    speed_limit: PerJoint | None = parameter(
        None, unit="rad/s", gt=0.0, text="largest joint speed; none: twice what its motors reach"
    )
    joint_hold: float = parameter(
        0.02, unit="s", ge=0.0, text="time for which a joint may be further or faster"
    )
    torque_limit: PerJoint | None = parameter(
        None, unit="N m", gt=0.0,
        text="a joint torque beyond this is a mistake; none: ten times the motors' peak",
    )  # fmt: skip
    stuck_time: float = parameter(
        0.05, unit="s", ge=0.0,
        text="time for which a joint or an axis of the IMU may read the very same; zero: not judged",
    )  # fmt: skip
    torque_error: float = parameter(
        0.8, unit="", ge=0.0,
        text="share of its torque by which a joint may be off its command; zero: not judged",
    )  # fmt: skip
    unsolved_ticks: int = parameter(25, ge=0, text="ticks in a row without a solution")
    torque_hold: float = parameter(
        0.1, unit="s", ge=0.0, text="time for which a joint's torque may be off its command"
    )
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
        0.02, unit="s", ge=0.0, text="time for which voltage, temperature or current may be beyond"
    )
    answer_age: float = parameter(
        0.02, unit="s", gt=0.0, text="oldest answer of a drive that may be used"
    )
    imu_age: float = parameter(
        0.02, unit="s", gt=0.0, text="oldest packet of the sensor board that may be used"
    )
    invalid_hold: float = parameter(
        0.1, unit="s", ge=0.0,
        text="time for which joints, IMU or switches may be marked as not valid",
    )  # fmt: skip
    stamp_age: float = parameter(
        0.05, unit="s", gt=0.0, text="time for which the robot's time stamp may stay the same"
    )


class SafetyState(Signal):
    """The state of ``SafetyMonitor``."""

    fault = Field(
        dtype="int64",
        values=SafetyFault,
        text="reason why the robot is damped; the first one stays",
    )
    fault_tick = Field(dtype="int64", text="when")
    tilted = Field(dtype="int64", text="ticks in a row the base has leant too far")
    beyond = Field("n_joints", dtype="int64", text="ticks in a row each joint was out of limits")
    fast = Field("n_joints", dtype="int64", text="ticks in a row each joint was too fast")
    stuck_joints = Field("n_joints", dtype="int64", text="ticks in a row each joint read the same")
    stuck_imu = Field(6, dtype="int64", text="the same of the gyroscope's and accelerometer's axes")
    last_imu = Field(6, text="their readings in the last tick")
    expected = Field("n_joints", unit="N m", text="torques that the last command asks for")
    asked = Field("n_joints", unit="N m", text="their magnitudes, smoothed")
    missing = Field(
        "n_joints", unit="N m", text="measured torques less the commanded ones, smoothed"
    )
    off = Field("n_joints", dtype="int64", text="ticks in a row each torque was off its command")
    measures = Field(dtype="bool", text="the robot measures torques")
    unsolved = Field(dtype="int64", text="ticks in a row without a solution")
    last_position = Field("n_joints", unit="rad", text="joint angles of the last tick")
    last_velocity = Field("n_joints", unit="rad/s", text="joint velocities of the last tick")
    low = Field("n_joints", dtype="int64", text="ticks in a row each voltage was too low")
    hot = Field("n_joints", dtype="int64", text="ticks in a row each winding was too hot")
    strong = Field("n_joints", dtype="int64", text="ticks in a row each current was too large")
    invalid = Field(3, dtype="int64", text="ticks in a row joints, IMU, switches were not valid")
    stamps = Field(2, text="the last time stamp [s], and the ticks since it changed")
    motor_torque = Field("n_joints", unit="N m", text="measured torques of the motors")
    heat = Field("n_joints", unit="J", text="the windings' heat so far")
    fault_place = Field(dtype="int64", text="index of the motor or switch that was at fault")
    fault_value = Field(text="measured value, in the unit of its signal")


class SafetyConstants(Signal):
    """Limits and durations that follow from the parameters and the robot."""

    lower = Field("n_joints", unit="rad", text="least joint positions")
    upper = Field("n_joints", unit="rad", text="greatest joint positions")
    speed = Field("n_joints", unit="rad/s", text="greatest joint speeds")
    torque = Field("n_joints", unit="N m", text="greatest torques of a command")
    peak = Field("n_joints", unit="N m", text="the motors' peak torques at the joints")
    fading = Field(text="share of a smoothed torque that goes in a tick")
    imu_wired = Field(dtype="bool", text="there are readings of an IMU")
    torque_ticks = Field(dtype="int64", text="ticks for which a torque may be off its command")
    stuck_ticks = Field(dtype="int64", text="ticks for which a reading may stay; zero: not judged")
    damping = Field("n_joints", unit="N m s/rad", text="joint damping after a fault")
    lowest_voltage = Field(unit="V", text="zero: not judged")
    torque_to_motor = Field(("n_joints", "n_joints"), text="joint torques to those of the motors")
    largest_current = Field(unit="A", text="infinite: not judged")
    heating = Field(text="heat of a winding in a tick for its squared torque [J/(N m)^2]")
    tilt_ticks = Field(dtype="int64", text="ticks for which the base may lean too far")
    joint_ticks = Field(dtype="int64", text="ticks for which a joint may be beyond its limits")
    health_ticks = Field(dtype="int64", text="ticks for which a drive may be beyond a limit")
    invalid_ticks = Field(dtype="int64", text="ticks for which readings may be marked as not valid")
    stamp_ticks = Field(dtype="int64", text="ticks for which the time stamp may stay the same")
