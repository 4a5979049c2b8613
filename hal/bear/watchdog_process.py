"""The program of the watchdog's process: it damps the drives when the graph hangs or dies, or when
`aloft robot estop` asks for it.

It knows nothing of aloft: it gets the open port, some shared memory and the bytes that damp. So it starts fast, and nothing that the graph imports can fail in it.

    python watchdog_process.py SOCKET_FD PORT_FD MEMORY_FD STOPS_FD FRAME_IN_HEX
"""

from __future__ import annotations

import mmap
import os
import socket
import struct
import sys
import time
from contextlib import suppress

UNTIL, TRIPPED, CLOSING, ASKED = 0, 8, 16, 24
"""Offsets of the unsigned numbers of 8 bytes in the shared memory. The first is the time until which the graph may be
left alone, by the monotonic clock [ns]; zero before there is one."""
SIZE = 32
LASTING = 2.0
"""Time for which damping is commanded again and again [s]."""


def main() -> int:
    """Watch until the graph closes, hangs or dies."""
    parents_socket, port, memory, stops = map(int, sys.argv[1:5])
    frame = bytes.fromhex(sys.argv[5])
    parent = os.getppid()
    with mmap.mmap(memory, SIZE) as shared, socket.socket(fileno=stops) as listening:
        listening.setblocking(False)

        def read(place: int) -> int:
            return int(struct.unpack_from("Q", shared, place)[0])

        os.write(parents_socket, b"ready\n")
        while not read(CLOSING):
            with suppress(OSError):  # nobody asks
                _, who = listening.recvfrom(16)
                os.write(
                    port, frame
                )  # the graph's own process goes on with it in its next exchange
                struct.pack_into("Q", shared, ASKED, 1)
                listening.sendto(b"damped", who)
            until = read(UNTIL)
            died = os.getppid() != parent
            if died or (until and time.monotonic_ns() > until):
                struct.pack_into("Q", shared, TRIPPED, 1)
                end = time.monotonic() + LASTING
                while time.monotonic() < end and (died or not read(CLOSING)):
                    with suppress(OSError):  # a full or a lost port; the next try may get through
                        os.write(port, frame)
                    time.sleep(0.002)
                return 3
            time.sleep(0.001)
    return 0


if __name__ == "__main__":
    sys.exit(main())
