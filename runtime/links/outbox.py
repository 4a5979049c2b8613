"""The sending end of one link: a block of the runtime that runs right after the source."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..language.block import Block
from .inbox import PROBE
from .message import MessageWriter
from .transport import Take


class Send(Block):
    """Sends what another machine reads of a block's outputs, each time that block has run."""

    writer: MessageWriter | None = None
    put: Take | None = None

    def connect(
        self, writer: MessageWriter, put: Take, clock: Callable[[], int] = time.monotonic_ns
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
