"""The hardware's file: the connections of a robot's drives and sensor board, and their limits.

It belongs to one robot on one bench: its ports, addresses, directions and offsets. See
``extensions/commissioning/bring_up.md`` for how its values are found, and ``graphs/hardware/bruce.yaml`` for one.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

import numpy as np
import yaml

from ...files.problems import Code, LoadError, Problems, listing, nearest
from ...files.validation import location_of, read_model
from ...mathematics.arrays import Array
from ...mathematics.rotations import exponential, from_matrix, logarithm, to_matrix
from ...robots.robot_description import RobotDescription
from ...runtime.language.block import UnmetRequirement
from ...runtime.language.parameters import Parameters, ThreeNumbers, parameter
from ..sensors.sensor import MountedSensor, mounted_sensors
from .bus import BAUDRATE
from .protocol import LAST_DEVICE
from .sense_board import MAX_COOLING, SWITCHES

_TURNS = 25.0
"""An angle that no motor of a robot reaches [rad]."""


class HardwareError(LoadError):
    """The file of the hardware is wrong; the text reports every mistake at its place."""


class BusSettings(Parameters):
    """The bus of the drives."""

    port: str = parameter(..., text="the serial port, best one of /dev/serial/by-id")
    baudrate: int = parameter(BAUDRATE, gt=0, text="bit/s")
    period: float = parameter(0.001, unit="s", gt=0, le=0.02, text="from exchange to exchange")
    lead: float = parameter(
        0.0015,
        unit="s",
        ge=0,
        le=0.02,
        text="from a measurement to the middle of the time in which the goals made from it act",
    )
    reply_time: float = parameter(
        0.003, unit="s", gt=0, le=5.0, text="time that all drives have together for their answers"
    )
    lost_cycles: int = parameter(
        5, ge=1, le=100, text="exchanges in a row that a drive may miss before all are damped"
    )
    time: Literal["real", "virtual"] = parameter(
        "real",
        text="virtual: `aloft twin --virtual` serves it, and time goes on with the exchanges",
    )

    @property
    def is_virtual(self) -> bool:
        """True if the port is that of a twin in virtual time: by the file, and as it is a pseudo-terminal."""
        return self.time == "virtual" and os.path.realpath(self.port).startswith("/dev/pts/")


def imu_rotation_of(to_base: Array) -> tuple[float, ...]:
    """Return the ``imu_rotation`` of a board by the rotation from its IMU's axes to the base's, (3, 3)."""
    quaternion, turn = np.zeros(4), np.zeros(3)
    from_matrix(np.ascontiguousarray(to_base), quaternion)
    logarithm(quaternion, turn)
    return tuple(turn.tolist())


class BoardSettings(Parameters):
    """The sensor board."""

    port: str = parameter(..., text="the serial port, best one of /dev/serial/by-id")
    switches: list[str] = parameter(
        list(SWITCHES), max_length=7, text="the contact point of each bit of the switches' byte"
    )
    normally_closed: list[str] = parameter(
        [], max_length=7, text="the contact points whose switch opens when it is pressed"
    )
    imu_rotation: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="rad",
        text="rotation vector from the base's axes to the IMU's: readings are turned back by it",
    )  # fmt: skip
    imu_position: ThreeNumbers = parameter(
        (0.0, 0.0, 0.0), unit="m",
        text="place of the IMU, from the base's origin, base frame: `robot.imu_position` in a graph",
    )  # fmt: skip
    sensors: list[str] = parameter(
        [],
        text="the robot's mounted sensors in a packet, behind the switches' byte, in their order",
    )
    lost_cycles: int = parameter(
        10, ge=1, le=1000, text="exchanges without a packet before all drives are damped"
    )
    frozen_packets: int = parameter(
        25, ge=2, le=10000, text="packets with equal numbers before the IMU counts as frozen"
    )
    gyro_range: float = parameter(
        8.726, unit="rad/s", gt=0, text="the gyroscope saturates here: 500 deg/s as shipped"
    )
    saturated_packets: int = parameter(
        25, ge=1, le=10000, text="packets in a row at the gyroscope's range before all are damped"
    )

    cooling: int = parameter(
        5, ge=0, le=MAX_COOLING, text="strength of pump and fan while the drives are armed"
    )
    cool_down: float = parameter(
        60.0, unit="s", ge=0, le=600.0, text="for how long they go on at most after the end"
    )
    cooled: float = parameter(
        45.0, ge=0, le=125.0, text="hottest winding [deg C] at which they go off after the end"
    )

    @property
    def imu_to_base(self) -> Array:
        """The rotation from the IMU's axes to the base's, (3, 3)."""
        quaternion, matrix = np.zeros(4), np.eye(3)
        if any(self.imu_rotation):
            exponential(np.array(self.imu_rotation), quaternion)
            to_matrix(quaternion, matrix)
        return matrix

    def mounted(self, robot: RobotDescription) -> tuple[MountedSensor, ...]:
        """Return the mounted sensors in a packet, in their order."""
        known = {sensor.name: sensor for sensor in mounted_sensors(robot)}
        return tuple(known[name] for name in self.sensors)


class DriveSettings(Parameters):
    """Settings that all drives have in common."""

    torque_constant: float = parameter(
        0.35, unit="N m/A", gt=0,
        text="torque at the gearbox's output for a current, of motors without one of their own",
    )  # fmt: skip
    current_limit: float = parameter(
        30.0, unit="A", gt=0, le=100.0, text="register limit_i_max; a goal beyond it is ignored"
    )
    current_margin: float = parameter(
        0.5, unit="A", ge=0, text="goals are clamped to the limit less this"
    )
    bad_cycles: int = parameter(
        20,
        ge=1,
        le=1000,
        text="exchanges in a row with a voltage or temperature out of range before all are damped",
    )
    stuck_cycles: int = parameter(
        25,
        ge=2,
        le=1000,
        text="equal positions in a row, under current and while others move, of a stuck encoder",
    )
    stuck_current: float = parameter(
        1.0, unit="A", gt=0, text="a current under which a motor cannot stand perfectly still"
    )
    iq_gains: list[float] = parameter(
        [0.277, 0.061, 0.0], min_length=3, max_length=3, text="gains of the current loops, P I D"
    )
    watchdog: float = parameter(
        0.025, unit="s", ge=0, le=10.0, text="register watchdog_timeout; zero: off"
    )
    lowest_voltage: float = parameter(
        13.0, unit="V", gt=0, text="of the pack without load; below it all drives are damped"
    )
    brown_out_voltage: float = parameter(
        10.0, unit="V", ge=0, text="below it all drives are damped under any load"
    )
    pack_resistance: float = parameter(
        0.04,
        unit="ohm",
        ge=0,
        text="of the pack and its leads: under load the voltage may be lower",
    )
    winding_resistance: float = parameter(0.2, unit="ohm", ge=0, text="of a motor, for its load")
    winding_heat_capacity: float = parameter(15.0, unit="J/K", gt=0, text="of a winding")
    winding_thermal_resistance: float = parameter(
        2.0, unit="K/W", gt=0, text="from a winding to what cools it"
    )
    coolant_temperature: float = parameter(25.0, ge=-20.0, le=80.0, text="of what cools it [deg C]")
    highest_voltage: float = parameter(18.0, unit="V", gt=0, text="above it nothing is enabled")
    highest_temperature: float = parameter(
        75.0, gt=0, le=125.0, text="of a winding [deg C]; beyond it all drives are damped"
    )
    jump_heating: float = parameter(
        5.0, ge=0, le=100.0,
        text="heating of a winding by a jump [K] where its plan is not known: too hot for one more, nothing is enabled",
    )  # fmt: skip
    heat_margin: float = parameter(
        1.5,
        ge=1.0,
        le=10.0,
        text="factor by which a run heats a winding more than its plan alone does",
    )


class MotorSettings(Parameters):
    """One motor: the measured angle is ``sign * present_position - offset``."""

    id: int = parameter(..., ge=0, le=LAST_DEVICE, text="its address on the bus")
    sign: Literal[1, -1] = parameter(1, text="1 if the drive turns as the description's motor does")
    offset: float | None = parameter(
        None, unit="rad", text="sign * present_position at the zero pose; none: not calibrated"
    )
    low: float | None = parameter(None, unit="rad", text="lowest angle the drive may have")
    high: float | None = parameter(None, unit="rad", text="highest angle the drive may have")
    torque_constant: float | None = parameter(
        None, unit="N m/A", gt=0, text="of this motor; none: that of `drives`"
    )

    @property
    def zero(self) -> float:
        """The offset [rad]; zero before it was calibrated."""
        return self.offset or 0.0

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest angle [rad]; the drive's own before they were measured."""
        low, high = self.low, self.high
        return -_TURNS if low is None else low, _TURNS if high is None else high


