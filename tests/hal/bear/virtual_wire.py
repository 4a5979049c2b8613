"""A serial port whose other end are emulated actuators: they answer at once, in virtual time."""

from aloft.hal.twin.devices import EmulatedBus


class VirtualWire:
    """What a driver writes to and reads from. ``last`` is what it wrote last."""

    def __init__(self, bus: EmulatedBus) -> None:
        self.bus = bus
        self.timeout: float | None = None
        self.last = b""
        self._waiting = b""
        self._now = 0.0

    def now(self) -> float:
        """The virtual time [s], which passes while somebody waits for bytes that do not come."""
        return self._now

    @property
    def in_waiting(self) -> int:
        return len(self._waiting)

    def write(self, data: bytes | bytearray) -> int:
        self.last = bytes(data)
        self._waiting += self.bus.receive(self.last)
        return len(data)

    def read(self, size: int = 1) -> bytes:
        if not self._waiting:
            self._now += self.timeout or 0.0
        part, self._waiting = self._waiting[:size], self._waiting[size:]
        return part

    def reset_input_buffer(self) -> None:
        self._waiting = b""

    def close(self) -> None:
        pass
