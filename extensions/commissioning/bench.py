"""Work with drives on a bench, one safe step at a time; each function documents what it sends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ...blocks.signals.robot import describe_conditions, is_critical
from ...hal.bear.bulk import BulkExchange
from ...hal.bear.bus import BearBus, BusError
from ...hal.bear.configuration import Hardware, MotorSettings
from ...hal.bear.driver import LISTENING
from ...hal.bear.measurement import READ
from ...hal.bear.motor_loop import WRITE
from ...hal.bear.protocol import Mode, Torque
from ...hal.bear.watchdog import damping_frame
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ...robots.transmission import TransmissionMap

STATUS = (
    "torque_enable", "present_position", "present_velocity", "present_iq", "input_voltage",
    "winding_temperature", "mode", "limit_i_max", "watchdog_timeout",
)  # fmt: skip
"""Registers that ``status`` reads of every drive."""
STILL = 0.005
"""A drive that moves further while it is calibrated is not still [rad]."""
MAX_JOG = 0.5
"""Largest motion of ``jog`` [rad]."""
FASTEST_ON_BENCH = 8.0
"""A motor that turns faster in a test of single motors is damped [rad/s]."""
_READINGS = 100
_STOPS = 5


@dataclass(frozen=True)
class FoundDrive:
    """A drive that answers: its address, its motor's name in the file, its versions, and the error it reports."""

    device: int
    motor: str
    version: str
    problem: str


def scan(bus: BearBus, hardware: Hardware, devices: Sequence[int]) -> list[FoundDrive]:
    """Ping those addresses, once each; nothing else is sent.

    Raises:
        BusError: somebody else sends on the bus.
    """
    if bus.listen(LISTENING):
        raise BusError("another program or adapter sends instructions on the bus: stop it first")
    names = {motor.id: name for name, motor in hardware.motors.items()}
    return [
        FoundDrive(device, names.get(device, ""), reply.data.hex(" "), reply.problem)
        for device, reply in bus.scan(devices).items()
    ]


def status(bus: BearBus, hardware: Hardware) -> list[dict[str, Any]]:
    """Read ``STATUS`` of every drive of the file; a drive that is silent has an ``error`` instead.

    Nothing is written.
    """
    rows: list[dict[str, Any]] = []
    for name, motor in hardware.motors.items():
        row: dict[str, Any] = {"motor": name, "id": motor.id}
        try:
            row |= bus.read(motor.id, *STATUS)
            row["trouble"] = bus.ping(motor.id).problem
        except BusError as error:
            row["error"] = str(error)
        rows.append(row)
    return rows


def calibrate(
    bus: BearBus, hardware: Hardware, robot: RobotDescription, pose: Array
) -> dict[str, float]:
    """Return the offset of every motor [rad] if the joints are in ``pose`` now [rad], (n_joints,).

    Positions are read and nothing is written.

    Raises:
        BusError: a drive is silent, is switched on, or moves.
    """
    wanted = np.zeros(len(robot.joints))
    TransmissionMap(robot).motor_motion(pose, wanted)
    offsets: dict[str, float] = {}
    for k, name in enumerate(robot.transmission.motors):
        motor = hardware.motors[name]
        if bus.read(motor.id, "torque_enable")["torque_enable"] == Torque.ON:
            raise BusError(f"drive {name} is switched on; calibrate with all drives off")
        read = [
            bus.read(motor.id, "present_position")["present_position"] for _ in range(_READINGS)
        ]
        if max(read) - min(read) > STILL:
            raise BusError(
                f"drive {name} moved by {max(read) - min(read):.3f} rad: hold the robot still"
            )
        offsets[name] = motor.sign * float(np.mean(read)) - wanted.item(k)
    return offsets


def stop(bus: BearBus, hardware: Hardware) -> list[str]:
    """Put all drives into damping; gives the motors of which it is not certain that they are.

    Sends one instruction to all drives, several times, and reads back.
    """
    frame = damping_frame([motor.id for motor in hardware.motors.values()])
    for _ in range(_STOPS):
        bus.port.write(frame)
    unsure = []
    for name, motor in hardware.motors.items():
        try:
            state = bus.read(motor.id, "torque_enable")["torque_enable"]
        except BusError:
            state = -1.0
        if state != Torque.DAMPING:
            unsure.append(name)
    return unsure


def jog(
    bus: BearBus, hardware: Hardware, name: str, angle: float, seconds: float,
    next_cycle: Callable[[], bool],
) -> Iterator[tuple[float, float]]:  # fmt: skip
    """Move one motor by ``angle`` [rad] and back within ``seconds``; all others stay as they are.

    Its current is limited to ``soft_start.current``, by its register and by how far the goal is from
    where it is. It ends in damping, whatever happens.

    Args:
        bus: the bus.
        hardware: limits.
        name: the motor.
        angle: at most ``MAX_JOG``, within the motor's ``low`` and ``high``.
        seconds: there and back.
        next_cycle: waits for the next cycle, and returns whether to go on.

    Yields:
        The motor's goal and its angle [rad], after every exchange.

    Raises:
        BusError: the motor or the angle is not allowed, the drive does not do what it should, or
            somebody let go of the dead man's switch.
    """
    motor = _motor(hardware, name)
    if not 0.0 < abs(angle) <= MAX_JOG:
        raise BusError(f"jog by 0 to {MAX_JOG:g} rad, not by {angle:g}")
    current = hardware.soft_start.current
    start = motor.sign * bus.read(motor.id, "present_position")["present_position"] - motor.zero
    for end in (start, start + angle):
        low, high = motor.range
        if not low <= end <= high:
            raise BusError(f"{name} would be at {end:.3f} rad, beyond {low:g} to {high:g}")
    stiffness = current / abs(angle)  # A/rad: the whole current if it did not move at all
    count = max(2, math.ceil(seconds / hardware.bus.period))
    goal = np.zeros(1)
    with PoweredDrives(bus, hardware, [name], current, stiffness, 0.05 * stiffness) as drives:
        for k in range(1, count + 1):
            goal[0] = start + angle * 0.5 * (1.0 - math.cos(2.0 * math.pi * k / count))
            drives.exchange(goal)
            if not next_cycle():
                raise BusError("the dead man's switch was let go")
            yield goal.item(0), drives.position.item(0)


