"""The emulated devices as their ports see them: BEAR actuators, their bus, and the sensor board."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ...blocks.signals import ImuReading
from ...blocks.signals.robot import HEALTHY
from ...robots.robot_description import SensorMount
from ..bear.protocol import (
    BROADCAST,
    CONFIG,
    STATUS,
    BusFrame,
    FrameReader,
    Instruction,
    Mode,
    Register,
    Torque,
    checksum,
    frame_bytes,
)
from ..bear.sense_board import END, LENGTH, START, BoardMode
from ..sensors.imu import Imu

CORRUPT, HOT, ENCODER, WATCHDOG, LIMIT, HARDWARE, FLASH = range(7)
"""The bits of the error byte."""
VERSION = b"\x01\x00\x02\x00"
"""The answer to a ping; the meaning of the four bytes is not published."""

_STATUS = {register.address: register for register in STATUS.values()}
_CONFIG = {register.address: register for register in CONFIG.values()}


@lru_cache(maxsize=64)
def _layout(addresses: bytes) -> tuple[struct.Struct, tuple[Register, ...]]:
    """Return the layout of these status registers' values in an answer or an instruction."""
    unknown = Register("unknown", 0xFF, "status", writable=False)
    registers = tuple(_STATUS.get(address, unknown) for address in addresses)
    kinds = "".join("f" if register.kind == "f32" else "I" for register in registers)
    return struct.Struct(f"<{kinds}"), registers


