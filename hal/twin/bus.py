"""The actuators' side of their bus: bytes in, answers out, with faults that a test may ask for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..bear.frames import BROADCAST, Frame, FrameReader, Instruction, frame_bytes
from .actuator import EmulatedActuator

Fault = Callable[[int, bytes], bytes]
"""Takes an answer's device and bytes, and returns the bytes that really travel."""


def faithful(device: int, answer: bytes) -> bytes:
    """The answer as it is."""
    return answer


class EmulatedBus:
    """All actuators of a bus.

    A frame with a wrong checksum is answered by nobody, and the actuator that it was for reports it
    in its next answer. A bulk exchange is answered by each actuator in the order of its list; those
    that are not on the bus are silent.

    Attributes:
        fault: what happens to every answer on its way.
    """

    def __init__(self, actuators: Iterable[EmulatedActuator], fault: Fault = faithful) -> None:
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

    def _answer(self, frame: Frame) -> bytes:
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
