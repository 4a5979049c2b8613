"""The receiving end of a free-running link: the latest message, its age, and what is late or lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.block import Block, Output
from ..language.signals import Field, Signal
from ..language.stages import LinkPolicy
from ..placement.placed import MachineLink
from .lockstep_link import PROBE
from .message import DamagedMessageError, Message, MessageReader
from .peers import PeerStates

TICK_TIME = "~tick"
"""The path of the block that keeps when ticks began."""
JITTER_SHARE = 1.0 / 16.0
"""Weight of each message in the estimate of jitter, as in RFC 3550, section 6.4.1."""
KEPT = 4096
"""The number of last ages from which the percentiles are computed."""


class LinkHealth(Signal):
    """Health of a free-running link, at each tick of its reader."""

    age = Field(unit="s", text="since the source ran, by the estimated clock of its machine")
    jitter = Field(
        unit="s", text="how unevenly messages come: mean deviation of their time on the way"
    )
    clock_offset = Field(unit="s", text="how far the sender's clock is ahead, as estimated")
    clock_uncertainty = Field(unit="s", text="the largest error of that; negative: not known yet")
    late = Field(dtype="bool", text="whether the age exceeds what is allowed")
    tick = Field(dtype="int64", text="the tick in which the source ran, on its machine; -1: none")
    sent = Field(dtype="int64", text="when it was sent, by the clock of the sender [ns]")
    read = Field(dtype="int64", text="when it was read, by the clock of the reader [ns]")
    received = Field(dtype="int64", text="messages so far")
    lost = Field(dtype="int64", text="messages that never came, by the gaps in their numbers")
    surplus = Field(dtype="int64", text="messages that came twice or after a later one")
    damaged = Field(dtype="int64", text="messages that were thrown away")


class TickStart(Signal):
    """Beginning of a tick of a part that runs free."""

    time = Field(dtype="int64", text="by the monotonic clock of its machine [ns]")


class TickTime(Block):
    """Keeps when each tick began, so that ages on paths through several machines can be measured."""

    began = Output(TickStart)
    now: Callable[[], int] = staticmethod(time.monotonic_ns)

    def step(self) -> None:
        """Take the time; it runs before all other blocks."""
        self.began.time[()] = self.now()


class LinkMonitor(Block):
    """Holds the health of a link, so that it is recorded and shown; the link writes it."""

    health = Output(LinkHealth)

    def step(self) -> None:
        """Never called: the link writes when the stand-in of its source runs."""


def health_path(link: MachineLink) -> str:
    """Return the path of the block that shows the health of a free-running link."""
    return f"{link.source}~from~{link.sender}"


class LatestReceiver:
    """Keeps the latest message of a link, and gives it to the stand-in of its source.

    A message older than one that has come is thrown away. Nothing here waits.

    Args:
        link: the link.
        reader: what checks messages and writes them into the bus.
        peers: the other parts.
        policy: what to do where nothing has come for too long.
        health: where to write how the link does.
        stop: called with the reason where the policy is to stop.
        clock: the monotonic time [ns].

    Attributes:
        received_at: when the newest message came, by ``clock``; zero before the first.
        age: of the message at the last tick of the reader [ns].
        jitter: the mean absolute difference [ns] between the times on the way of a message and of the
            one before it (RFC 3550, section 6.4.1); the clocks' offset drops out.
    """

    def __init__(
        self,
        link: MachineLink,
        reader: MessageReader,
        peers: PeerStates,
        policy: LinkPolicy,
        health: LinkHealth,
        stop: Callable[[str], None],
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.link = link
        self.policy = policy
        self.received = self.lost = self.surplus = self.damaged = self.late_ticks = 0
        self.received_at = self.age = 0
        self.jitter = 0.0
        self._transit: int | None = None
        self._reader = reader
        self._peers = peers
        self._health = health
        self._stop = stop
        self._clock = clock
        self._limit = None if policy.max_age is None else int(policy.max_age * 1e9)
        self._latest: Message | None = None
        self._run = b""
        self._sequence = -1
        self._shown: Message | None = None
        self._since = 0
        self._ages: NDArray[np.int64] = np.zeros(KEPT, np.int64)
        self._count = 0

    def on_message(self, data: bytes) -> None:
        """Take a message; a thread of the network calls this."""
        run = self._peers.run_of(self.link.sender)
        if run is None:
            return
        self._reader.run = run
        try:
            message = self._reader.read(data)
        except DamagedMessageError:
            self.damaged += 1
            return
        self._peers.note_checked(self.link.name)
        if run != self._run:  # the first message of a part that was started, perhaps again
            self._run, self._sequence = run, message.sequence - 1
            self._transit = None
        if message.sequence <= self._sequence:
            self.surplus += 1
            return
        gap = message.sequence - self._sequence - 1
        self._sequence = message.sequence
        if message.tick == PROBE:
            return
        self.lost += gap
        self.received += 1
        self.received_at = self._clock()
        transit = self.received_at - message.time
        if self._transit is not None:
            self.jitter += JITTER_SHARE * (abs(transit - self._transit) - self.jitter)
        self._transit, self._latest = transit, message

    def write_outputs(self, tick: int) -> None:
        """Write the latest fields into the bus, or apply the policy where they are too old."""
        now = self._clock()
        message = self._latest
        if self._since == 0:
            self._since = now
        if message is None:
            age = now - self._since
        else:
            age = now + self._peers.clock_of(self.link.sender).offset - message.time
        late = self._limit is not None and age > self._limit
        if late:
            self.late_ticks += 1
            if self.policy.late == "safe":
                self._reader.write_outputs(self._reader.initial)
                self._shown = None  # once it is in time again, it is written again
            elif self.policy.late == "stop":
                self._stop(
                    f"link {self.link.name}: nothing has come for {age * 1e-6:.1f} ms, at most "
                    f"{self._limit * 1e-6 if self._limit else 0:g} ms are allowed"
                )
        safe = late and self.policy.late == "safe"
        if message is not None and message is not self._shown and not safe:
            self._reader.write_outputs(message.payload)
            self._shown = message
        self.age = self._ages[self._count % KEPT] = age
        self._count += 1
        self._write(message, now, age, late)

    def _write(self, message: Message | None, now: int, age: int, late: bool) -> None:
        health = self._health
        health.tick[()] = -1 if message is None else message.tick
        health.sent[()] = 0 if message is None else message.time
        health.read[()] = now
        clock = self._peers.clock_of(self.link.sender)
        health.age[()] = age * 1e-9
        health.jitter[()] = self.jitter * 1e-9
        health.clock_offset[()] = clock.offset * 1e-9
        health.clock_uncertainty[()] = clock.uncertainty * 1e-9
        health.late[()] = late
        health.received[()] = self.received
        health.lost[()] = self.lost
        health.surplus[()] = self.surplus
        health.damaged[()] = self.damaged

    def about(self) -> dict[str, Any]:
        """Return the counts, and percentiles of the age [ms] at the reader's ticks."""
        ages = self._ages[: min(self._count, KEPT)] * 1e-6
        median, high, longest = np.percentile(ages, [50, 99, 100]) if len(ages) else (0.0,) * 3
        return {
            "name": self.link.name, "received": self.received, "lost": self.lost,
            "surplus": self.surplus, "damaged": self.damaged, "late_ticks": self.late_ticks,
            "age_p50_ms": float(median), "age_p99_ms": float(high), "age_max_ms": float(longest),
            "jitter_ms": self.jitter * 1e-6,
        }  # fmt: skip
