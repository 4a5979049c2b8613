"""A pseudo-terminal behind which an emulated device answers, so that real drivers can open it."""

from __future__ import annotations

import os
import select
import threading
import tty
from collections.abc import Callable
from typing import Self

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
        tty.setraw(self._ours)
        tty.setraw(theirs)
        self.path = os.ttyname(theirs)
        self._theirs = theirs
        self._write_lock = threading.Lock()
        self._close_lock, self._closed = threading.Lock(), False
        self._wake, self._woken = os.pipe()
        self._thread = threading.Thread(target=self._serve, name=f"twin {self.path}", daemon=True)
        self._thread.start()

    def send(self, data: bytes) -> None:
        """What the device sends without being asked."""
        with self._write_lock:
            while data:
                written = os.write(self._ours, data)
                data = data[written:]

    def close(self) -> None:
        """Close both sides: from now on reading and writing fail, as with an unplugged cable.

        More than one thread may call it, at any time: who comes later waits until all is closed.
        """
        with self._close_lock:
            if self._closed:
                return
            self._closed = True
            os.write(self._woken, b"x")
            self._thread.join()
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
