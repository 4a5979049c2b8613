"""Watches the graph from a process of its own, which can damp the drives without the graph."""

from __future__ import annotations

import mmap
import os
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from .bus import BusError
from .frames import BROADCAST, Instruction, frame_bytes
from .registers import STATUS, Torque
from .watchdog_process import CLOSING, READY, SIZE, TRIPPED, UNTIL

_STARTING = 10.0
"""How long the process may take to start [s]."""


def damping_frame(devices: list[int]) -> bytes:
    """The instruction that puts all these drives into damping; nobody answers it."""
    register = STATUS["torque_enable"]
    goals = b"".join(bytes((device,)) + register.pack(Torque.DAMPING) for device in devices)
    head = bytes((len(devices), 0x01, register.address))
    return frame_bytes(BROADCAST, Instruction.BULK, head + goals)


class Watchdog:
    """A process that commands damping when ``beat`` was not called for ``limit`` seconds, when
    links have brought no commands for ``silence`` seconds, or when this process has died. It shares
    the open port, so no opening can fail then.

    It begins to count at the first beat.

    Args:
        port_fd: the file descriptor of the drives' port.
        devices: the drives' addresses.
        limit: the time without a beat [s].
        silence: the time without commands from other machines [s].

    Raises:
        BusError: the process does not start.
    """

    def __init__(
        self, port_fd: int, devices: list[int], limit: float, silence: float = 0.0
    ) -> None:
        memory_fd = os.memfd_create("aloft-watchdog")
        os.truncate(memory_fd, SIZE)
        self._memory = mmap.mmap(memory_fd, SIZE)
        self._limit, self._silence = int(limit * 1e9), int(silence * 1e9)
        program = Path(__file__).with_name("watchdog_process.py")
        frame = damping_frame(devices).hex()
        self._process = subprocess.Popen(
            [sys.executable, "-I", str(program), str(port_fd), str(memory_fd), frame],
            pass_fds=(port_fd, memory_fd),
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C in the terminal is for the graph only
        )
        os.close(memory_fd)
        end = time.monotonic() + _STARTING
        while not self._read(READY):
            if self._process.poll() is not None or time.monotonic() > end:
                self.close()
                raise BusError("the watchdog's process does not start: nothing was enabled")
            time.sleep(0.005)

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def beat(self, heard: int = 0) -> None:
        """The graph is alive.

        ``heard`` says when commands last came from another machine, by the monotonic clock [ns];
        zero where they are made here. So the process notices silent links although this one hangs.
        """
        until = time.monotonic_ns() + self._limit
        if heard:
            until = min(until, heard + self._silence)
        struct.pack_into("Q", self._memory, UNTIL, until)

    @property
    def tripped(self) -> bool:
        """Whether it has taken over and damps."""
        return bool(self._read(TRIPPED))

    def close(self) -> None:
        """End the process: the drives are in damping already, or were never on."""
        with suppress(ValueError):
            struct.pack_into("Q", self._memory, CLOSING, 1)
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _read(self, place: int) -> int:
        return int(struct.unpack_from("Q", self._memory, place)[0])
