"""What a part says of itself to whoever may watch, without touching what its links carry.

A thread of its own sends the part's status a few times a second, and the bus as it was some
milliseconds ago for a live view. Both go under ``watch/``, at the lowest priority, and are dropped where
a queue is full: a slow observer, or none, makes no difference to the run. The control thread copies the bus
at most ``ROWS`` times a second of the graph's time and does nothing else.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from struct import Struct
from typing import Any
from zlib import crc32

from ..running.memory import BoundGraph
from ..running.notes import Note
from .inbox import Inbox
from .latest import LatestInbox
from .others import Others
from .transport import Take, Transport, rows_key, status_key

ROWS = 50.0
"""How often the bus is shown, at most [Hz]."""
STATUS = 0.25
"""Seconds between two statuses."""
_HEAD = Struct("<I8sq")
ROW_HEADER = _HEAD.size


class Showing:
    """The sink that shows one part.

    Args:
        machine: of the part.
        transport: the part's own; it is open once the part has started.
        others: the other parts, and the numbers by which the graph and the run are known.
        inboxes: the receiving ends of its links.
    """

    def __init__(
        self, machine: str, transport: Transport, others: Others,
        inboxes: Sequence[Inbox | LatestInbox],
    ) -> None:  # fmt: skip
        self._machine, self._transport, self._others = machine, transport, others
        self._inboxes = inboxes
        self._ended = threading.Event()
        self._tick = -1
        self._overruns = self._skipped = 0
        self._shown = 0
        self._fresh = False

    def open(self, bound: BoundGraph) -> None:
        """Begin to show."""
        self._rate = bound.graph.base_rate
        self._bus = bound.memory.bus.buffer.data
        self._every = max(1, round(self._rate / ROWS))
        self._slots = [bytearray(len(self._bus)) for _ in range(2)]
        self._ticks = [0, 0]
        self._thread = threading.Thread(target=self._run, name="aloft showing", daemon=True)
        self._thread.start()

    def record(self, tick: int) -> None:
        """Keep the bus for the thread that shows it, now and then."""
        self._tick = tick
        if tick % self._every == 0:
            slot = 1 - self._shown
            self._slots[slot][:] = self._bus
            self._ticks[slot] = tick
            self._shown = slot
            self._fresh = True

    def note(self, note: Note) -> None:
        """Count overruns."""
        if note.kind == "overrun":
            self._overruns += 1
            self._skipped = int(note.data.get("skipped_periods", 0))

    def close(self) -> None:
        """End showing."""
        self._ended.set()
        self._thread.join(1.0)

    def status(self, rate: float) -> dict[str, Any]:
        """The status of the part; ``rate`` is how many ticks a second it makes at present."""
        others = self._others
        return {
            "machine": self._machine,
            "hash": others.graph_hash,
            "tick": self._tick,
            "rate_hz": rate,
            "base_rate_hz": self._rate,
            "overruns": self._overruns,
            "skipped_periods": self._skipped,
            "phase": others.phase.name.lower(),
            "links": [link_status(box) for box in self._inboxes],
            "clocks": {
                name: {
                    "offset_s": others.clock_of(name).offset * 1e-9,
                    "uncertainty_s": others.clock_of(name).uncertainty * 1e-9,
                }
                for name in others.names
            },
        }

    def _run(self) -> None:
        status: Take | None = None
        rows: Take | None = None
        said, tick = time.monotonic(), self._tick
        while not self._ended.wait(1.0 / ROWS):
            with suppress(Exception):  # whatever a network does, the run goes on
                if status is None or rows is None:
                    if not self._transport.is_open:
                        continue
                    status = self._transport.shower(status_key(self._machine))
                    rows = self._transport.shower(rows_key(self._machine))
                if self._fresh:
                    self._fresh = False
                    rows(self._row(self._shown))
                now = time.monotonic()
                if now - said >= STATUS:
                    present = self._tick
                    status(json.dumps(self.status((present - tick) / (now - said))).encode())
                    said, tick = now, present

    def _row(self, slot: int) -> bytes:
        data = bytes(self._slots[slot])
        return _HEAD.pack(crc32(data), self._others.run, self._ticks[slot]) + data


def link_status(box: Inbox | LatestInbox) -> dict[str, Any]:
    """How a link does, without what takes long to compute."""
    found: dict[str, Any] = {
        "name": box.link.name,
        "rate_hz": box.link.rate_hz,
        "received": box.received,
        "damaged": box.damaged,
        "surplus": box.surplus,
    }
    if isinstance(box, LatestInbox):
        found |= {"lost": box.lost, "late_ticks": box.late_ticks, "age_ms": box.age * 1e-6,
                  "jitter_ms": box.jitter * 1e-6}  # fmt: skip
    return found


def read_row(data: bytes, size: int) -> tuple[int, bytes] | None:
    """The tick and the bus in a message of ``rows_key``; ``None`` where it is not whole."""
    if len(data) != ROW_HEADER + size:
        return None
    checksum, _, tick = _HEAD.unpack_from(data)
    row = data[ROW_HEADER:]
    return (int(tick), row) if checksum == crc32(row) else None
