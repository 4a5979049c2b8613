"""The true build and wiring of a robot, from which its hardware's file may differ."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ..bear.configuration import Hardware, imu_rotation_of
from ..simulated.parameters import SimulatorParameters
from .twin import Twin, standing_twin


@dataclass
class Wiring:
    """The true build of a robot.

    Attributes:
        addresses: of every motor, by name; a motor that is left out is not on the bus.
        signs, zeros: of every motor: its drive reads ``sign * (angle + zero)``.
        ratios: of every motor, its drive's turn per angle.
        jig_error: of every joint, in the jig of the zero pose [rad].
        limits: of every joint [rad], by name.
        lengths: reading of a rule at a joint [m], by name.
        mass: reading of the scale [kg].
        deaf: whether the bus runs at another rate than the file says.
        voltage: of the supply [V].
        imu, gyro: columns are the robot's axes in the frame of accelerometer and gyroscope.
        force_scale, gyro_scale: of the sensors.
        bits: the contact point of each bit.
        inverted, stuck, broken: contact points whose switch is so; a stuck one is always closed.
        board_dead: whether the board sends nothing.
        imu_position: where the IMU is, from the base's origin [m].
        current_inverted: motors whose current turns them against their encoders.
        constants: factors on torque constants, by motor.
        friction: factors on friction and damping, by joint.
        no_watchdog: motors whose drive ignores its watchdog.
        fixed: registers that a drive does not take, by motor.
        velocity_inverted: motors whose drive reads its velocity with the wrong sign.
    """

    addresses: dict[str, int]
    limits: dict[str, tuple[float, float]]
    lengths: dict[str, float]
    mass: float
    bits: list[str]
    signs: dict[str, int] = field(default_factory=dict)
    zeros: dict[str, float] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)
    jig_error: dict[str, float] = field(default_factory=dict)
    deaf: bool = False
    errors: dict[str, int] = field(default_factory=dict)
    enabled: set[str] = field(default_factory=set)
    voltage: float = 14.8
    imu: Array = field(default_factory=lambda: np.eye(3))
    gyro: Array | None = None
    force_scale: float = 1.0
    gyro_scale: float = 1.0
    inverted: set[str] = field(default_factory=set)
    stuck: set[str] = field(default_factory=set)
    broken: set[str] = field(default_factory=set)
    board_dead: bool = False
    imu_position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    current_inverted: set[str] = field(default_factory=set)
    constants: dict[str, float] = field(default_factory=dict)
    friction: dict[str, float] = field(default_factory=dict)
    no_watchdog: set[str] = field(default_factory=set)
    fixed: dict[str, set[str]] = field(default_factory=dict)
    velocity_inverted: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, robot: RobotDescription) -> Wiring:
        """Return the wiring that a robot should have: addresses from 1, no signs and zeros."""
        return cls(
            addresses={name: k + 1 for k, name in enumerate(robot.transmission.motors)},
            limits={joint.name: joint.limits or (-1.0, 1.0) for joint in robot.joints},
            lengths={joint.name: float(np.linalg.norm(joint.origin)) for joint in robot.joints},
            mass=robot.total_mass,
            bits=[contact.name for contact in robot.contacts],
        )

    def hardware(self, robot: RobotDescription) -> Hardware:
        """Return the file that this wiring should have."""
        told = Hardware.for_twin(robot)
        names = robot.transmission.motors
        nominal = told.drives.torque_constant
        board = told.board.model_copy(
            update={
                "switches": list(self.bits),
                "normally_closed": [name for name in self.bits if name in self.inverted],
                "imu_rotation": imu_rotation_of(self.imu.T),
                "imu_position": self.imu_position,
            }
        )
        motors = {
            name: told.motors[name].model_copy(
                update={
                    "id": self.addresses[name],
                    "sign": self.signs.get(name, 1),
                    "offset": self.zeros.get(name, 0.0),
                    "torque_constant": nominal * self.constants.get(name, 1.0),
                }
            )
            for name in names
        }
        return told.model_copy(update={"board": board, "motors": motors})

    def twin(self, robot: RobotDescription, params: SimulatorParameters, *, held: bool) -> Twin:
        """Build the robot of this wiring as its ports see it.

        Args:
            robot: the description.
            params: world, disturbances and sensors' errors.
            held: somebody holds its joints until it gets a current.
        """
        twin = standing_twin(robot, params, self.hardware(robot))
        twin.released = not held
        model = twin.plant.model
        for k, joint in enumerate(robot.joints):
            factor = self.friction.get(joint.name, 1.0)
            model.dof_frictionloss[robot.base_velocities + k] *= factor
            model.dof_damping[robot.base_velocities + k] *= factor
        for k, (name, drive) in enumerate(
            zip(robot.transmission.motors, twin.actuators, strict=True)
        ):
            drive.has_watchdog = name not in self.no_watchdog
            drive.fixed = frozenset(self.fixed.get(name, ()))
            if name in self.current_inverted:
                twin.drives.current_sign[k] = -1.0
            if name in self.velocity_inverted:
                twin.drives.velocity_sign[k] = -1.0
        return twin
