"""Status that a part publishes, and the observer that receives it anywhere and sends nothing.

A thread of its own sends the part's status a few times a second, and the bus as it was some
milliseconds ago for a live view. Both go under ``watch/``, at the lowest priority, and are dropped where
a queue is full: a slow observer, or none, makes no difference to the run. The control thread copies the bus
at most ``ROWS`` times a second of the graph's time and does nothing else.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import Any, Self
from zlib import crc32

from ..placement.placed import PlacedGraph
from ..running.lateness import LatenessCounter
from ..running.memory import BoundGraph
from ..running.pacing import Pacer
from ..running.sink import Note, Sink
from ..running.ticker import Ticker
from ..transports.registry import network_transport, silent_endpoint
from ..transports.transport import MessageCallback, Transport, rows_key, status_key, window_key
from .free_link import LatestReceiver
from .identity import Identity
from .lockstep_link import LockstepReceiver
from .peers import PeerStates

ROWS = 50.0
"""Largest rate at which the bus is shown [Hz]."""
STATUS = 0.25
"""Seconds between two statuses."""
_HEAD = Struct("<I8sq")
ROW_HEADER = _HEAD.size


class StatusPublisher(Sink):
    """The sink that shows one part.

    Args:
        machine: of the part.
        transport: the part's own; it is open once the part has started.
        peers: the other parts, and the numbers by which the graph and the run are known.
        receivers: the receiving ends of its links.
    """

    def __init__(
        self, machine: str, transport: Transport, peers: PeerStates,
        receivers: Sequence[LockstepReceiver | LatestReceiver],
    ) -> None:  # fmt: skip
        self._machine, self._transport, self._peers = machine, transport, peers
        self._receivers = receivers
        self._ended = threading.Event()
        self._tick = -1
        self._overruns = self._skipped = self._late = 0
        self._pacer: Pacer | None = None
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

    def watch_ticker(self, ticker: Ticker) -> None:
        """Show how late its ticks begin, if they have deadlines."""
        self._pacer = ticker.pacer

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
        """Count overruns and late results of background blocks."""
        if note.kind == "overrun":
            self._overruns += 1
            self._skipped = int(note.data.get("skipped_periods", 0))
        elif note.kind == "late":
            self._late += 1

    def close(self) -> None:
        """End showing."""
        self._ended.set()
        self._thread.join(1.0)

    def status(self, rate: float) -> dict[str, Any]:
        """Return the status of the part; ``rate`` is the ticks per second that it runs at
        present."""
        peers = self._peers
        return {
            "machine": self._machine,
            "hash": peers.graph_hash,
            "tick": self._tick,
            "rate_hz": rate,
            "base_rate_hz": self._rate,
            "overruns": self._overruns,
            "skipped_periods": self._skipped,
            "late_results": self._late,
            "lateness": None if self._pacer is None else _shown(self._pacer.lateness),
            "phase": peers.phase.name.lower(),
            "links": [link_status(box) for box in self._receivers],
            "clocks": {
                name: {
                    "offset_s": peers.clock_of(name).offset * 1e-9,
                    "uncertainty_s": peers.clock_of(name).uncertainty * 1e-9,
                }
                for name in peers.names
            },
        }

    def _run(self) -> None:
        status: MessageCallback | None = None
        rows: MessageCallback | None = None
        said, tick = time.monotonic(), self._tick
        while not self._ended.wait(1.0 / ROWS):
            with suppress(Exception):  # whatever a network does, the run goes on
                if status is None or rows is None:
                    if not self._transport.is_open:
                        continue
                    status = self._transport.background_publisher(status_key(self._machine))
                    rows = self._transport.background_publisher(rows_key(self._machine))
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
        return _HEAD.pack(crc32(data), self._peers.run, self._ticks[slot]) + data


def _shown(counter: LatenessCounter) -> dict[str, float]:
    """Return the lateness of ticks so far [us], the late ones, and the limit [us]."""
    found = counter.result()
    return {
        "p50_us": found.p50_us, "p99_us": found.p99_us, "max_us": found.max_us,
        "late": found.late, "late_after_us": found.late_after_us,
    }  # fmt: skip


def link_status(box: LockstepReceiver | LatestReceiver) -> dict[str, Any]:
    """Return the health of a link, without figures that take long to compute."""
    found: dict[str, Any] = {
        "name": box.link.name,
        "rate_hz": box.link.rate_hz,
        "received": box.received,
        "damaged": box.damaged,
        "surplus": box.surplus,
    }
    if isinstance(box, LatestReceiver):
        found |= {"lost": box.lost, "late_ticks": box.late_ticks, "age_ms": box.age * 1e-6,
                  "jitter_ms": box.jitter * 1e-6}  # fmt: skip
    return found


def read_row(data: bytes, size: int) -> tuple[int, bytes] | None:
    """Return the tick and the bus in a message of ``rows_key``; ``None`` where it is not whole."""
    if len(data) != ROW_HEADER + size:
        return None
    checksum, _, tick = _HEAD.unpack_from(data)
    row = data[ROW_HEADER:]
    return (int(tick), row) if checksum == crc32(row) else None


STALE = 2.0
"""Silence of a part after which it counts as silent [s]."""


class Observer:
    """A session that connects to all machines of a graph, for a ``with`` statement.

    Args:
        placed: the graph.
        keys: the folder of ``aloft keys``, or the observer's own, where links are encrypted.
        name: the observer's, by which its keys are known.

    Raises:
        AloftError: the endpoints and the keys do not fit together.

    Attributes:
        statuses: the latest status of each machine that was heard.
    """

    def __init__(self, placed: PlacedGraph, keys: Path | None = None, name: str = "viewer") -> None:
        self.placed = placed
        self.statuses: dict[str, dict[str, Any]] = {}
        self._received_at: dict[str, float] = {}
        self._hash = Identity.of(placed).graph_hash
        self._transport = network_transport(placed, name, keys)

    def __enter__(self) -> Self:
        """Connect to whoever is there, and go on trying.

        Raises:
            AloftError: this is not possible.
        """
        self._transport.observe()
        for spec in self.placed.machines:
            self._transport.subscribe(status_key(spec.name), self._take)
        return self

    def __exit__(self, *_: object) -> None:
        self._transport.close()

    def rows(self, machine: str, size: int, take: Callable[[int, bytes], None]) -> None:
        """Have the bus of a part taken as it comes, with its tick; ``size`` are its bytes."""

        def heard(data: bytes) -> None:
            found = read_row(data, size)
            if found is not None:
                take(*found)

        self._transport.subscribe(rows_key(machine), heard)

    def windows(self, machine: str, take: Callable[[bytes], None]) -> None:
        """Have what a part shows of itself for a page taken as it comes; see ``live.part_feed``."""
        self._transport.subscribe(window_key(machine), take)

    def seconds_since(self, machine: str) -> float | None:
        """Return the time since a machine was last heard [s]; ``None`` if it never was."""
        heard = self._received_at.get(machine)
        return None if heard is None else time.monotonic() - heard

    def wait_for(self, machines: tuple[str, ...], seconds: float) -> tuple[str, ...]:
        """Wait until these machines have been heard; gives those that were not."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if all(name in self.statuses for name in machines):
                return ()
            time.sleep(0.02)
        return tuple(name for name in machines if name not in self.statuses)

    def state_of(self, machine: str) -> str:
        """Return whether a machine runs this graph, another, or is silent."""
        silent = self.seconds_since(machine)
        if silent is None or silent > STALE:
            return "silent"
        status = self.statuses[machine]
        if status["hash"] != self._hash:
            return "another graph"
        return str(status["phase"])

    def why_silent(self, name: str) -> str:
        """Find the likely cause of a machine's silence; empty for one that is heard."""
        if self.state_of(name) != "silent":
            return ""
        return silent_endpoint(self.placed.machine(name).endpoint)

    def _take(self, data: bytes) -> None:
        with suppress(Exception):  # whatever bytes do, a thread of the network goes on
            status = json.loads(data)
            name = status["machine"]
            if name in [spec.name for spec in self.placed.machines]:
                float(status["rate_hz"]), int(status["tick"]), status["hash"] + status["phase"]
                self.statuses[name] = status
                self._received_at[name] = time.monotonic()
