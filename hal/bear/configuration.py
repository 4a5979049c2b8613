"""The file that says how a robot's drives and sensor board are connected, and what they may do.

It belongs to one robot on one bench: its ports, addresses, directions and offsets. See
``docs/bring_up.md`` for how its values are found, and ``graphs/hardware/bruce.yaml`` for one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from ...robots.placed_yaml import PlacedYaml
from ...robots.robot_description import RobotDescription
from ...robots.validation.faults import RobotError, nearest
from ...runtime.language.errors import AloftError
from ...runtime.language.parameters import Parameters, parameter
from ..sensors.sensor import MountedSensor, mounted_sensors
from .bus import BAUDRATE
from .protocol import LAST_DEVICE
from .sense_board import SWITCHES

HardwareFault = tuple[tuple[str | int, ...], str]
"""A place in the file and what is wrong there."""


class HardwareError(AloftError):
    """The file of the hardware is wrong; the text names every fault with its place."""


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
        0.003, unit="s", gt=0, le=5.0, text="what all drives have together for their answers"
    )
    lost_cycles: int = parameter(
        5, ge=1, le=100, text="exchanges in a row that a drive may miss before all are damped"
    )


class BoardSettings(Parameters):
    """The sensor board."""

    port: str = parameter(..., text="the serial port, best one of /dev/serial/by-id")
    switches: list[str] = parameter(
        list(SWITCHES), max_length=7, text="the contact point of each bit of the switches' byte"
    )
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
        100, ge=1, le=10000, text="packets in a row at the gyroscope's range before all are damped"
    )

    def mounted(self, robot: RobotDescription) -> tuple[MountedSensor, ...]:
        """The mounted sensors in a packet, in their order."""
        known = {sensor.name: sensor for sensor in mounted_sensors(robot)}
        return tuple(known[name] for name in self.sensors)


class DriveSettings(Parameters):
    """What all drives have in common."""

    torque_constant: float = parameter(
        0.35, unit="N m/A", gt=0, text="torque at the gearbox's output for a current"
    )
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
        50,
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
        0.1, unit="s", ge=0, le=10.0, text="register watchdog_timeout; zero: off"
    )
    lowest_voltage: float = parameter(13.0, unit="V", gt=0, text="below it all drives are damped")
    highest_voltage: float = parameter(18.0, unit="V", gt=0, text="above it nothing is enabled")
    highest_temperature: float = parameter(
        75.0, gt=0, le=125.0, text="of a winding [deg C]; beyond it all drives are damped"
    )


class MotorSettings(Parameters):
    """One motor: the measured angle is ``sign * present_position - offset``."""

    id: int = parameter(..., ge=0, le=LAST_DEVICE, text="its address on the bus")
    sign: Literal[1, -1] = parameter(1, text="1 if the drive turns as the description's motor does")
    offset: float = parameter(0.0, unit="rad", text="sign * present_position at the zero pose")
    low: float = parameter(-25.0, unit="rad", text="lowest angle the drive may have")
    high: float = parameter(25.0, unit="rad", text="highest angle the drive may have")


class SoftStart(Parameters):
    """How the drives come from where they are to the standing pose."""

    duration: float = parameter(
        2.0, unit="s", ge=0.1, le=60.0, text="for the way from the present to the standing pose"
    )
    farthest: float = parameter(
        1.0, unit="rad", gt=0, text="a motor further from the standing pose is not enabled"
    )
    current: float = parameter(
        8.0, unit="A", gt=0, text="the current's limit meanwhile, at the end of its ramp"
    )


class DeadMan(Parameters):
    """What somebody must hold while the drives are on."""

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
    drives: DriveSettings = parameter(DriveSettings(), text="what all drives have in common")
    motors: dict[str, MotorSettings] = parameter(..., text="every motor, by its name")
    soft_start: SoftStart = parameter(SoftStart(), text="how the drives come to the standing pose")
    dead_man: DeadMan = parameter(DeadMan(), text="what must be held while the drives are on")

    @classmethod
    def read(cls, file: Path, robot: RobotDescription | None = None) -> Hardware:
        """Read a file and, with a robot, see whether they fit.

        Raises:
            HardwareError: the file cannot be read, or has faults: all of them are named.
        """
        try:
            placed = PlacedYaml.read(file)
        except RobotError as error:
            raise HardwareError(error.faults[0].text(str(file))) from error
        faults = [fault.text(str(file)) for fault in placed.faults]
        found: Hardware | None = None
        try:
            found = cls.model_validate(placed.data)
        except ValidationError as error:
            for each in error.errors(include_url=False):
                faults.append(_fault(file, placed, each))
        if found is not None:
            for path, message in found.find_faults(robot):
                faults.append(_text(file, placed, path, message))
        if faults or found is None:
            count = f"{len(faults)} fault{'s' if len(faults) != 1 else ''}"
            raise HardwareError("\n".join([*faults, f"{file}: {count} in the hardware's file"]))
        return found

    def find_faults(self, robot: RobotDescription | None) -> list[HardwareFault]:
        """What contradicts itself, or the robot's description: places and texts."""
        found: list[HardwareFault] = []
        owners: dict[int, str] = {}
        for name, motor in self.motors.items():
            first = owners.setdefault(motor.id, name)
            if first != name:
                found.append(
                    (("motors", name, "id"), f"{name} and {first} have the same address {motor.id}")
                )
            if motor.low >= motor.high:
                text = f"{name}: low {motor.low:g} is not below high {motor.high:g}"
                found.append((("motors", name, "low"), text))
        if self.drives.current_margin >= self.drives.current_limit:
            found.append(
                (("drives", "current_margin"), "current_margin leaves nothing of current_limit")
            )
        if self.drives.lowest_voltage >= self.drives.highest_voltage:
            found.append((("drives", "lowest_voltage"), "lowest_voltage is above highest_voltage"))
        if robot is not None:
            found += self._faults_with(robot)
        return found

    def _faults_with(self, robot: RobotDescription) -> list[HardwareFault]:
        found: list[HardwareFault] = []
        if self.robot != robot.name:
            found.append((("robot",), f"this is the hardware of {self.robot}, not of {robot.name}"))
            return found
        motors = robot.transmission.motors
        for name in self.motors:
            if name not in motors:
                guess = nearest(name, motors)
                hint = f"; did you mean {guess}?" if guess else ""
                found.append((("motors", name), f"{robot.name} has no motor {name!r}{hint}"))
        for name in motors:
            if name not in self.motors:
                found.append((("motors",), f"motor {name} is missing"))
        points = [contact.name for contact in robot.contacts]
        for k, name in enumerate(self.board.switches):
            if name not in points:
                text = f"{robot.name} has no contact point {name!r}: {', '.join(points)}"
                found.append((("board", "switches", k), text))
        mounted = robot.sensors.mounted
        for k, name in enumerate(self.board.sensors):
            if name not in mounted:
                text = f"{robot.name} mounts no sensor {name!r}: {', '.join(mounted) or 'none'}"
                found.append((("board", "sensors", k), text))
        return found

    @classmethod
    def for_twin(cls, robot: RobotDescription) -> Hardware:
        """The hardware of a robot that exists as a twin only: addresses from 1 in the order of the
        motors, no offsets, nothing to hold."""
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
                "motors": {name: {"id": k + 1} for k, name in enumerate(robot.transmission.motors)},
                "soft_start": {"duration": 0.3},
                "dead_man": {"kind": "none"},
            }
        )


def _fault(file: Path, placed: PlacedYaml, error: Any) -> str:
    path = tuple(part for part in error["loc"] if part != "[key]")
    name = ".".join(str(part) for part in path) or "the file"
    if error["type"] == "extra_forbidden":
        return _text(file, placed, path, f"there is no setting {name!r}")
    if error["type"] == "missing":
        return _text(file, placed, path, f"{name} is missing")
    said = str(error["msg"]).removeprefix("Input should be ")
    return _text(file, placed, path, f"{name} cannot be {error['input']!r}: expected {said}")


def _text(file: Path, placed: PlacedYaml, path: tuple[str | int, ...], message: str) -> str:
    line, column = placed.place(path)
    return f"{file}:{line}:{column}: {message}" if line else f"{file}: {message}"
