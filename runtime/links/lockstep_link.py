"""The two ends of a link: the block that sends, and the block that gives others what was received.

In lockstep the receiving end waits for the message of exactly its tick.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any, Generic, Protocol, TypeVar

from ..language.block import Block
from ..language.errors import RunError
from ..placement.placed import MachineLink
from ..transports.transport import MessageCallback
from .message import DamagedMessageError, MessageReader, MessageWriter
from .peers import PeerStates

T = TypeVar("T")
SLICE = 0.05
"""Seconds of waiting after which it is looked whether waiting still helps."""


class MailTimeoutError(Exception):
    """An awaited item has not come in time."""


class Mailbox(Generic[T]):
    """Keeps what arrives on threads of the network for one reader, by a growing number (a tick).

    What arrives early is kept, so a network may change the order. What arrives twice or late is
    counted and thrown away.

    Attributes:
        surplus: how many items came twice or after they had been needed.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self._queue: SimpleQueue[tuple[int, T] | None] = SimpleQueue()
        self._early: dict[int, T] = {}
        self.surplus = 0

    def put(self, number: int, item: T) -> None:
        """Leave an item; any thread may."""
        self._queue.put((number, item))

    def wake(self) -> None:
        """Make a reader that waits look at once whether waiting still helps."""
        self._queue.put(None)

    def take(self, number: int, timeout: float) -> T:
        """Wait for the item with that number and return it.

        ``check`` is called whenever nothing has come for a while, and ends the wait by raising.

        Raises:
            MailTimeoutError: it has not come within ``timeout`` seconds.
        """
        if number in self._early:
            return self._early.pop(number)
        end: float | None = None
        while True:
            try:
                found = self._queue.get(timeout=SLICE)
            except Empty:
                found = None
            if found is None:
                if self._queue.empty():
                    self._check()
                now = time.monotonic()
                end = now + timeout - SLICE if end is None else end
                if now > end:
                    raise MailTimeoutError
                continue
            if found[0] == number:
                return found[1]
            if found[0] < number or found[0] in self._early:
                self.surplus += 1
            else:
                self._early[found[0]] = found[1]


PROBE = -1
"""The tick of a message that only shows that the link works."""


class LockstepReceiver:
    """Checks messages as they come, and waits for the one that is needed.

    Attributes:
        damaged: how many messages were thrown away because they were not whole, or of another
            schema or run.
        received: how many were whole.
        received_at: when the newest message came, by the monotonic clock [ns]; zero before the first.
    """

    def __init__(
        self, link: MachineLink, reader: MessageReader, peers: PeerStates, timeout: float
    ) -> None:
        self.link = link
        self.damaged = 0
        self.received = 0
        self.received_at = 0
        self._newest = -1
        self._reason = ""
        self._reader = reader
        self._peers = peers
        self._timeout = timeout
        self._mailbox: Mailbox[memoryview] = Mailbox(self._check)
        self._tick = 0
        peers.mailboxes.append(self._mailbox.wake)

    @property
    def surplus(self) -> int:
        """Number of messages that came twice or too late."""
        return self._mailbox.surplus

    def about(self) -> dict[str, Any]:
        """Return the counts."""
        return {
            "name": self.link.name,
            "received": self.received,
            "lost": 0,
            "damaged": self.damaged,
            "surplus": self.surplus,
        }

    def on_message(self, data: bytes) -> None:
        """Take a message; a thread of the network calls this."""
        self._peers.traffic[self.link.sender].add(len(data))
        run = self._peers.run_of(self.link.sender)
        if run is None:
            return  # it has not said hello yet
        self._reader.run = run
        try:
            message = self._reader.read(data)
        except DamagedMessageError as error:
            self.damaged += 1
            self._reason = str(error)
            return
        if message.tick == PROBE:
            self._peers.note_checked(self.link.name)
            return
        self.received += 1
        if message.tick > self._newest:  # one that comes again is no sign of life
            self._newest, self.received_at = message.tick, time.monotonic_ns()
        self._mailbox.put(message.tick, message.payload)

    def write_outputs(self, tick: int) -> None:
        """Write the fields of ``tick`` into the bus; waits for them.

        Raises:
            PeerError: the sender failed or is gone.
            RunError: nothing came in time.
        """
        self._tick = tick
        try:
            payload = self._mailbox.take(tick, self._timeout)
        except MailTimeoutError:
            damaged = f"; {self.damaged} were damaged, the last: {self._reason}"
            raise RunError(
                f"link {self.link.name}: the message of tick {tick} has not come in "
                f"{self._timeout:g} s (links.patience). {self.received} came before"
                + (damaged if self.damaged else "")
                + f". From {self.link.sender} {self._peers.measured(self.link.sender)}",
                block=self.link.source,
                tick=tick,
            ) from None
        self._reader.write_outputs(payload)

    def _check(self) -> None:
        self._peers.check(self._tick)


class OutputWriter(Protocol):
    """The receiving end of a link, as a stand-in needs it."""

    def write_outputs(self, tick: int) -> None:
        """Write what was received for this tick into the bus."""


class LinkInput(Block):
    """Stands for a block of another machine: it has its outputs, and writes what was received.

    Subclasses made by ``link_input_type`` declare the ports.
    """

    waits_for_others = True

    receiver: OutputWriter | None = None

    def step(self) -> None:
        """Take the outputs of this tick."""
        assert self.receiver is not None
        self.receiver.write_outputs(self.context.clock.tick)


_TYPES: dict[type[Block], type[LinkInput]] = {}


def link_input_type(block_type: type[Block]) -> type[LinkInput]:
    """Return the stand-in for blocks of that type on other machines."""
    if block_type not in _TYPES:
        body: dict[str, Any] = {"__doc__": LinkInput.__doc__, "Params": block_type.Params}
        kind: type[LinkInput] = type(f"LinkInput{block_type.__name__}", (LinkInput,), body)
        kind.inputs, kind.outputs = block_type.inputs, block_type.outputs
        _TYPES[block_type] = kind
    return _TYPES[block_type]


class LinkOutput(Block):
    """Sends what another machine reads of a block's outputs, each time that block has run."""

    writer: MessageWriter | None = None
    put: MessageCallback | None = None

    def connect(
        self,
        writer: MessageWriter,
        put: MessageCallback,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Take what makes the messages, what sends them, and the time [ns]."""
        self.writer, self.put, self.now = writer, put, clock

    def probe(self) -> None:
        """Send a message that only shows that the link works."""
        assert self.writer is not None and self.put is not None
        self.put(self.writer.write(PROBE, self.now()))

    def step(self) -> None:
        """Send."""
        assert self.writer is not None and self.put is not None
        self.put(self.writer.write(self.context.clock.tick, self.now()))
