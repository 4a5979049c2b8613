"""Judges what the drives and sensors report of themselves against limits."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Flags0D,
    Indices0D,
    Indices1D,
)
from ...mathematics.kernel import kernel
from ...runtime.language.parameters import Parameters, parameter
from ..signals import RobotHealth
from ..signals.drive_conditions import describe
from .safety_faults import Fault

_CRITICAL = 0x7C
"""The bits of a drive's condition with which it has switched its torque off."""
_ANSWERED = 0x80
"""The bit that every condition has."""
# What a compiled kernel can return.
_DRIVE, _SILENT_DRIVE = int(Fault.DRIVE), int(Fault.SILENT_DRIVE)
_VOLTAGE, _TEMPERATURE, _CURRENT = int(Fault.VOLTAGE), int(Fault.TEMPERATURE), int(Fault.CURRENT)
_SILENT_IMU, _STALE_HEALTH = int(Fault.SILENT_IMU), int(Fault.STALE_HEALTH)
_INVALID_JOINTS = int(Fault.INVALID_JOINTS)
"""The first of three: joints, IMU, switches."""
UNSTAMPED = -1.0
"""The stamp of a robot that does not say when it measured."""


class HealthParameters(Parameters):
    """How a robot's hardware may be before it is put into damping."""

    lowest_voltage: float | None = parameter(
        None, unit="V", gt=0.0, text="lowest supply voltage of a drive; none: not judged"
    )
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


class Limits(NamedTuple):
    """The limits as numbers, infinite where there is none, and times as numbers of ticks."""

    lowest_voltage: float
    highest_temperature: float
    largest_current: float
    answer_age: float
    imu_age: float
    hold: int
    invalid_hold: int
    stamp_hold: int


class Drives(NamedTuple):
    """What the drives report, and for how many ticks in a row it was beyond a limit."""

    condition: Indices1D
    age: Array1D
    voltage: Array1D
    temperature: Array1D
    current: Array1D
    low: Indices1D
    hot: Indices1D
    strong: Indices1D


class Sensors(NamedTuple):
    """What is reported of the sensors, and what is kept of it from tick to tick."""

    imu_age: Array0D
    stamp: Array0D
    joints_valid: Flags0D
    imu_valid: Flags0D
    contacts_valid: Flags0D
    invalid: Indices1D
    stamps: Array1D


class Health(NamedTuple):
    """A robot's health and its limits; ``state`` is a field of ``RobotHealth``, and ``verdict`` (2,) what
    ``judge_health`` writes."""

    drives: Drives
    sensors: Sensors
    limits: Limits
    state: Indices0D
    verdict: Indices1D


class HealthTimers(Protocol):
    """The memory of what is beyond its limit: see ``SafetyState``."""

    low: Any
    hot: Any
    strong: Any
    invalid: Any
    stamps: Any


def health_of(
    params: HealthParameters, period: float, health: RobotHealth, timers: HealthTimers
) -> Health:
    """What is judged of a robot once a tick, every ``period`` [s]."""
    return Health(
        Drives(
            health.condition, health.age, health.voltage, health.temperature, health.current,
            timers.low, timers.hot, timers.strong,
        ),
        Sensors(
            health.imu_age, health.stamp, health.joints_valid, health.imu_valid,
            health.contacts_valid, timers.invalid, timers.stamps,
        ),
        Limits(
            params.lowest_voltage or 0.0,
            params.highest_temperature,
            params.largest_current or np.inf,
            params.answer_age,
            params.imu_age,
            round(params.health_hold / period),
            round(params.invalid_hold / period),
            max(1, round(params.stamp_age / period)),
        ),
        health.state,
        np.zeros(2, dtype=np.int64),
    )  # fmt: skip


@kernel
def measured(health: Health, fault: int, place: int) -> float:
    """What was measured of a fault, in the unit of its signal."""
    if fault == _DRIVE:
        return float(health.drives.condition[place])
    if fault == _SILENT_DRIVE:
        return float(health.drives.age[place])
    if fault == _VOLTAGE:
        return float(health.drives.voltage[place])
    if fault == _TEMPERATURE:
        return float(health.drives.temperature[place])
    if fault == _CURRENT:
        return float(health.drives.current[place])
    if fault == _SILENT_IMU:
        return float(health.sensors.imu_age[()])
    return 0.0