@dataclass
class EmulatedActuator:
    """One actuator, without its mechanics: whoever owns it sets what the sensors measure, and reads
    what the drive is to do.

    It has the quirks that are known of the real ones: it ignores a goal beyond a limit instead of
    clamping it, sends no answer to a write, ignores configuration while its torque is on, sets its
    watchdog's error when nothing was written for ``watchdog_timeout``, switches off for good on an
    error, and warns of damaged packets in its next answer only.

    Attributes:
        device: its address.
        status, config: the registers' values, by name.
        stopped: whether the emergency stop's line is pressed.
        saves: how often the configuration was saved to flash.
        errors: the bits of errors that are set.
        corrupt: whether a packet arrived damaged since the last answer.
        silent_time: since something was written last [s].
        has_watchdog: whether it looks at that.
        fixed: registers that it does not take, as if they were damaged.
    """

    device: int
    status: dict[str, float] = field(
        default_factory=lambda: {name: register.default for name, register in STATUS.items()}
    )
    config: dict[str, float] = field(
        default_factory=lambda: {name: register.default for name, register in CONFIG.items()}
    )
    stopped: bool = False
    saves: int = 0
    errors: int = 0
    corrupt: bool = False
    silent_time: float = 0.0
    has_watchdog: bool = True
    fixed: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        self.config["id"] = self.device
        self.status.setdefault("input_voltage", 14.8)
        self.status["input_voltage"] = self.status["input_voltage"] or 14.8
        self.status["unknown"] = 0.0  # what a register that does not exist reads
        for sensor in ("winding", "powerstage", "ic"):
            self.status[f"{sensor}_temperature"] = 25.0

    @property
    def error_byte(self) -> int:
        """The error byte of the next answer."""
        hot = self.status["winding_temperature"] > self.config["temp_limit_low"]
        return HEALTHY | self.errors | hot << HOT | self.corrupt << CORRUPT

    @property
    def driving(self) -> bool:
        """True if the drive follows its goals."""
        return self.status["torque_enable"] == Torque.ON and not self.errors

    @property
    def damping(self) -> bool:
        """True if the windings are shorted, which brakes."""
        return self.status["torque_enable"] == Torque.DAMPING

    def fail(self, bit: int) -> None:
        """Set an error's bit: the torque goes off until the error is cleared."""
        self.errors |= 1 << bit
        if self.status["torque_enable"] == Torque.ON:
            self.status["torque_enable"] = Torque.ERROR

    def garble(self) -> None:
        """Note that a packet arrived damaged, for the next answer."""
        self.corrupt = True

    def advance(self, seconds: float) -> None:
        """Let time pass: the watchdog, voltage and temperature are looked at."""
        self.silent_time += seconds
        timeout = 1e-6 * self.config["watchdog_timeout"]
        in_mode = self.config["mode"] in (Mode.TORQUE, Mode.DIRECT_FORCE)
        if (
            self.has_watchdog
            and timeout
            and in_mode
            and self.driving
            and self.silent_time > timeout
        ):
            self.fail(WATCHDOG)
        if self.stopped:
            self.fail(WATCHDOG)
        voltage = self.status["input_voltage"]
        if not self.config["min_voltage"] <= voltage <= self.config["max_voltage"]:
            self.fail(HARDWARE)
        if self.status["winding_temperature"] > self.config["temp_limit_high"]:
            self.fail(HARDWARE)
        position = self.status["present_position"]
        low, high = self.config["limit_position_min"], self.config["limit_position_max"]
        if self.driving and not low <= position <= high and self.config["mode"] == Mode.POSITION:
            self.fail(LIMIT)

    def answer(self, frame: BusFrame) -> bytes | None:
        """Return the data of the answer to an instruction for this actuator; ``None`` if it is silent."""
        data = frame.data
        match frame.code:
            case Instruction.PING:
                return VERSION
            case Instruction.READ_STATUS:
                return self._read(data, _STATUS, self.status)
            case Instruction.READ_CONFIG:
                return self._read(data, _CONFIG, self.config)
            case Instruction.WRITE_STATUS:
                self._write(data, _STATUS, self.status)
            case Instruction.WRITE_CONFIG:
                if not self.driving:
                    self._write(data, _CONFIG, self.config)
            case Instruction.SAVE_CONFIG:
                self.saves += 1
                self.status["torque_enable"] = Torque.OFF
        return None

    def bulk_read(self, addresses: bytes) -> bytes:
        """Return the status registers of a bulk exchange's answer."""
        layout, registers = _layout(addresses)
        status = self.status
        return layout.pack(
            *(
                status[register.name] if register.kind == "f32" else int(status[register.name])
                for register in registers
            )
        )

    def bulk_write(self, addresses: bytes, values: bytes) -> None:
        """Take over the goals of a bulk exchange."""
        self.silent_time = 0.0
        layout, registers = _layout(addresses)
        for register, value in zip(registers, layout.unpack(values), strict=True):
            self._set(register, value, self.status)

    def answered(self) -> None:
        """Note that an answer with the error byte has gone out."""
        self.corrupt = False

    def _read(
        self, addresses: bytes, known: dict[int, Register], values: dict[str, float]
    ) -> bytes:
        found = b""
        for address in addresses:
            register = known.get(address)
            found += register.pack(values[register.name]) if register else bytes(4)
        return found

    def _write(self, data: bytes, known: dict[int, Register], values: dict[str, float]) -> None:
        self.silent_time = 0.0
        for start in range(0, len(data) - 4, 5):
            register = known.get(data[start])
            if register is None or not register.writable:
                continue
            self._set(register, register.unpack(data[start + 1 : start + 5]), values)

    def _set(self, register: Register, value: float, values: dict[str, float]) -> None:
        """Take over a value, unless it is beyond what the actuator takes."""
        name = register.name
        if (
            not register.writable
            or name in self.fixed
            or not register.least <= value <= register.most
        ):
            return
        if name == "torque_enable":
            self._enable(int(value))
        elif not self._beyond(name, value):
            values[name] = value

    def _beyond(self, name: str, value: float) -> bool:
        """Check whether a goal is beyond its limit; the actuator then keeps the last one."""
        if name == "goal_iq":
            return abs(value) > self.config["limit_i_max"]
        if name == "goal_velocity" and self.config["mode"] != Mode.DIRECT_FORCE:
            return abs(value) > self.config["limit_velocity_max"]
        if name == "goal_position" and self.config["mode"] == Mode.POSITION:
            low, high = self.config["limit_position_min"], self.config["limit_position_max"]
            return not low <= value <= high
        return False

    def _enable(self, wanted: int) -> None:
        if wanted == Torque.OFF and not self.stopped:
            self.errors = 0  # errors are cleared by switching off
        if wanted == Torque.ON and self.errors:
            return
        if wanted == Torque.DAMPING:
            self.errors |= 1 << WATCHDOG
        if wanted != Torque.ERROR:
            self.status["torque_enable"] = wanted


AnswerFault = Callable[[int, bytes], bytes]
"""Takes an answer's device and bytes, and returns the bytes that really travel."""


