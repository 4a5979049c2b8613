"""What is done with drives on a bench, one safe step at a time; each function says what it sends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...blocks.signals.robot import describe_conditions, is_critical
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ...robots.transmission import TransmissionMap
from .bulk import BulkExchange
from .bus import BearBus, BusError
from .configuration import Hardware, MotorSettings
from .driver import LISTENING
from .motor_loop import WRITE
from .protocol import Mode, Torque
from .watchdog import damping_frame

STATUS = (
    "torque_enable", "present_position", "present_velocity", "present_iq", "input_voltage",
    "winding_temperature", "mode", "limit_i_max", "watchdog_timeout",
)  # fmt: skip
"""What ``status`` reads of every drive."""
STILL = 0.005
"""A drive that moves further while it is calibrated is not still [rad]."""
MAX_JOG = 0.5
"""How far ``jog`` moves a motor at most [rad]."""
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
    """The offset of every motor [rad] if the joints are in ``pose`` now [rad], (n_joints,).

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
        next_cycle: waits for the next cycle, and says whether to go on.

    Yields:
        The motor's goal and its angle [rad], after every exchange.

    Raises:
        BusError: the motor or the angle is not allowed, the drive does not do what it should, or
            somebody let go of the dead man's switch.
    """
    motor = _motor(hardware, name)
    if not 0.0 < abs(angle) <= MAX_JOG:
        raise BusError(f"jog by 0 to {MAX_JOG:g} rad, not by {angle:g}")
    drives, current = hardware.drives, hardware.soft_start.current
    if bus.listen(LISTENING):
        raise BusError("another program or adapter sends instructions on the bus: stop it first")
    bus.write(motor.id, {"torque_enable": Torque.OFF})
    reply = bus.ping(motor.id)
    if is_critical(reply.error_byte):
        raise BusError(f"drive {name}: {describe_conditions(reply.error_byte)}")
    start = motor.sign * bus.read(motor.id, "present_position")["present_position"] - motor.zero
    for end in (start, start + angle):
        low, high = motor.range
        if not low <= end <= high:
            raise BusError(f"{name} would be at {end:.3f} rad, beyond {low:g} to {high:g}")
    stiffness = current / abs(angle)  # A/rad: the whole current if it did not move at all
    bus.verify(
        motor.id,
        {
            "mode": Mode.DIRECT_FORCE,
            "limit_i_max": current,
            "watchdog_timeout": round(1e6 * drives.watchdog),
            "p_gain_direct_force": min(1000.0, stiffness),
            "i_gain_direct_force": 0.0,
            "d_gain_direct_force": min(1000.0, 0.05 * stiffness),
        },
    )
    bulk = BulkExchange(bus, [motor.id], ("present_position",), WRITE)
    count = max(2, math.ceil(seconds / hardware.bus.period))
    try:
        bulk.goals[0, 1] = motor.sign * (start + motor.zero)
        bulk.exchange()
        bus.write(motor.id, {"torque_enable": Torque.ON})
        for k in range(1, count + 1):
            goal = start + angle * 0.5 * (1.0 - math.cos(2.0 * math.pi * k / count))
            bulk.goals[0, 1] = motor.sign * (goal + motor.zero)
            bulk.exchange()
            if bulk.ages.item(0) >= hardware.bus.lost_cycles:
                raise BusError(f"drive {name} does not answer any more")
            condition = int(bulk.error_bytes.item(0))
            if is_critical(condition):
                raise BusError(f"drive {name}: {describe_conditions(condition)}")
            if not next_cycle():
                raise BusError("the dead man's switch was let go")
            yield goal, motor.sign * bulk.values.item(0) - motor.zero
    finally:
        for _ in range(_STOPS):
            bus.write(motor.id, {"torque_enable": Torque.DAMPING})
        # The answer also tells that the bytes have left: closing a port may discard them.
        if bus.read(motor.id, "torque_enable")["torque_enable"] != Torque.DAMPING:
            raise BusError(f"drive {name} is not certain to be in damping: switch its supply off")


def _motor(hardware: Hardware, name: str) -> MotorSettings:
    found = hardware.motors.get(name)
    if found is None:
        raise BusError(f"there is no motor {name!r} in the file: {', '.join(hardware.motors)}")
    return found