def health_text(fault: Fault, who: str, value: float, params: HealthParameters) -> str:
    """A fault of the hardware in words, with the limit and the value that was measured.

    Args:
        fault: the reason.
        who: the motor of the drive it befell.
        value: what was measured, in the unit of its signal.
        params: the limits.
    """
    match fault:
        case Fault.DRIVE:
            return f"drive {who}: {describe(int(value))}"
        case Fault.SILENT_DRIVE:
            return (
                f"drive {who} has not answered for {1e3 * value:.0f} ms; answer_age is "
                f"{1e3 * params.answer_age:g} ms"
            )
        case Fault.VOLTAGE:
            return (
                f"drive {who}: {value:.1f} V is below lowest_voltage, {params.lowest_voltage:g} V"
            )
        case Fault.TEMPERATURE:
            return (
                f"drive {who}: its winding has {value:.0f} deg C; highest_temperature is "
                f"{params.highest_temperature:g}"
            )
        case Fault.CURRENT:
            return f"drive {who}: {value:.1f} A; largest_current is {params.largest_current:g} A"
        case Fault.SILENT_IMU:
            return (
                f"the sensor board has sent nothing for {1e3 * value:.0f} ms; imu_age is "
                f"{1e3 * params.imu_age:g} ms"
            )
        case Fault.STALE_HEALTH:
            return f"the robot has measured nothing new for {1e3 * params.stamp_age:g} ms"
    what = {
        Fault.INVALID_JOINTS: "joint readings were",
        Fault.INVALID_IMU: "IMU's readings were",
        Fault.INVALID_CONTACTS: "foot switches' readings were",
    }[fault]
    return f"the {what} marked as not valid for more than {1e3 * params.invalid_hold:g} ms"


@kernel
def judge_health(drives: Drives, sensors: Sensors, limits: Limits, verdict: Indices1D) -> None:
    """Write the gravest fault, and the drive that has it, to ``verdict``, (2,); all counts are updated.
    A voltage of zero is one that is not measured."""
    fault, place = 0, 0
    for k in range(drives.condition.shape[0]):
        found = judge_drive(drives, limits, k)
        if found != 0 and (fault == 0 or found < fault):
            fault, place = found, k
    found = judge_sensors(sensors, limits)
    if fault == 0:
        fault = found
    verdict[0], verdict[1] = fault, place


@kernel
def judge_drive(drives: Drives, limits: Limits, k: int) -> int:
    """The gravest fault of drive ``k``; its counts are updated."""
    condition, voltage = drives.condition[k], drives.voltage[k]
    low = 0.0 < voltage < limits.lowest_voltage
    hot = not drives.temperature[k] <= limits.highest_temperature
    strong = not abs(drives.current[k]) <= limits.largest_current
    drives.low[k] = drives.low[k] + 1 if low else 0
    drives.hot[k] = drives.hot[k] + 1 if hot else 0
    drives.strong[k] = drives.strong[k] + 1 if strong else 0
    if condition & _CRITICAL != 0 or condition & _ANSWERED == 0:
        return _DRIVE
    if not drives.age[k] <= limits.answer_age:
        return _SILENT_DRIVE
    if drives.low[k] > limits.hold:
        return _VOLTAGE
    if drives.hot[k] > limits.hold:
        return _TEMPERATURE
    if drives.strong[k] > limits.hold:
        return _CURRENT
    return 0


@kernel
def judge_sensors(sensors: Sensors, limits: Limits) -> int:
    """The gravest fault of what is measured; all counts are updated."""
    invalid, stamps, stamp = sensors.invalid, sensors.stamps, sensors.stamp[()]
    invalid[0] = 0 if sensors.joints_valid[()] else invalid[0] + 1
    invalid[1] = 0 if sensors.imu_valid[()] else invalid[1] + 1
    invalid[2] = 0 if sensors.contacts_valid[()] else invalid[2] + 1
    same = stamp >= 0.0 and stamp == stamps[0]
    stamps[1] = stamps[1] + 1.0 if same else 0.0
    stamps[0] = stamp
    if not sensors.imu_age[()] <= limits.imu_age:
        return _SILENT_IMU
    for k in range(3):
        if invalid[k] > limits.invalid_hold:
            return _INVALID_JOINTS + k
    if stamps[1] > limits.stamp_hold:
        return _STALE_HEALTH
    return 0