def unchanged(device: int, answer: bytes) -> bytes:
    """No fault: the answer arrives as it was sent."""
    return answer


class EmulatedBus:
    """All actuators of a bus.

    A frame with a wrong checksum is answered by nobody, and the actuator that it was for reports it
    in its next answer. A bulk exchange is answered by each actuator in the order of its list; those
    that are not on the bus are silent.

    Attributes:
        fault: what happens to every answer on its way.
    """

    def __init__(
        self, actuators: Iterable[EmulatedActuator], fault: AnswerFault = unchanged
    ) -> None:
        self.actuators = {actuator.device: actuator for actuator in actuators}
        self.fault = fault
        self._reader = FrameReader()

    def receive(self, data: bytes) -> bytes:
        """Take the bytes that the master sends; returns the bytes that it receives."""
        damaged = self._reader.damaged
        frames = self._reader.feed(data)
        if self._reader.damaged > damaged:
            for actuator in self.actuators.values():
                actuator.garble()
        return b"".join(self._answer(frame) for frame in frames)

    def _answer(self, frame: BusFrame) -> bytes:
        if frame.device == BROADCAST:
            return self._bulk(frame.data) if frame.code == Instruction.BULK else b""
        actuator = self.actuators.get(frame.device)
        if actuator is None:
            return b""
        data = actuator.answer(frame)
        return b"" if data is None else self._send(actuator, data)

    def _send(self, actuator: EmulatedActuator, data: bytes) -> bytes:
        answer = frame_bytes(actuator.device, actuator.error_byte, data)
        actuator.answered()
        return self.fault(actuator.device, answer)

    def _bulk(self, data: bytes) -> bytes:
        if len(data) < 2:
            return b""
        count, reads, writes = data[0], data[1] >> 4, data[1] & 0x0F
        start = 2 + reads + writes
        read, write = data[2 : 2 + reads], data[2 + reads : start]
        size = 1 + 4 * writes
        if len(data) != start + count * size:
            return b""
        answers = []
        for k in range(count):
            part = data[start + k * size : start + (k + 1) * size]
            actuator = self.actuators.get(part[0])
            if actuator is None:
                continue
            actuator.bulk_write(write, part[1:])
            if reads:
                answers.append(self._send(actuator, actuator.bulk_read(read)))
        return b"".join(answers)


_COMMAND = 5


class EmulatedBoard:
    """BRUCE's sensor board: it sends a packet whenever ``packet`` is called while it streams.

    It streams from the start, as the real one does after it was told to once. A command is taken
    when its checksum is right. Calibration is acknowledged by one packet whose switches' byte is
    0xFF; the bias that the real board would store is not simulated.

    Attributes:
        mode: the mode it was told.
        cooling: the cooling's strength it was told, 0 to 10.
    """

    def __init__(self) -> None:
        self.mode = BoardMode.NOMINAL
        self.cooling = 0
        self._imu = Imu("imu", SensorMount(kind="imu", link=""))
        self._pending = bytearray()
        self._calibrating = False

    def receive(self, data: bytes) -> None:
        """Take bytes that the host sends."""
        pending = self._pending
        pending += data
        while len(pending) >= _COMMAND:
            command = bytes(pending[:_COMMAND])
            whole = command[0] == START and command[1] == 3 and command[4] == END
            if whole and checksum(command[1:3]) == command[3]:
                self.mode, self.cooling = BoardMode(command[2] & 3), command[2] >> 2
                self._calibrating = self.mode is BoardMode.CALIBRATE
                del pending[:_COMMAND]
            else:
                del pending[:1]

    def packet(self, imu: ImuReading, closed: np.ndarray, mounted: bytes = b"") -> bytes:
        """Return the next packet, with the bytes of mounted sensors; empty while the board does not stream."""
        if self._calibrating:
            self._calibrating, self.mode, contacts = False, BoardMode.NOMINAL, 0xFF
        elif self.mode is not BoardMode.NOMINAL:
            return b""
        else:
            contacts = 0x80 | sum(1 << bit for bit, each in enumerate(closed.tolist()) if each)
        numbers = self._imu.to_packet(imu)
        body = bytes((LENGTH + len(mounted),)) + numbers + bytes((contacts,)) + mounted
        return bytes((START,)) + body + bytes((checksum(body), END))
