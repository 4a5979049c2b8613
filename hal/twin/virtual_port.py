"""Serial ports that lead to a twin in the same process, in virtual time."""

from __future__ import annotations

from .twin import Twin


class VirtualBusPort:
    """The master's end of the bus of a twin's drives.

    Waiting takes no real time: where nothing has come, ``read`` lets ``timeout`` seconds of virtual
    time pass. So a driver with time limits runs the same way on any machine.
    """

    def __init__(self, twin: Twin) -> None:
        self.timeout: float | None = None
        self._twin = twin
        self._received = bytearray()
        self._now = 0.0

    def now(self) -> float:
        """The virtual time [s]."""
        return self._now

    @property
    def in_waiting(self) -> int:
        """How many bytes were received and not read, with those that came late."""
        self._received += self._twin.read_late()
        return len(self._received)

    def write(self, data: bytes | bytearray) -> int:
        """Send bytes to the twin; its answers are there at once."""
        self._received += self._twin.write_bus(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes; none after ``timeout`` of virtual time without any."""
        if not self._received:
            self._now += self.timeout or 0.0
            return b""
        part = bytes(self._received[:size])
        del self._received[:size]
        return part

    def reset_input_buffer(self) -> None:
        """Discard what was received and not read."""
        self._received.clear()

    def close(self) -> None:
        """Nothing to give back."""


class VirtualBoardPort(VirtualBusPort):
    """The host's end of a twin's sensor board."""

    def write(self, data: bytes | bytearray) -> int:
        """Send a command to the board."""
        self._twin.write_board(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes of what the board has sent."""
        self._received += self._twin.read_board()
        return super().read(size)