class PoweredDrives:
    """Some drives under power, in a ``with`` statement; it ends in damping, whatever happens.

    All of them hold where they are at first. Other drives are not written to; those that are
    ``watched`` besides are read.

    Args:
        bus: the bus.
        hardware: addresses and limits.
        names: the motors that are switched on.
        current: the limit of each, in its register [A].
        stiffness, damping: of the drives' own loops [A/rad, A s/rad].
        watched: the motors that are read, among them ``names``; by default only those.

    Attributes:
        position, velocity, current: of the ``watched`` motors in the description's directions
            [rad, rad/s, A].

    Raises:
        BusError: a drive does not do what it should, or turns faster than ``FASTEST_ON_BENCH``.
    """

    def __init__(
        self, bus: BearBus, hardware: Hardware, names: Sequence[str], current: float,
        stiffness: float = 0.0, damping: float = 0.0, watched: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._bus, self._hardware, self._names = bus, hardware, tuple(names)
        self.watched = tuple(watched) or self._names
        self._rows = [self.watched.index(name) for name in self._names]
        self._settings = [_motor(hardware, name) for name in self._names]
        all_settings = [_motor(hardware, name) for name in self.watched]
        self._sign = np.array([float(motor.sign) for motor in all_settings])
        self._zero = np.array([motor.zero for motor in all_settings])
        self._low, self._high = np.array([motor.range for motor in self._settings]).T
        self._registers = {
            "mode": Mode.DIRECT_FORCE,
            "limit_i_max": current,
            "watchdog_timeout": round(1e6 * hardware.drives.watchdog),
            "p_gain_direct_force": min(1000.0, stiffness),
            "i_gain_direct_force": 0.0,
            "d_gain_direct_force": min(1000.0, damping),
        }
        self._bulk = BulkExchange(bus, [motor.id for motor in all_settings], READ[:3], WRITE)
        self.position, self.velocity, self.current = (np.zeros(len(self.watched)) for _ in range(3))

    def __enter__(self) -> Self:
        bus = self._bus
        if bus.listen(LISTENING):
            raise BusError(
                "another program or adapter sends instructions on the bus: stop it first"
            )
        for name, motor in zip(self._names, self._settings, strict=True):
            bus.write(motor.id, {"torque_enable": Torque.OFF})
            condition = bus.ping(motor.id).error_byte
            if is_critical(condition):
                raise BusError(f"drive {name}: {describe_conditions(condition)}")
            bus.verify(motor.id, self._registers)
        try:
            self._bulk.goals[:, 1] = [
                bus.read(_motor(self._hardware, name).id, "present_position")["present_position"]
                for name in self.watched
            ]
            self._bulk.exchange()
            for motor in self._settings:
                bus.write(motor.id, {"torque_enable": Torque.ON})
            self._take()
        except BaseException:
            self._damp()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._damp()

    def exchange(
        self, position: Array | None = None, velocity: Array | None = None, current: Array | None = None,
    ) -> None:  # fmt: skip
        """Give goals to the drives that are on, each (n,) [rad, rad/s, A], and measure all.

        Without a ``position`` the goal stays; without the others it is zero.
        """
        rows, goals = self._rows, self._bulk.goals
        sign = self._sign[rows]
        goals[rows, 0] = 0.0 if current is None else sign * current
        if position is not None:
            within = np.clip(position, self._low, self._high)
            goals[rows, 1] = sign * (within + self._zero[rows])
        goals[rows, 2] = 0.0 if velocity is None else sign * velocity
        self._bulk.exchange()
        self._take()

    def _take(self) -> None:
        bulk = self._bulk
        self.position[:] = self._sign * bulk.values[:, 0] - self._zero
        self.velocity[:] = self._sign * bulk.values[:, 1]
        self.current[:] = self._sign * bulk.values[:, 2]
        for name, row in zip(self._names, self._rows, strict=True):
            if bulk.ages.item(row) >= self._hardware.bus.lost_cycles:
                raise BusError(f"drive {name} does not answer any more")
            condition = int(bulk.error_bytes.item(row))
            if is_critical(condition):
                raise BusError(f"drive {name}: {describe_conditions(condition)}")
            if abs(self.velocity.item(row)) > FASTEST_ON_BENCH:
                raise BusError(
                    f"drive {name} turned at {self.velocity.item(row):.1f} rad/s and was damped: "
                    f"{FASTEST_ON_BENCH:g} are allowed on the bench"
                )

    def _damp(self) -> None:
        unsure = []
        for motor in self._settings:
            for _ in range(_STOPS):
                self._bus.write(motor.id, {"torque_enable": Torque.DAMPING})
        for name, motor in zip(self._names, self._settings, strict=True):
            # The answer also tells that the bytes have left: closing a port may discard them.
            if self._bus.read(motor.id, "torque_enable")["torque_enable"] != Torque.DAMPING:
                unsure.append(name)
        if unsure:
            raise BusError(
                f"drive {', '.join(unsure)} is not certain to be in damping: switch its supply off"
            )


def _motor(hardware: Hardware, name: str) -> MotorSettings:
    found = hardware.motors.get(name)
    if found is None:
        raise BusError(f"there is no motor {name!r} in the file: {', '.join(hardware.motors)}")
    return found
