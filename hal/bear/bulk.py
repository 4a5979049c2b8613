"""One exchange with all actuators: goals out, measurements back, once a control cycle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...blocks.signals.robot import HEALTHY
from .bus import BearBus, BusError, is_answer, register_of
from .protocol import BROADCAST, HEADER, LONGEST, Instruction, Register, checksum

_LONGEST_LIST = 15
"""Four bits hold the number of registers that are read, four those that are written."""


class BulkExchange:
    """The same registers of the same actuators, written and read in one frame, again and again.

    The frame ``FF FF FE length 12 | N | R<<4|W | addresses read | addresses written | N times the
    device and W values | checksum`` is made once; a cycle writes the goals into it. The answers
    come one frame an actuator, in the order of the devices; they are read into memory that is made
    once. A cycle makes no array.

    Args:
        bus: the bus; its counts are kept up to date.
        devices: the actuators' addresses, N of them.
        read: status registers to read, R of them.
        write: status registers to write, W of them.

    Attributes:
        goals: what the next exchange writes, (N, W); numbers that are no goal (not finite) are
            refused by ``exchange``.
        values: what was read last, (N, R); an actuator that did not answer keeps its last values.
        error_bytes: of the last answers, (N,).
        ages: exchanges since an actuator last answered, (N,); zero for a fresh value.
        plausible: the lowest and highest value of every register that is read, (R, 2). The checksum
            has 8 bits, so pieces of damaged answers can pass for one; an answer with another value
            than these, or one that is not finite, counts as damaged.
        largest_step: how much a value may change from exchange to exchange, (R,).

    Raises:
        BusError: the frame would be too long, or a register is no status register.
    """

    def __init__(
        self, bus: BearBus, devices: Sequence[int], read: Sequence[str], write: Sequence[str]
    ) -> None:
        self.bus = bus
        self.devices = tuple(devices)
        self.read = tuple(_status(name) for name in read)
        self.write = tuple(_status(name, written=True) for name in write)
        n, r, w = len(self.devices), len(self.read), len(self.write)
        length = 4 + r + w + n + 4 * w * n
        if length > LONGEST or r > _LONGEST_LIST or w > _LONGEST_LIST or not n or not r:
            raise BusError(
                f"a bulk exchange of {n} actuators with {r} registers read and {w} written takes "
                f"{length} bytes; it may take {LONGEST}, with 1 to {_LONGEST_LIST} registers read "
                "and up to 15 written: leave some out, or exchange in two halves"
            )
        head = bytes((BROADCAST, length, Instruction.BULK, n, r << 4 | w))
        head += bytes(register.address for register in (*self.read, *self.write))
        goal = np.dtype([("device", "u1"), ("goals", "<f4", (w,))])
        self._frame = bytearray(HEADER + head + bytes(n * goal.itemsize) + b"\0")
        body = np.frombuffer(self._frame, goal, n, len(HEADER) + len(head))
        body["device"] = self.devices
        self._packed = body["goals"]
        self._whole_goals = [k for k, register in enumerate(self.write) if register.kind == "u32"]
        self._packed_whole = body["goals"].view("<u4") if w else body["goals"]
        self._length = 4 * r + 2
        self._reply_size = self._length + 4
        self._answer = bytearray(n * self._reply_size)
        self._reply = bytearray(self._reply_size)
        self._numbers = np.frombuffer(self._reply, "<f4", r, 5)
        self._whole_numbers = np.frombuffer(self._reply, "<u4", r, 5)
        self._whole_values = [k for k, register in enumerate(self.read) if register.kind == "u32"]
        self.goals = np.zeros((n, w))
        self.values = np.zeros((n, r))
        self.error_bytes = np.full(n, HEALTHY, dtype=np.uint8)
        self.ages = np.zeros(n, dtype=np.int64)
        self.plausible = np.array([[-1e30, 1e30]] * r)
        self.largest_step = np.full(r, np.inf)
        self.known = np.zeros(n, dtype=np.bool_)
        """True for actuators that have answered at all, (n_actuators,)."""

    def exchange(self, reply_time: float | None = None) -> int:
        """Write the goals and read the registers; gives how many actuators answered.

        Args:
            reply_time: seconds that all actuators have together; by default the bus's.

        Raises:
            BusError: a goal is not finite. Nothing is sent then.
        """
        self._pack()
        bus = self.bus
        waiting = bus.port.in_waiting
        if waiting:  # answers that came too late, or what somebody else sends
            bus.port.timeout = 0.0
            bus.overhear(bus.port.read(waiting))
        bus.port.write(self._frame)
        received = self._receive(bus.reply_time if reply_time is None else reply_time)
        answered = self._unpack(received)
        if answered < len(self.devices) and received:
            bus.overhear(memoryview(self._answer)[:received])
        return answered

    def _pack(self) -> None:
        for row in range(len(self.devices)):
            for column in range(len(self.write)):
                value = float(self.goals[row, column])
                if value - value != 0.0:
                    raise BusError(
                        f"the goal {self.write[column].name} of actuator {self.devices[row]} is "
                        f"{value}: nothing was sent"
                    )
        self._packed[...] = self.goals
        for column in self._whole_goals:
            self._packed_whole[:, column] = self.goals[:, column]
        frame = self._frame
        frame[-1] = checksum(memoryview(frame)[2:-1])

    def _receive(self, reply_time: float) -> int:
        """Receive into ``_answer``; returns how many bytes came in time."""
        port, answer, count = self.bus.port, memoryview(self._answer), 0
        end = self.bus.now() + reply_time
        while count < len(answer):
            left = end - self.bus.now()
            if left <= 0.0:
                break
            port.timeout = left
            part = port.read(len(answer) - count)
            answer[count : count + len(part)] = part
            count += len(part)
        answer.release()
        return count

    def _unpack(self, received: int) -> int:
        """Take over the good answers; returns how many there are."""
        answered = place = 0
        self.ages += 1
        answer = memoryview(self._answer)
        for row, device in enumerate(self.devices):
            start = self._find(answer, received, place, device)
            if start < 0:
                self.bus.counts.silent += 1
                continue
            place = start + self._reply_size
            self._reply[:] = answer[start:place]
            if self._is_plausible(row):
                self._take(row)
                answered += 1
            else:
                self.bus.counts.damaged += 1
        answer.release()
        return answered

    def _find(self, answer: memoryview, received: int, place: int, device: int) -> int:
        """Find the start of a device's whole answer, from ``place`` on; -1 where there is none."""
        size = self._reply_size
        for start in range(place, received - size + 1):
            if (
                answer[start] == 0xFF
                and answer[start + 1] == 0xFF
                and answer[start + 2] == device
                and answer[start + 3] == self._length
                and is_answer(answer[start + 4])
            ):
                if checksum(answer[start + 2 : start + size - 1]) == answer[start + size - 1]:
                    return start
                self.bus.counts.damaged += 1
        return -1

    def _is_plausible(self, row: int) -> bool:
        """Check whether the answer can be one of this actuator."""
        numbers, whole, last = self._numbers, self._whole_numbers, self.values[row]
        waited = self.ages.item(row)  # this exchange is counted already
        for column in range(len(self.read)):
            if column in self._whole_values:
                value = float(whole.item(column))
            else:
                value = numbers.item(column)
            low, high = self.plausible.item(column, 0), self.plausible.item(column, 1)
            if not low <= value <= high:  # also where it is not finite
                return False
            step = abs(value - last.item(column))
            if self.known[row] and step > self.largest_step.item(column) * waited:
                return False
        return True

    def _take(self, row: int) -> None:
        self.values[row] = self._numbers
        for column in self._whole_values:
            self.values[row, column] = self._whole_numbers[column]
        self.error_bytes[row] = self._reply[4]
        self.ages[row] = 0
        self.known[row] = True


def _status(name: str, *, written: bool = False) -> Register:
    register = register_of(name)
    if register.area != "status":
        raise BusError(f"{name} is a configuration register; a bulk exchange has status registers")
    if written and not register.writable:
        raise BusError(f"{name} can only be read")
    return register
