"""Base of all simulated robots: their ports, and a check of their parameters."""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterator, Mapping
from typing import Any

from ...blocks.signals import ExternalForce, RobotTruth
from ...robots.description import RobotDescription
from ...runtime.language.block import Input, Output, Port, State, UnmetRequirement
from ...runtime.language.context import Context
from ...runtime.language.parameters import Parameters
from ..robot import Robot
from ..sensors.sensor import MountedSensor
from .effects import WindingParameters, longest_gear_step, longest_stribeck_step
from .parameters import SimulatorParameters
from .state import PhysicsState, SensorMemory

_STEPS = (5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5, 1e-5, 1e-6)
"""Steps of the physics that divide a millisecond [s]."""


def impossible_effects(
    params: SimulatorParameters, robot: RobotDescription
) -> Iterator[UnmetRequirement]:
    """Report effects that the robot or the physics' steps do not allow."""
    step = params.timestep
    if params.actuators.battery is not None and robot.supply is None:
        yield UnmetRequirement(
            f"the description of {robot.name} does not say what feeds it", parameter="actuators.battery",
            expected="`supply` in the description", found="none",
            fix="supply: {rated_voltage: ..., open_voltage: ..., resistance: ..., capacity: ...}",
        )  # fmt: skip
    if params.actuators.windings is not None:
        yield from _unknown_windings(params.actuators.windings, robot)
    fastest = 0.45 / step
    for name in ("bandwidth", "mount_frequency"):
        frequency = getattr(params.sensors.imu, name)
        if frequency is not None and frequency > fastest:
            yield UnmetRequirement(
                f"with physics steps of {step:g} s the IMU has no filter of {frequency:g} Hz",
                parameter="sensors.imu", expected=f"sensors.imu.{name} up to {fastest:g} Hz",
                found=f"{frequency:g} Hz", fix=f"timestep: {0.45 / frequency:.2g} s, or less",
            )  # fmt: skip
    for what, longest in _longest_steps(params, robot):
        if step > longest:
            yield UnmetRequirement(
                f"{what} faster than physics steps of {step:g} s follow",
                parameter="timestep", expected=f"up to {longest:.3g} s",
                found=f"{step:g} s", fix=f"timestep: {next(each for each in _STEPS if each <= longest):g} s",
            )  # fmt: skip


def _unknown_windings(
    windings: WindingParameters, robot: RobotDescription
) -> Iterator[UnmetRequirement]:
    """Report values of windings that warm which neither the parameters nor the description give."""
    supply = None if robot.supply is None else windings.of(robot)
    for name, unit in (("heat_capacity", "J/K"), ("thermal_resistance", "K/W")):
        if supply is None or getattr(supply, f"winding_{name}") is None:
            yield UnmetRequirement(
                f"neither `actuators.windings` nor the description of {robot.name} says the {name} of a winding",
                parameter="actuators.windings", expected=f"`supply` with winding_{name} [{unit}] in the description",
                found="none" if supply is None else "a supply without it",
                fix=f"supply: {{winding_{name}: ...}}" if supply is None else f"actuators: {{windings: {{{name}: ... {unit}}}}}",
            )  # fmt: skip


def _longest_steps(
    params: SimulatorParameters, robot: RobotDescription
) -> Iterator[tuple[str, float]]:
    """Return the moving parts of the drives, and the longest steps [s] that resolve them."""
    joints, motors, rated = params.actuators.joints, params.actuators.motors, robot.motors
    rotors = joints.rotor_inertia * (1.0 - joints.rotor_inertia_spread) * rated.rotor_inertia
    if params.actuators.gears is not None:
        longest = longest_gear_step(params.actuators.gears, rotors)
        yield f"gears of {params.actuators.gears.stiffness:g} N m/rad move", longest
    friction = params.actuators.joint_friction * (1.0 + joints.friction_spread) * rated.friction
    longest = longest_stribeck_step(joints, friction, rotors)
    yield f"static friction of {joints.static_friction:g} times that in motion falls", longest
    fastest = float(rated.no_load_speed.max(initial=0.0))
    for size, name, periods in (
        (motors.ripple, "torque ripple", motors.ripple_periods),
        (motors.cogging, "cogging", motors.cogging_periods),
    ):  # fmt: skip
        if size and 0.0 < fastest < math.inf:
            text = f"{name} of {periods} periods a turn changes at {fastest:g} rad/s"
            yield text, math.pi / (periods * fastest)  # two samples a period


class SimulatedRobot(Robot, ABC):
    """The ports and the surroundings of a simulated robot; see ``MujocoRobot`` and ``TwinRobot``."""

    outside = "simulated"

    push = Input(ExternalForce, default={}, text="a force from outside, held for the tick")
    truth = Output(RobotTruth, truth=True, text="true state of the robot")
    physics = State(PhysicsState, text="the simulator's state, written for a snapshot")

    @classmethod
    def ports_of(cls, sensors: tuple[MountedSensor, ...]) -> dict[str, Port[Any]]:
        """Return the outputs of mounted sensors, and the memory that their simulation needs."""
        memory = State(SensorMemory, text="memory of the simulation of mounted sensors")
        return {**super().ports_of(sensors), "sensor_memory": memory}

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export ``ground_tolerance``: the largest distance of the ground from that of a task [m], for scores."""
        assert isinstance(params, SimulatorParameters)
        scene = params.build_scene(context.robot)
        return {**super().exported_values(params, context), "ground_tolerance": scene.uneven}

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the number of named points that a force may act at; the seed is not a dimension."""
        return {"n_points": len(robot.points) if robot is not None else 0}
