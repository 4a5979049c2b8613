"""A twin behind two pseudo-terminals, for a driver in another process."""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from collections.abc import Callable
from typing import Self

from ..bear.protocol import BROADCAST, HEADER, LAST_DEVICE
from .twin import PulledCableError, Twin

Device = Callable[[bytes], bytes]
"""Takes what was sent to the device, and gives what it answers."""
_LONGEST_WAIT = 0.1


class PseudoTerminal:
    """Serves a device on a pseudo-terminal in a thread of its own, until it is closed.

    Attributes:
        path: what a driver opens instead of ``/dev/ttyUSB0``.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._ours, theirs = os.openpty()
        os.set_blocking(self._ours, False)
        tty.setraw(self._ours)
        tty.setraw(theirs)
        self.path = os.ttyname(theirs)
        self._theirs = theirs
        self._write_lock = threading.Lock()
        self._close_lock, self._stop_lock, self._closed = threading.Lock(), threading.Lock(), False
        self._wake, self._woken = os.pipe()
        self._thread = threading.Thread(target=self._serve, name=f"twin {self.path}", daemon=True)
        self._thread.start()

    def send(self, data: bytes) -> None:
        """Send data of the device that was not requested.

        While nobody reads and the terminal's buffer is full, this waits until ``stop`` is called.
        """
        with self._write_lock:
            while data:
                stopped, _, _ = select.select([self._wake], [self._ours], [])
                if stopped:
                    return
                try:
                    data = data[os.write(self._ours, data) :]
                except BlockingIOError:
                    continue

    def stop(self) -> None:
        """Serve no more: from now on nothing is received, and what waits to be sent is dropped."""
        with self._stop_lock:
            if not self._closed:
                os.write(self._woken, b"x")

    def close(self) -> None:
        """Close both sides: from now on reading and writing fail, as with an unplugged cable.

        More than one thread may call it, at any time: who comes later waits until all is closed.
        """
        with self._close_lock:
            if self._closed:
                return
            self.stop()
            self._thread.join()
            with self._stop_lock:
                self._closed = True
                for descriptor in (self._ours, self._theirs, self._wake, self._woken):
                    os.close(descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        while True:
            ready, _, _ = select.select([self._ours, self._wake], [], [], _LONGEST_WAIT)
            if self._wake in ready:
                return
            if self._ours in ready:
                answer = self._device(os.read(self._ours, 4096))
                if answer:
                    self.send(answer)


_SHORTEST_FRAME = 6
"""Bytes of the shortest instruction."""
_FRAME_TIMEOUT = 0.5
"""After so long without a byte the beginning of an instruction is forgotten [s]."""


class TwinServer:
    """Serves a twin's drives and sensor board until it is closed.

    In virtual time the twin's time goes on with the exchanges, and a packet of the board is there
    before the answers of the same exchange: a driver gets the same bytes in every run. In real time
    a thread lets it go on by the clock, at most as fast; where the machine is too slow for that,
    ``behind`` is its lag.

    Args:
        twin: standing.
        virtual: whether its time is virtual.
        period: of the bus [s].

    Attributes:
        bus_path, board_path: the ports to open.
        behind: lag of the twin's time behind the clock [s].
    """

    def __init__(self, twin: Twin, *, virtual: bool, period: float) -> None:
        self.twin = twin
        twin.lockstep = virtual
        self._period = period
        self._lock = threading.Lock()
        self._pending = bytearray()
        self._received = 0.0
        self._stop = threading.Event()
        self._board = PseudoTerminal(self._to_board)
        self._bus = PseudoTerminal(self._to_bus)
        self.bus_path, self.board_path = self._bus.path, self._board.path
        self.behind = 0.0
        self._pulled: list[PseudoTerminal] = []
        self._clock: threading.Thread | None = None
        if not virtual:
            self._clock = threading.Thread(target=self._run, name="twin's clock", daemon=True)
            self._clock.start()

    def close(self) -> None:
        """Close both ports."""
        self._stop.set()
        self._bus.stop()  # the clock may wait for a driver that reads no more
        self._board.stop()
        if self._clock is not None:
            self._clock.join()
        self._bus.close()
        self._board.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _to_board(self, data: bytes) -> bytes:
        with self._lock:
            self.twin.write_board(data)
        return b""

    def _to_bus(self, data: bytes) -> bytes:
        """Take what arrived; instructions are handled one by one, as they become whole."""
        now = time.monotonic()
        if (
            now - self._received > _FRAME_TIMEOUT
        ):  # the rest of an instruction will not come any more
            self._pending.clear()
        self._received = now
        self._pending += data
        answers = b""
        with self._lock:
            for instruction in self._instructions():
                answers += self.twin.read_late()
                try:
                    answer = self.twin.write_bus(instruction)
                except PulledCableError:
                    self._pull(self._bus)
                    return b""
                self._send_packets()
                answers += answer
        return answers

    def _instructions(self) -> list[bytes]:
        """Return the whole instructions among what arrived. Bytes that belong to none are skipped."""
        found: list[bytes] = []
        pending = self._pending
        while True:
            start = pending.find(HEADER)
            if start < 0:
                del pending[: max(0, len(pending) - 1)]
                return found
            del pending[:start]
            if len(pending) < 4:
                return found
            end = 4 + pending[3]
            possible = pending[2] <= LAST_DEVICE or pending[2] == BROADCAST
            if end < _SHORTEST_FRAME or not possible:
                del pending[:1]
                continue
            if len(pending) < end:
                return found
            found.append(bytes(pending[:end]))
            del pending[:end]

    def _send_packets(self) -> None:
        try:
            packets = self.twin.read_board()
        except PulledCableError:
            self._pull(self._board)
            return
        if packets:
            self._board.send(packets)

    def _pull(self, terminal: PseudoTerminal) -> None:
        """Pull a cable: its port is gone, from a thread of its own."""
        if terminal not in self._pulled:
            self._pulled.append(terminal)
            threading.Thread(target=terminal.close, daemon=True).start()

    def _run(self) -> None:
        following = time.monotonic()
        while not self._stop.is_set():
            with self._lock:
                self.twin.advance()
                self._send_packets()
                pulled = bool(self.twin.faults.active("pulled_cable"))
            if pulled:
                self._bus.close()
            following += self._period
            rest = following - time.monotonic()
            if rest > 0.0:
                time.sleep(rest)
            else:
                self.behind -= rest
                following -= rest
