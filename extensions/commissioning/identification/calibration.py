"""Calibration of one robot: identified values with standard deviations, and the values that a graph takes of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from ....mathematics.arrays import Array
from ....robots.robot_description import RobotDescription
from .identification import Estimate, IdentificationError, MeasuredRun, identify_delay
from .motor_identification import (
    IdentifiedMotors,
    IdentifiedPack,
    identify_motors,
    identify_pack,
)
from .sensor_identification import IdentifiedSensors, identify_sensors

COMPENSATED = 0.8
"""The share of the friction that is compensated: with more a joint may creep."""
USUAL_DELAY = 0.002
"""Delay from sensing to torque where a run does not determine it [s]."""
BALANCE = 0.003
"""The error of a balance, as a share of the mass."""


class Value(BaseModel):
    """A value and the standard deviation of its error."""

    model_config = ConfigDict(frozen=True)

    value: float
    std: float = Field(ge=0.0)


class Calibration(BaseModel):
    """One robot as its own motion shows it; None where nothing was found.

    Frames are the base's. Ages are of readings beside the joints' angles [s]; ``rotor_inertia`` and
    ``torque_constant`` are factors on the description's, ``saturation`` and ``load_friction`` shares of the torque,
    ``gear_compliance`` is that of every gear behind its encoder [rad/(N m)].
    ``residuals`` say, by joint and sensor, what the model does not explain [N m, rad/s, m/s^2];
    ``ripple_periods`` are those of the motors' ripple and cogging in a turn of the output.
    """

    model_config = ConfigDict(frozen=True)

    robot: str
    friction: dict[str, Value]
    damping: dict[str, Value]
    torque_constant: dict[str, Value]
    saturation: Value
    load_friction: Value
    rotor_inertia: Value
    mass: Value
    imu_position: tuple[Value, Value, Value]
    imu_rotation: tuple[Value, Value, Value]
    gyro_age: Value
    accelerometer_age: Value
    velocity_age: Value
    play: dict[str, Value]
    gear_compliance: Value = Value(value=0.0, std=0.0)
    open_voltage: Value | None = None
    resistance: Value | None = None
    delay: Value | None = None
    residuals: dict[str, float] = {}
    ripple_periods: tuple[float, ...] = ()


def calibrate_robot(
    robot: RobotDescription, motion: MeasuredRun, voltage: Array, asked: Array,
    feedback: NDArray[np.bool_], weighed: float | None = None,
) -> Calibration:  # fmt: skip
    """Find everything in a run in which the robot sways on standing feet.

    Args:
        voltage: at the drives (n, n_motors) [V]; zeros where it is not measured.
        asked: the commanded joint torques (n, n_joints) [N m].
        feedback: where the drives add torques of their own (n,).
        weighed: the robot's mass by a balance [kg].

    Raises:
        IdentificationError: the base is not free, or the robot does not stand for long enough.
    """
    sensors = identify_sensors(robot, motion)
    balance = None if weighed is None else Estimate(weighed, BALANCE * weighed)
    motors = identify_motors(robot, motion, sensors, weighed=balance)
    pack = identify_pack(robot, motion, voltage.mean(axis=1))
    try:
        delay = identify_delay(motion.period, asked, motion.torque, feedback).delay
    except IdentificationError:
        delay = None
    return calibration_of(robot, sensors, motors, pack, delay)


def calibration_of(
    robot: RobotDescription, sensors: IdentifiedSensors, motors: IdentifiedMotors,
    pack: IdentifiedPack | None, delay: Estimate | None,
) -> Calibration:  # fmt: skip
    """Combine the identified values into one model. Held joints do not move and reveal nothing: theirs are the
    description's.
    """

    def named(values: dict[str, Estimate], known: Array | None = None) -> dict[str, Value]:
        found = {name: _value(each) for name, each in values.items()}
        if known is None:
            return found
        told = dict(zip((joint.name for joint in robot.joints), known.tolist(), strict=True))
        return found | {name: Value(value=told[name], std=told[name]) for name in robot.held}

    x, y, z = (_value(each) for each in sensors.imu_position)
    roll, pitch, yaw = (_value(each) for each in sensors.imu_rotation)
    return Calibration(
        robot=robot.name, friction=named(motors.friction, robot.motors.friction),
        damping=named(motors.damping, robot.motors.damping),
        torque_constant=named(motors.torque_constant), saturation=_value(motors.saturation),
        load_friction=_value(motors.load_friction), rotor_inertia=_value(motors.rotor_inertia),
        mass=_value(motors.mass), imu_position=(x, y, z), imu_rotation=(roll, pitch, yaw),
        gyro_age=_value(sensors.gyro_age), accelerometer_age=_value(sensors.accelerometer_age),
        velocity_age=_value(sensors.velocity_age), play=named(sensors.play, robot.motors.gear_play),
        gear_compliance=_value(sensors.gear_compliance),
        open_voltage=None if pack is None else _value(pack.open_voltage),
        resistance=None if pack is None else _value(pack.resistance),
        delay=None if delay is None else _value(delay),
        residuals={**sensors.residuals, **motors.residuals}, ripple_periods=motors.ripple_periods,
    )  # fmt: skip


def _value(found: Estimate) -> Value:
    return Value(value=found.value, std=found.std)


def fragment(robot: RobotDescription, found: Calibration, source: str) -> str:
    """Return the values as a graph's ``set``, for a controller with ``controllers/late_sensors.yaml``; ``source`` is
    where they come from.
    """

    def bounded(value: Value, least: float, most: float = 1e9) -> float:
        return min(most, max(least, value.value))

    def triple(values: tuple[Value, Value, Value], unit: str, scale: float) -> str:
        text = ", ".join(f"{each.value:.5f}" for each in values)
        stds = ", ".join(f"{scale * each.std:.1f}" for each in values)
        return f"[{text}]  # +- {stds} {unit}"

    def age(value: Value) -> str:
        return f"{1e3 * bounded(value, 0.0, 0.02):.3f} ms  # +- {1e3 * value.std:.3f} ms"

    ages = (found.gyro_age, found.accelerometer_age, found.velocity_age)

    def share(value: Value) -> str:
        return f"{bounded(value, 0.0, 0.5):.4f}  # +- {value.std:.4f}"

    delay = USUAL_DELAY if found.delay is None else found.delay.value
    oldest = max(0.0, *(each.value for each in ages))
    lossless = 1.0 - bounded(found.saturation, 0.0, 0.5) - bounded(found.load_friction, 0.0, 0.2)
    lines = [
        f"# {robot.name} as {source} shows it, found by `aloft robot calibrate`. Include this file behind the",
        "# controller, its gains and controllers/late_sensors.yaml. Standard deviations are in the comments.",
        "set:",
        f"  timing.rate: {age(found.gyro_age)}",
        f"  timing.force: {age(found.accelerometer_age)}",
        f"  timing.velocity: {age(found.velocity_age)}",
        f"  timing.imu_position: {triple(found.imu_position, 'mm', 1e3)}",
        f"  timing.imu_rotation: {triple(found.imu_rotation, 'mrad', 1e3)}",
        f"  delay.nominal: {1e3 * (delay + oldest):.3f} ms",
        "  timing.play:  # [rad]",
        *_rows(found.play, {name: bounded(v, 0.0) for name, v in found.play.items()}),
        "  robot.motor_model.torque_constant:",
        *_rows(found.torque_constant),
        f"  robot.motor_model.saturation: {share(found.saturation)}",
        f"  robot.motor_model.load_friction: {share(found.load_friction)}",
        *_beyond(
            "joint_pd.friction", "N m", COMPENSATED, robot, found.friction, robot.motors.friction
        ),
        *_beyond(
            "joint_pd.damping", "N m s/rad", COMPENSATED, robot, found.damping, robot.motors.damping
        ),
        *_beyond("weight.friction", "N m", 1.0, robot, found.friction, robot.motors.friction),
        *_beyond("weight.damping", "N m s/rad", 1.0, robot, found.damping, robot.motors.damping),
        f"  dynamics.rotor_inertia: {{'*': {found.rotor_inertia.value:.4f}}}  # +- {found.rotor_inertia.std:.4f}",
        "  wbc.peak_torque:  # shares of the description's that are left for the robot's motion",
        *(
            f"    {joint.name}: {lossless * found.torque_constant[motor].value:.4f}"
            for joint, motor in zip(robot.joints, robot.transmission.motors, strict=True)
        ),
    ]
    if found.resistance is not None:
        lines.append(
            f"  safety.pack_resistance: {bounded(found.resistance, 0.0):.4f} ohm  # +- {found.resistance.std:.4f}"
        )
    return "\n".join(lines) + "\n"


def _beyond(
    parameter: str, unit: str, share: float, robot: RobotDescription, found: dict[str, Value], known: Array,
) -> list[str]:  # fmt: skip
    """Return a share of what is found beyond the description's; for compensation, which must not push, never less."""
    least = 0.0 if share < 1.0 else -math.inf
    values = {
        joint.name: share * max(least, found[joint.name].value - float(nominal))
        for joint, nominal in zip(robot.joints, known, strict=True)
    }
    part = f"{share:.0%} of what" if share < 1.0 else "what"
    head = f"  {parameter}:  # {part} is beyond the description's [{unit}]"
    return [head, *_rows(found, values)]


def _rows(found: dict[str, Value], values: dict[str, float] | None = None) -> list[str]:
    shown = values or {name: each.value for name, each in found.items()}
    return [f"    {name}: {shown[name]:.4f}  # +- {each.std:.4f}" for name, each in found.items()]
