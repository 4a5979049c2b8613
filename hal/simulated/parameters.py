"""The parameters of simulated robots, in groups: start, ground, body, sensors and actuators.

A *spread* is half the width of a uniform distribution around the nominal value, from which one
value is drawn by the seed. A *noise* is the standard deviation of a normal distribution, from
which a value is drawn for every sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from pydantic import model_validator

from ...robots.description import RobotDescription
from ...robots.terrain import Terrain, WorldParameters
from ...runtime.language.parameters import Parameters, parameter
from ..drive_control import DriveGains
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
)
from .tiles import UnevenParameters


def _check_range(name: str, value: Sequence[float] | None) -> None:
    if value is not None and not 0.0 < value[0] <= value[1]:
        raise ValueError(f"{name} must be two positive numbers in rising order: {value}")


class StartParameters(Parameters):
    """Start of a run; by default the robot stands level, in phase with the control clock."""

    initial_attitude_error: float = parameter(
        0.0, unit="rad", ge=0, le=0.1,
        text="standard deviation per axis of the torso's attitude at the start, soles flat",
    )  # fmt: skip
    random_start_phase: bool = parameter(
        False, text="start physics at a drawn phase of the control clock"
    )
    stand: bool = parameter(
        True,
        text="whether a robot with feet, or on a fixed base, must stay as it starts; if not, it is put down in its standing "
        "pose, begins from rest and falls if it falls, as one without feet does",
    )
    gantry: GantryParameters | None = parameter(
        None, text="a gantry in which the robot hangs at the start; none: it stands"
    )


class GroundParameters(Parameters):
    """The ground: its shape, and its contacts with the robot."""

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
    floor_tilt: float = parameter(
        0.0, unit="rad", ge=0.0, le=0.2,
        text="by which the whole scene leans, in a drawn direction; the truth is told in its frame",
    )  # fmt: skip
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
    soles: SoleParameters | None = parameter(
        None, text="soles of rubber; none: as stiff as all else"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_range("friction_range", self.friction_range)
        return self

    def build(self, robot: RobotDescription | None, seed: int) -> Terrain:
        """Return the terrain for a robot, with tiles drawn by the ``seed``."""
        scene = self._scene_of_the_task(seed)
        return scene if self.uneven is None else self.uneven.cover(scene, robot, seed)

    def _scene_of_the_task(self, seed: int) -> Terrain:
        """Return the ground without its hidden tiles."""
        if isinstance(self.scene, scenes.SceneParameters):
            return self.scene.build(seed)
        if self.scene == "step":
            return scenes.step(self.step_height, self.step_distance, self.step_depth)
        if self.scene == "platform":
            return scenes.platform(self.platform_height, self.platform_edge)
        if self.scene == "none":
            return scenes.no_ground()
        return scenes.flat()


class BodyParameters(Parameters):
    """Differences of the bodies from the description, and forces on them; by default nothing."""

    mass_scale: float = parameter(1.0, gt=0, text="factor on all masses and inertias")
    mass_spread: float = parameter(0.0, ge=0, lt=1, text="spread of the factor mass_scale")
    base_com_offset: list[float] = parameter(
        [0.0, 0.0, 0.0], unit="m", min_length=3, max_length=3, text="offset of the torso's CoM"
    )
    base_com_spread: float = parameter(0.0, unit="m", ge=0, text="spread of the offset, per axis")
    links: LinkEffects = parameter(LinkEffects, text="how the links differ from the description")
    cable: CableParameters | None = parameter(None, text="a cable that pulls at the base")


class SensorParameters(Parameters):
    """The errors of the sensors; by default none."""

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
    imu: ImuEffects = parameter(ImuEffects, text="the IMU: place, mount, filter, delay")
    encoders: EncoderEffects = parameter(EncoderEffects, text="the joint encoders")
    switches: SwitchEffects = parameter(
        SwitchEffects, text="the foot switches, besides `switch_threshold` and bounce"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_range("switch_threshold", self.switch_threshold)
        _check_range("switches.threshold", self.switches.threshold)
        return self


class ActuatorParameters(Parameters):
    """The drives, motors and gears, and what feeds them; by default all are ideal."""

    bus_period: float | None = parameter(
        None, unit="s", gt=0, le=0.02,
        text="how often the driver renews the goals of the drives, which close their loops per motor with "
        "`stiffness` and `damping`; none: in every physics step, so that the joints get exactly the "
        "commanded feedback",
    )  # fmt: skip
    drive_damping: float | None = parameter(
        None, unit="N m s/rad", ge=0,
        text="joint damping of a drive in its damping mode; none: a third of the damping that "
        "holds the robot before the first command",
    )  # fmt: skip
    joint_friction: float = parameter(1.0, ge=0, text="factor on the motors' friction and damping")
    thrust_spread: float = parameter(
        0.0, ge=0, lt=1, text="spread of a factor on thrust and moment of every thruster"
    )
    joints: JointEffects = parameter(
        JointEffects, text="how joints and rotors differ from the description"
    )
    motors: MotorEffects = parameter(MotorEffects, text="the motors and their current loops")
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


class SimulatorParameters(DriveGains, WorldParameters):
    """The parameters of ``MujocoRobot``; by default there are no disturbances."""

    seed: int = parameter(0, ge=0, text="the seed of all random numbers")
    noise_seed: int | None = parameter(
        None, ge=0,
        text="that of noise, jitter, and the attitude and clock at the start, for another run of the "
        "robot that `seed` draws; none: as `seed`",
    )  # fmt: skip
    flight_integrator: Literal["implicitfast", "RK4"] = parameter(
        "implicitfast",
        text="integration of physics steps that begin without any contact: in one stage, or in the four of Runge and Kutta, "
        "which conserve momentum",
    )
    timestep: float = parameter(
        0.0005, unit="s", gt=0, le=0.002, text="physics step; it must divide the control period"
    )
    latency: float = parameter(0.0, unit="s", ge=0, le=0.1, text="delay from sensing to torque")
    jitter: float = parameter(
        0.0,
        unit="s",
        ge=0,
        le=0.1,
        text="additional latency of a command, uniform from zero to this",
    )
    start: StartParameters = parameter(StartParameters, text="how a run begins")
    ground: GroundParameters = parameter(GroundParameters, text="the ground and its contacts")
    body: BodyParameters = parameter(
        BodyParameters, text="how the bodies differ from the description"
    )
    sensors: SensorParameters = parameter(SensorParameters, text="the errors of the sensors")
    actuators: ActuatorParameters = parameter(
        ActuatorParameters, text="drives, motors, gears, and what feeds them"
    )

    @property
    def seed_of_noise(self) -> int:
        """The seed of what differs from run to run of one robot."""
        return self.seed if self.noise_seed is None else self.noise_seed

    def build_scene(self, robot: RobotDescription | None) -> Terrain:
        """Return the ground that these parameters describe, for a robot."""
        return self.ground.build(robot, self.seed)
