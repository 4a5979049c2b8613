"""A perfect calibration of a simulated robot, from the simulator's own draws.

It bounds what a calibration can give: the values are exact, or wrong by errors of a given size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...hal.random_streams import Purpose, stream
from ...hal.simulated.imu_effects import draw_delays, draw_imu_pose
from ...hal.simulated.parameters import SimulatorParameters
from ...hal.simulated.variation import draw_variation
from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.graph import Graph

CONSUMER = "controllers/late_sensors.yaml"
"""The file that a graph includes so that its controller takes the values of a calibration."""


class CalibrationErrors(NamedTuple):
    """Standard deviations of a calibration's values: shares of friction and of torque constants, ages [s], the IMU's
    place [m] and angle [rad]."""

    friction: float = 0.0
    torque_constant: float = 0.0
    age: float = 0.0
    position: float = 0.0
    rotation: float = 0.0


EXACT = CalibrationErrors()
CALIBRATED = CalibrationErrors(0.1, 0.02, 0.0002, 0.003, math.radians(0.3))
"""Errors that the calibration is meant to reach."""


def oracle_values(
    graph: Graph, errors: CalibrationErrors = EXACT, block: str = "robot", seed: int = 0
) -> dict[str, Any]:
    """Return the parameters of the controller, as overrides of the graph.

    Args:
        graph: with the simulated robot and ``CONSUMER``; its seed must be set.
        block: the simulated robot.
        seed: draws the errors.
    """
    spec = next(each for each in graph.checked.blocks if each.path == block)
    params, robot = spec.params, graph.checked.robot
    if robot is None or not isinstance(params, SimulatorParameters):
        raise TypeError(f"{block} is no simulated robot")
    draw = np.random.default_rng(seed)
    return (
        _imu(params, errors, draw)
        | _ages(params, errors, draw)
        | _motors(block, params, robot, errors, draw)
        | _joints(params, robot, errors, draw)
        | _pack(params, robot)
    )


def _imu(
    params: SimulatorParameters, errors: CalibrationErrors, draw: np.random.Generator
) -> dict[str, Any]:
    place, angle = map(np.array, draw_imu_pose(params.sensors.imu, params.seed))
    return {
        "timing.imu_position": (place + errors.position * draw.normal(size=3)).tolist(),
        "timing.imu_rotation": (angle + errors.rotation * draw.normal(size=3)).tolist(),
    }


class ReadingAges(NamedTuple):
    """Extra age of the readings of slow motions over joint angles that arrive at once [s]."""

    rate: float
    force: float
    position: float
    velocity: float


def reading_ages(params: SimulatorParameters) -> ReadingAges:
    """Compute the ages of the simulated robot's readings, exactly as it does.

    Delays are whole steps of the physics, and filters are late by what their discrete form is late. The physics
    is integrated semi-implicitly, q[k+1] = q[k] + T v[k+1]: velocities, and specific forces that are their
    differences, are half a step older than the angles beside them.
    """
    imu, encoders, step = params.sensors.imu, params.sensors.encoders, params.timestep
    half = 0.5 * step
    filtered = 0.0
    if imu.bandwidth is not None:  # of second order, maximally flat, by the bilinear transform
        filtered = math.sqrt(0.5) * step / math.tan(math.pi * imu.bandwidth * step)
    gyro, accelerometer = (round(each / step) * step for each in draw_delays(imu, params.seed))
    late = round(encoders.delay / step) * step
    time = encoders.velocity_filter
    smoothed = step / math.expm1(step / time) if time > 0.0 else 0.0
    return ReadingAges(
        gyro + filtered + half, accelerometer + filtered + half, late, late + smoothed + half
    )


def _ages(
    params: SimulatorParameters, errors: CalibrationErrors, draw: np.random.Generator
) -> dict[str, Any]:
    """Return the ages of the readings [s], and the delay that the controller must bridge."""
    band = params.actuators.motors.current_bandwidth
    ages = np.array(reading_ages(params))
    ages = np.maximum(0.0, ages + errors.age * draw.normal(size=4))
    loop = 0.0 if band is None else 1.0 / (2.0 * math.pi * band)
    told = zip(ReadingAges._fields, ages, strict=True)
    return {f"timing.{name}": float(age) for name, age in told} | {
        "delay.nominal": float(params.latency + loop + ages.max())
    }


def _motors(
    block: str,
    params: SimulatorParameters,
    robot: RobotDescription,
    errors: CalibrationErrors,
    draw: np.random.Generator,
) -> dict[str, Any]:
    motors, n = params.actuators.motors, len(robot.joints)
    spread = stream(params.seed, Purpose.TORQUE_CONSTANT).uniform(-1.0, 1.0, n)
    constant = motors.torque_constant * (1.0 + motors.torque_constant_spread * spread)
    constant = constant * (1.0 + errors.torque_constant * draw.normal(size=n))
    return {
        f"{block}.motor_model.torque_constant": _named(robot.transmission.motors, constant),
        f"{block}.motor_model.saturation": motors.saturation,
        f"{block}.motor_model.load_friction": motors.load_friction,
        "wbc.peak_torque": _by_joint(
            robot, constant * (1.0 - motors.saturation - motors.load_friction)
        ),
    }


def _joints(
    params: SimulatorParameters,
    robot: RobotDescription,
    errors: CalibrationErrors,
    draw: np.random.Generator,
) -> dict[str, Any]:
    variation, n = draw_variation(params, robot), len(robot.joints)
    factor = np.array([variation.factor(variation.friction_of_joint, k) for k in range(n)])
    factor = (
        params.actuators.joint_friction * factor * (1.0 + errors.friction * draw.normal(size=n))
    )
    rotors = [variation.factor(variation.rotor_inertia, k) for k in range(n)]
    friction = _by_joint(robot, (factor - 1.0) * robot.motors.friction)
    damping = _by_joint(robot, (factor - 1.0) * robot.motors.damping)
    return {
        "joint_pd.friction": friction,
        "joint_pd.damping": damping,
        "weight.friction": friction,
        "weight.damping": damping,
        "timing.play": float(
            params.sensors.encoders.backlash * robot.motors.gear_play.max(initial=0.0)
        ),
        "dynamics.rotor_inertia": _by_joint(robot, rotors),
    }


def _by_joint(robot: RobotDescription, values: Sequence[float] | Array) -> dict[str, float]:
    return _named([joint.name for joint in robot.joints], values)


def _named(names: Sequence[str], values: Sequence[float] | Array) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _pack(params: SimulatorParameters, robot: RobotDescription) -> dict[str, Any]:
    """Return the pack's resistance, so that its sag under load is no fault."""
    if params.actuators.battery is None:
        return {}
    return {"safety.pack_resistance": params.actuators.battery.of(robot).resistance}
