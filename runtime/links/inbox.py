"""The receiving end of one link in lockstep: it gives a block the message of exactly its tick."""

from __future__ import annotations

import time
from typing import Any, Protocol

from ..language.block import Block
from ..language.errors import RunError
from ..placement.placed import Link
from .mailbox import Mailbox, MailTimeoutError
from .message import DamagedMessageError, MessageReader
from .others import Others

PROBE = -1
"""The tick of a message that only shows that the link works."""


class Inbox:
    """Checks messages as they come, and waits for the one that is needed.

    Attributes:
        damaged: how many messages were thrown away because they were not whole, or of another
            schema or run.
        received: how many were whole.
        heard_at: when the newest message came, by the monotonic clock [ns]; zero before the first.
    """

    def __init__(self, link: Link, reader: MessageReader, others: Others, patience: float) -> None:
        self.link = link
        self.damaged = 0
        self.received = 0
        self.heard_at = 0
        self._newest = -1
        self._reason = ""
        self._reader = reader
        self._others = others
        self._patience = patience
        self._mailbox: Mailbox[memoryview] = Mailbox(self._check)
        self._tick = 0
        others.mailboxes.append(self._mailbox.wake)

    @property
    def surplus(self) -> int:
        """How many messages came twice or too late."""
        return self._mailbox.surplus

    def about(self) -> dict[str, Any]:
        """The counts."""
        return {
            "name": self.link.name,
            "received": self.received,
            "lost": 0,
            "damaged": self.damaged,
            "surplus": self.surplus,
        }

    def hear(self, data: bytes) -> None:
        """Take a message; a thread of the network calls this."""
        run = self._others.run_of(self.link.sender)
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
            self._others.note_checked(self.link.name)
            return
        self.received += 1
        if message.tick > self._newest:  # one that comes again is no sign of life
            self._newest, self.heard_at = message.tick, time.monotonic_ns()
        self._mailbox.put(message.tick, message.payload)

    def show(self, tick: int) -> None:
        """Write the fields of ``tick`` into the bus; waits for them.

        Raises:
            PeerError: the sender failed or is gone.
            RunError: nothing came in time.
        """
        self._tick = tick
        try:
            payload = self._mailbox.take(tick, self._patience)
        except MailTimeoutError:
            damaged = f"; {self.damaged} were damaged, the last: {self._reason}"
            raise RunError(
                f"link {self.link.name}: the message of tick {tick} has not come in "
                f"{self._patience:g} s. {self.received} came before"
                + (damaged if self.damaged else ""),
                block=self.link.source,
                tick=tick,
            ) from None
        self._reader.show(payload)

    def _check(self) -> None:
        self._others.check(self._tick)


class Shows(Protocol):
    """The receiving end of a link, as a stand-in needs it."""

    def show(self, tick: int) -> None:
        """Write what was received for this tick into the bus."""


class Received(Block):
    """Stands for a block of another machine: it has its outputs, and writes what was received.

    Subclasses made by ``received_block_type`` declare the ports.
    """

    waits_for_others = True

    inbox: Shows | None = None

    def step(self) -> None:
        """Take the outputs of this tick."""
        assert self.inbox is not None
        self.inbox.show(self.context.clock.tick)


_TYPES: dict[type[Block], type[Received]] = {}


def received_block_type(block_type: type[Block]) -> type[Received]:
    """The stand-in for blocks of that type on other machines."""
    if block_type not in _TYPES:
        body: dict[str, Any] = {"__doc__": Received.__doc__, "Params": block_type.Params}
        kind: type[Received] = type(f"Received{block_type.__name__}", (Received,), body)
        kind.inputs, kind.outputs = block_type.inputs, block_type.outputs
        _TYPES[block_type] = kind
    return _TYPES[block_type]
