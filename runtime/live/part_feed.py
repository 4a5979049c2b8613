"""Feed of one part of a spread graph to a page anywhere: its window, sent now and then.

The control thread renews the part's window as that of any run; see ``window``. A thread of its own sends
a copy under ``watch/``, at the lowest priority, dropped where a queue is full. A message is a
checksum and a length, as many bytes of JSON that say what the bytes of the window mean, and those.
"""

from __future__ import annotations

import json
import os
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from struct import Struct
from typing import Any
from zlib import crc32

from ..running.memory import BoundGraph
from ..running.run_result import RunResult
from ..running.sink import Note, Sink
from ..running.ticker import Ticker
from ..transports.transport import MessageCallback, Transport, window_key
from .window import Window, WindowContents, WindowLayout, WindowReader, digest, parse_window

RATE = 5.0
"""Rate at which the window is sent [Hz]."""
FAREWELL = 0.05
"""Seconds that the last message has to leave before the part disconnects."""
_HEAD = Struct("<II")
LONGEST = 1 << 26
"""Bytes of a message that is read at most."""


class PartFeed(Sink):
    """The sink that sends the window of one part.

    Args:
        machine: of the part.
        transport: the part's own; it is open once the part has started.
    """

    def __init__(self, machine: str, transport: Transport) -> None:
        self._machine, self._transport = machine, transport
        self._window = Window()
        self._reader: WindowReader | None = None
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._put: MessageCallback | None = None
        self._fault = ""
        self._about: dict[str, Any] = {}

    def open(self, bound: BoundGraph) -> None:
        """Remember what is shown."""
        self._window.open(bound)
        self._about = {"digest": digest(bound.memory.bus.layout, bound.graph), "ended": None}

    def watch_ticker(self, ticker: Ticker) -> None:
        """Begin to send. Without memory for a window nothing is sent, and the run goes on."""
        self._window.watch_ticker(ticker)
        shape = self._window.shape
        if shape is not None:
            self._reader = WindowReader(os.dup(self._window.descriptor), shape)
            self._about["shape"] = asdict(shape)
            self._thread = threading.Thread(target=self._run, name="aloft window", daemon=True)
            self._thread.start()

    def record(self, tick: int) -> None:
        """Renew the window if it is time."""
        self._window.record(tick)

    def note(self, note: Note) -> None:
        """Keep why the run ends, for the last message."""
        if note.kind == "fault":
            self._fault = self._fault or note.text
        elif note.kind == "life" and note.text.startswith("stopping: "):
            self._about["ended"] = self._fault or note.text.removeprefix("stopping: ")

    def close(self) -> None:
        """Send no more."""
        self._window.close()
        self._end()

    def finish(self, result: RunResult) -> list[str]:
        """Let the memory go."""
        return self._window.finish(result)

    def _end(self) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join(1.0)

    def _run(self) -> None:
        while not self._ended.wait(1.0 / RATE):
            with suppress(Exception):  # whatever a network does, the run goes on
                if self._put is None and self._transport.is_open:
                    self._put = self._transport.background_publisher(window_key(self._machine))
                    self._transport.before_close(self._say_farewell)
                self._send()

    def _send(self) -> None:
        copy = self._reader.copy() if self._reader is not None else None
        if self._put is not None and copy is not None:
            self._put(packed(self._about, copy))

    def _say_farewell(self) -> None:
        """Say why the run ends: the actuators rest, and the session is still there."""
        self._end()
        self._send()
        time.sleep(FAREWELL)


@dataclass(frozen=True)
class PartWindow:
    """Content of a part's window at one moment.

    Attributes:
        digest: by which the layout of its bus is known; see ``window.digest``.
        ended: why it ends; ``None`` while it goes on.
        shape: of its window.
        look: what its window showed.
    """

    digest: str
    ended: str | None
    shape: WindowLayout
    look: WindowContents


def packed(about: dict[str, Any], copy: bytes) -> bytes:
    """Pack the description of a window, and its bytes, into a message."""
    said = json.dumps(about).encode()
    return _HEAD.pack(crc32(copy, crc32(said)), len(said)) + said + copy


def read_part(data: bytes) -> PartWindow | None:
    """Read a message; ``None`` where it is not whole or not of this version."""
    if not _HEAD.size <= len(data) <= LONGEST:
        return None
    checksum, length = _HEAD.unpack_from(data)
    if checksum != crc32(data[_HEAD.size :]):
        return None
    with suppress(Exception):  # whatever bytes do, a thread of the network goes on
        about = json.loads(data[_HEAD.size : _HEAD.size + length])
        shape, copy = WindowLayout(**about["shape"]), data[_HEAD.size + length :]
        if len(copy) == shape.size:
            ended = about["ended"]
            text = None if ended is None else str(ended)
            return PartWindow(str(about["digest"]), text, shape, parse_window(copy, shape))
    return None