class SoftStart(Parameters):
    """The way of the drives from where they are to the standing pose."""

    duration: float = parameter(
        2.0, unit="s", ge=0.1, le=60.0, text="for the way from the present to the standing pose"
    )
    farthest: float = parameter(
        1.0, unit="rad", gt=0, text="a motor further from the standing pose is not enabled"
    )
    current: float = parameter(
        8.0, unit="A", gt=0, text="the current's limit meanwhile, at the end of its ramp"
    )
    ramp: float = parameter(
        0.2, unit="s", ge=0, le=10.0,
        text="from the first command on the limit rises so long from there to the drives' own",
    )  # fmt: skip


class DeadMan(Parameters):
    """The dead man's switch, which a person holds while the drives are on."""

    kind: Literal["gamepad", "key", "none"] = parameter(
        "gamepad", text="a button of a gamepad, the space bar of the terminal, or nothing"
    )
    device: str = parameter("/dev/input/js0", text="the gamepad")
    button: int = parameter(4, ge=0, le=63, text="the gamepad's button")


class Hardware(Parameters):
    """The drives and the sensor board of one robot.

    The schema for editors is ``Hardware.model_json_schema()``, written by
    ``aloft robot schema``.
    """

    robot: str = parameter(..., text="the robot's name in its description")
    bus: BusSettings = parameter(..., text="the bus of the drives")
    board: BoardSettings = parameter(..., text="the sensor board")
    drives: DriveSettings = parameter(DriveSettings, text="settings that all drives have in common")
    motors: dict[str, MotorSettings] = parameter(..., text="every motor, by its name")
    soft_start: SoftStart = parameter(SoftStart, text="way of the drives to the standing pose")
    dead_man: DeadMan = parameter(DeadMan, text="switch that must be held while the drives are on")

    @classmethod
    def read(cls, file: Path, robot: RobotDescription | None = None) -> Hardware:
        """Read a file and, with a robot, see whether they fit.

        Raises:
            HardwareError: the file cannot be read, or has faults: all of them are named.
        """
        problems = Problems()
        found, tree = read_model(file, cls, problems, ("a robot's hardware", "robot, bus, motors"))
        if found is not None and tree is not None:
            for requirement in found.find_faults(robot):
                problems.add(
                    Code.UNMET_REQUIREMENT, requirement.message, location_of(tree, requirement.parameter.split(".")),
                    at=requirement.parameter, expected=requirement.expected, found=requirement.found,
                    nearest=requirement.nearest, fix=requirement.fix,
                )  # fmt: skip
        if len(problems) or found is None:
            raise HardwareError(problems.report(str(file)))
        return found

    def find_faults(self, robot: RobotDescription | None) -> list[UnmetRequirement]:
        """Report contradictions in the file, and to the robot's description."""
        found: list[UnmetRequirement] = []
        owners: dict[int, str] = {}
        for name, motor in self.motors.items():
            first = owners.setdefault(motor.id, name)
            if first != name:
                found.append(
                    UnmetRequirement(
                        f"{name} and {first} have the same address {motor.id}",
                        f"motors.{name}.id",
                        expected="an address of its own",
                    )
                )
            low, high = motor.range
            if low >= high:
                text = f"{name}: low {low:g} is not below high {high:g}"
                found.append(UnmetRequirement(text, f"motors.{name}.low"))
        for k, name in enumerate(self.board.normally_closed):
            if name not in self.board.switches:
                found.append(
                    UnmetRequirement(
                        f"{name!r} is none of board.switches: {', '.join(self.board.switches)}",
                        f"board.normally_closed.{k}", found=name,
                        nearest=nearest(name, self.board.switches),
                    )
                )  # fmt: skip
        drives = self.drives
        if drives.current_margin >= drives.current_limit:
            text = "current_margin leaves nothing of current_limit"
            found.append(UnmetRequirement(text, "drives.current_margin"))
        if drives.lowest_voltage >= drives.highest_voltage:
            text = "lowest_voltage is above highest_voltage"
            found.append(UnmetRequirement(text, "drives.lowest_voltage"))
        if robot is not None:
            found += self._faults_with(robot)
        return found

    def torque_constants(self, robot: RobotDescription) -> Array:
        """Return the torque at the output of every motor for a current [N m/A], (n_motors,)."""
        return np.array([self.torque_constant_of(name) for name in robot.transmission.motors])

    def torque_constant_of(self, motor: str) -> float:
        """Return the torque constant of one motor [N m/A]: its own, or the common one."""
        return self.motors[motor].torque_constant or self.drives.torque_constant

    def at_ports(self, bus: str, board: str, *, virtual: bool) -> str:
        """Return the text of this file, for a twin behind these ports."""
        data = self.model_dump(mode="json")
        data["bus"] |= {"port": bus}
        data["board"] |= {"port": board}
        data["dead_man"] = {"kind": "none"}
        if virtual:
            data["bus"] |= {"time": "virtual", "reply_time": 5.0}
        return yaml.safe_dump(data, sort_keys=False)

    def missing_calibration(self) -> list[str]:
        """List what motors lack before the drives may be switched on, with the step that finds it."""
        motors = self.motors.items()
        parts = (
            ("an `offset`", "step 3", [name for name, motor in motors if motor.offset is None]),
            (
                "`low` and `high`",
                "step 4",
                [n for n, m in motors if m.low is None or m.high is None],
            ),
        )
        return [
            f"{'no motor has' if len(names) == len(motors) else f'{listing(names)}: not calibrated,'} "
            f"{what}: do {step} of extensions/commissioning/bring_up.md"
            for what, step, names in parts
            if names
        ]

    def _faults_with(self, robot: RobotDescription) -> list[UnmetRequirement]:
        found: list[UnmetRequirement] = []
        if self.robot != robot.name:
            text = f"this is the hardware of {self.robot}, not of {robot.name}"
            return [UnmetRequirement(text, "robot", expected=robot.name, found=self.robot)]
        motors = robot.transmission.motors
        for name in self.motors:
            if name not in motors:
                near = nearest(name, motors)
                hint = f"; did you mean {near[0]}?" if near else ""
                found.append(
                    UnmetRequirement(
                        f"{robot.name} has no motor {name!r}{hint}", f"motors.{name}",
                        expected=listing(motors), found=name, nearest=near,
                    )
                )  # fmt: skip
        for name in motors:
            if name not in self.motors:
                text = f"motor {name} is missing"
                found.append(UnmetRequirement(text, "motors", fix=f"{name}: {{id: ...}}"))
        points = [contact.name for contact in robot.contacts]
        for k, name in enumerate(self.board.switches):
            if name not in points:
                found.append(
                    UnmetRequirement(
                        f"{robot.name} has no contact point {name!r}: {', '.join(points)}",
                        f"board.switches.{k}", found=name, nearest=nearest(name, points),
                    )
                )  # fmt: skip
        mounted = robot.sensors.mounted
        for k, name in enumerate(self.board.sensors):
            if name not in mounted:
                found.append(
                    UnmetRequirement(
                        f"{robot.name} mounts no sensor {name!r}: {', '.join(mounted) or 'none'}",
                        f"board.sensors.{k}", found=name, nearest=nearest(name, mounted),
                    )
                )  # fmt: skip
        return found

    @classmethod
    def for_twin(cls, robot: RobotDescription) -> Hardware:
        """Return the hardware of a robot that exists as a twin only: addresses from 1 in the order of the motors, no
        offsets, nothing to hold."""
        return cls.model_validate(
            {
                "robot": robot.name,
                "bus": {"port": "twin", "lead": 0.002},
                "board": {
                    "port": "twin",
                    "switches": [contact.name for contact in robot.contacts][:7],
                    "gyro_range": 35.0,
                    "sensors": list(robot.sensors.mounted),
                },
                "drives": {
                    "torque_constant": float(robot.motors.peak_torque.max()) / 30.0,
                    "current_limit": 30.5,
                },
                "motors": {
                    name: {"id": k + 1, "offset": 0.0, "low": -_TURNS, "high": _TURNS}
                    for k, name in enumerate(robot.transmission.motors)
                },
                "soft_start": {"duration": 0.3},
                "dead_man": {"kind": "none"},
            }
        )
