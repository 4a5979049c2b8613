"""What all simulated robots have: their parameters (world, actuators, disturbances) and their ports."""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterator, Mapping
from typing import Any, Literal, Self

from pydantic import model_validator

from ...blocks.signals import ExternalForce, RobotTruth
from ...robots.description import RobotDescription
from ...runtime.language.block import Input, Output, Port, State, UnmetRequirement
from ...runtime.language.context import Context
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.terrain import Terrain, WorldParameters
from ..drive_control import DriveGains
from ..robot import Robot
from ..sensors.sensor import MountedSensor
from . import scenes
from .effects import (
    BatteryParameters,
    CableParameters,
    EncoderEffects,
    GantryParameters,
    GearParameters,
    ImuEffects,
    JointEffects,
    LinkEffects,
    MotorEffects,
    SoleParameters,
    SwitchEffects,
    WindingParameters,
    longest_gear_step,
    longest_stribeck_step,
)
from .state import PhysicsState, SensorMemory
from .tiles import UnevenParameters


class SimulatorParameters(DriveGains, WorldParameters):
    """The parameters of ``MujocoRobot``; by default there are no disturbances.

    A *spread* is half the width of a uniform distribution around the nominal value, from which one
    value is drawn by the seed. A *noise* is the standard deviation of a normal distribution, from
    which a value is drawn for every sample.
    """

    seed: int = parameter(0, ge=0, text="the seed of all random numbers")
    noise_seed: int | None = parameter(
        None, ge=0,
        text="that of noise, jitter, and the attitude and clock at the start, for another run of the "
        "robot that `seed` draws; none: as `seed`",
    )  # fmt: skip
    timestep: float = parameter(
        0.0005, unit="s", gt=0, le=0.002, text="physics step; it must divide the control period"
    )

    scene: Literal["flat", "step", "platform", "none"] | scenes.SceneParameters = parameter(
        "flat",
        text="the kind of ground; none: there is no ground; or a floor with boxes, stairs, "
        "tiles and height fields; or "
        "{from: plan.scene}, the ground that a jump's task asks for",
    )
    step_height: float = parameter(0.05, unit="m", gt=0, text="scene step: its height")
    step_distance: float = parameter(
        0.1, unit="m", text="scene step: from the start to its front edge"
    )
    step_depth: float = parameter(
        1.5, unit="m", gt=0, text="scene step: its depth, from its front edge to its back edge"
    )
    platform_height: float = parameter(
        0.35, unit="m", gt=0, text="scene platform: its height above the floor"
    )
    platform_edge: float = parameter(
        0.15, unit="m",
        text="scene platform: from the start to the edge that is jumped off; negative: behind it",
    )  # fmt: skip

    uneven: UnevenParameters | None = parameter(
        None, text="tiles on all level ground that nobody is told of; none: the scene as it is"
    )

    friction: float = parameter(0.7, gt=0, text="friction coefficient of the ground")
    friction_range: list[float] | None = parameter(
        None, min_length=2, max_length=2,
        text="lowest and highest friction, drawn uniformly in place of `friction`",
    )  # fmt: skip
    contact_stiffness: float = parameter(
        1.0, ge=0.05, le=16.0, text="factor on the stiffness of all contacts"
    )
    contact_stiffness_spread: float = parameter(
        1.0, ge=1.0, le=16.0, text="further factor, log-uniform between its inverse and this"
    )
    contact_bias: bool = parameter(
        False,
        text="whether contacts of spheres with the ground count J' q', which MuJoCo leaves out, so that soles slide on moving legs",
    )
    mass_scale: float = parameter(1.0, gt=0, text="factor on all masses and inertias")
    mass_spread: float = parameter(0.0, ge=0, lt=1, text="spread of the factor mass_scale")
    joint_friction: float = parameter(1.0, ge=0, text="factor on the motors' friction and damping")
    thrust_spread: float = parameter(
        0.0, ge=0, lt=1, text="spread of a factor on thrust and moment of every thruster"
    )
    base_com_offset: list[float] = parameter(
        [0.0, 0.0, 0.0], unit="m", min_length=3, max_length=3, text="offset of the torso's CoM"
    )
    base_com_spread: float = parameter(0.0, unit="m", ge=0, text="spread of the offset, per axis")

    initial_attitude_error: float = parameter(
        0.0, unit="rad", ge=0, le=0.1,
        text="standard deviation per axis of the torso's attitude at the start, soles flat",
    )  # fmt: skip
    random_start_phase: bool = parameter(
        False, text="start physics at a drawn phase of the control clock"
    )
    bus_period: float | None = parameter(
        None, unit="s", gt=0, le=0.02,
        text="how often the driver renews the goals of the drives, which close their loops per motor with "
        "`stiffness` and `damping`; none: in every physics step, so that the joints get exactly the "
        "commanded feedback",
    )  # fmt: skip
    latency: float = parameter(0.0, unit="s", ge=0, le=0.1, text="delay from sensing to torque")
    jitter: float = parameter(
        0.0,
        unit="s",
        ge=0,
        le=0.1,
        text="additional latency of a command, uniform from zero to this",
    )

    gyro_noise: float = parameter(0.0, unit="rad/s", ge=0, text="gyroscope noise")
    gyro_bias: float = parameter(
        0.0, unit="rad/s", ge=0, text="spread of the gyroscope's bias, per axis"
    )
    gyro_range: float | None = parameter(
        None, unit="rad/s", gt=0, text="the gyroscope saturates at this rate; none: never"
    )
    accelerometer_noise: float = parameter(0.0, unit="m/s^2", ge=0, text="accelerometer noise")
    accelerometer_bias: float = parameter(
        0.0, unit="m/s^2", ge=0, text="spread of the accelerometer's bias, per axis"
    )
    accelerometer_range: float | None = parameter(
        None, unit="m/s^2", gt=0, text="the accelerometer saturates at this value; none: never"
    )
    encoder_offset: float = parameter(
        0.0, unit="rad", ge=0, text="spread of the joint encoders' offsets"
    )
    encoder_resolution: float = parameter(
        0.0, unit="rad", ge=0, text="joint angles are rounded to multiples of this; 0: not rounded"
    )
    joint_velocity_noise: float = parameter(0.0, unit="rad/s", ge=0, text="joint velocity noise")
    switch_threshold: list[float] = parameter(
        [1.0, 1.0], unit="N", min_length=2, max_length=2,
        text="lowest and highest force that closes a switch, drawn per switch",
    )  # fmt: skip
    switch_bounce: float = parameter(
        0.0, unit="s", ge=0, le=0.1, text="for how long a switch chatters after each change"
    )

    sensor_errors: float = parameter(
        1.0, ge=0,
        text="factor on noise and bias of the sensors that the robot's description mounts; 0: they "
        "have no errors",
    )  # fmt: skip

    imu: ImuEffects = parameter(ImuEffects(), text="the IMU: place, mount, filter, delay")
    encoders: EncoderEffects = parameter(EncoderEffects(), text="the joint encoders")
    motors: MotorEffects = parameter(MotorEffects(), text="the motors and their current loops")
    gears: GearParameters | None = parameter(
        None,
        text="gears that yield, with encoders on the rotors; none: rotor and joint are one body",
    )
    battery: BatteryParameters | None = parameter(
        None, text="the pack; none: a supply whose voltage never changes"
    )
    windings: WindingParameters | None = parameter(
        None, text="windings that warm; none: their temperature changes nothing"
    )
    switches: SwitchEffects = parameter(
        SwitchEffects(), text="the foot switches, besides `switch_threshold` and bounce"
    )
    soles: SoleParameters | None = parameter(
        None, text="soles of rubber; none: as stiff as all else"
    )
    cable: CableParameters | None = parameter(None, text="a cable that pulls at the base")
    gantry: GantryParameters | None = parameter(
        None, text="a gantry in which the robot hangs at the start; none: it stands"
    )
    floor_tilt: float = parameter(
        0.0, unit="rad", ge=0.0, le=0.2,
        text="by which the whole scene leans, in a drawn direction; the truth is told in its frame",
    )  # fmt: skip
    links: LinkEffects = parameter(LinkEffects(), text="how the links differ from the description")
    joints: JointEffects = parameter(
        JointEffects(), text="how joints and rotors differ from the description"
    )

    drive_damping: float | None = parameter(
        None, unit="N m s/rad", ge=0,
        text="joint damping of a drive in its damping mode; none: a third of the damping that "
        "holds the robot before the first command",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        for name, value in (
            ("friction_range", self.friction_range), ("switch_threshold", self.switch_threshold),
            ("switches.threshold", self.switches.threshold),
        ):  # fmt: skip
            if value is not None and not 0.0 < value[0] <= value[1]:
                raise ValueError(f"{name} must be two positive numbers in rising order: {value}")
        return self

    @property
    def seed_of_noise(self) -> int:
        """The seed of what differs from run to run of one robot."""
        return self.seed if self.noise_seed is None else self.noise_seed

    def build_scene(self, robot: RobotDescription | None) -> Terrain:
        """The ground these parameters describe, for a robot."""
        scene = self._scene_of_the_task()
        return scene if self.uneven is None else self.uneven.cover(scene, robot, self.seed)

    def _scene_of_the_task(self) -> Terrain:
        """The ground without tiles that nobody is told of."""
        if isinstance(self.scene, scenes.SceneParameters):
            return self.scene.build(self.seed)
        if self.scene == "step":
            return scenes.step(self.step_height, self.step_distance, self.step_depth)
        if self.scene == "platform":
            return scenes.platform(self.platform_height, self.platform_edge)
        if self.scene == "none":
            return scenes.no_ground()
        return scenes.flat()


_STEPS = (5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5, 1e-5, 1e-6)
"""Steps of the physics that divide a millisecond [s]."""


def impossible_effects(
    params: SimulatorParameters, robot: RobotDescription
) -> Iterator[UnmetRequirement]:
    """Report effects that the robot or the physics' steps do not allow."""
    step = params.timestep
    if params.battery is not None and robot.supply is None:
        yield UnmetRequirement(
            f"the description of {robot.name} does not say what feeds it", parameter="battery",
            expected="`supply` in the description", found="none",
            fix="supply: {rated_voltage: ..., open_voltage: ..., resistance: ..., capacity: ...}",
        )  # fmt: skip
    if params.windings is not None:
        yield from _unknown_windings(params.windings, robot)
    fastest = 0.45 / step
    for name in ("bandwidth", "mount_frequency"):
        frequency = getattr(params.imu, name)
        if frequency is not None and frequency > fastest:
            yield UnmetRequirement(
                f"with physics steps of {step:g} s the IMU has no filter of {frequency:g} Hz",
                parameter="imu", expected=f"imu.{name} up to {fastest:g} Hz",
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
                f"neither `windings` nor the description of {robot.name} says the {name} of a winding",
                parameter="windings", expected=f"`supply` with winding_{name} [{unit}] in the description",
                found="none" if supply is None else "a supply without it",
                fix=f"supply: {{winding_{name}: ...}}" if supply is None else f"windings: {{{name}: ... {unit}}}",
            )  # fmt: skip


def _longest_steps(
    params: SimulatorParameters, robot: RobotDescription
) -> Iterator[tuple[str, float]]:
    """What moves in the drives, and the longest steps [s] that follow it."""
    joints, motors, rated = params.joints, params.motors, robot.motors
    rotors = joints.rotor_inertia * (1.0 - joints.rotor_inertia_spread) * rated.rotor_inertia
    if params.gears is not None:
        longest = longest_gear_step(params.gears, rotors)
        yield f"gears of {params.gears.stiffness:g} N m/rad move", longest
    friction = params.joint_friction * (1.0 + joints.friction_spread) * rated.friction
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
