"""The steps of several blocks as one compiled call: the fused tier.

A chain makes the very calls that the blocks would make one by one: the same machine code with the
same memory in the same order. So the bytes are the same by construction. Between two blocks it takes
a time stamp, so that every block's time is known as before, and it notes which block runs, so
that a failure, and a block that hangs, are named as before.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.chain_code import (
    ATTENTION,
    NEXT,
    OWNER,
    STAMP,
    call_table,
    chain_function,
    rows_of,
)  # fmt: skip
from ..language.block import Block
from ..language.errors import RunError

Calls = Literal["kernel_calls", "update_calls"]
"""The calls of a block's ``step`` or ``emit``, or those of its ``update``."""


def can_be_chained(block: Block, which: Calls = "kernel_calls") -> bool:
    """Return whether a block's step, or its update, is nothing but compiled kernels."""
    calls = getattr(block, which)
    names = {"update"} if which == "update_calls" else {"step", "emit"}
    if names & type(block).overridden_steps:
        return False  # there is Python around the calls
    return bool(calls) and all(call.compiled is not None for call in calls)


class Chain:
    """Some blocks that follow each other in every tick in which any of them runs.

    Args:
        blocks: the blocks, for each of which ``can_be_chained`` holds.
        numbers: the number of each, which is written to ``running`` while it runs.
        running: (1,), of the graph.
        which: what the blocks run.
    """

    def __init__(
        self,
        blocks: Sequence[Block],
        numbers: Sequence[int],
        running: NDArray[np.int64],
        which: Calls = "kernel_calls",
    ) -> None:
        self.blocks = tuple(blocks)
        self._which: Calls = which
        self.owners = tuple(block.context.path for block in self.blocks)
        self._numbers = tuple(numbers)
        self._running = running
        self._function = chain_function()
        self._now: Callable[[], int] | None = None
        self._cursor: NDArray[np.int64] = np.zeros(1, np.int64)
        self._first_stamp = 0
        self._attending: Block | None = None
        self._failed: Block | None = None
        self.refresh()

    def refresh(self) -> None:
        """Take over the blocks' calls, which new parameters may have changed.

        Raises:
            RunError: a block has a call that is not compiled.
        """
        entries: list[tuple[int, Any]] = []
        for place, block in enumerate(self.blocks):
            if not can_be_chained(block, self._which):
                path = block.context.path
                raise RunError(f"block '{path}' has a kernel that did not compile", block=path)
            entries += [(place, call) for call in getattr(block, self._which)]
        self._calls = [(call.compiled, call.when) for _, call in entries]
        """Keeps machine code and arguments alive."""
        self._places = [place for place, _ in entries]
        table = call_table([call for _, call in entries], self._running, self._cursor)
        rows = rows_of(table)
        rows[:, OWNER] = [self._numbers[place] for place in self._places]
        for place, block in enumerate(self.blocks):
            last = rows[len(self._places) - 1 - self._places[::-1].index(place)]
            if block.event is not None and self._which == "kernel_calls":
                last[ATTENTION] = block.event.ctypes.data
            if self._now is not None and place < len(self.blocks) - 1:
                last[STAMP] = 8 * (self._first_stamp + place)
        self._table = table
        self._address = ctypes.c_size_t(table.ctypes.data)

    def stamp(self, cursor: NDArray[np.int64], first: int, now: Callable[[], int]) -> None:
        """Take a time stamp after every block but the last.

        Args:
            cursor: (1,), the address of the present row of stamps.
            first: the place of the first stamp in that row.
            now: reads the same clock, for blocks that need attention.
        """
        self._cursor, self._first_stamp, self._now = cursor, first, now
        self.refresh()

    def run(self) -> None:
        """Make all calls."""
        try:
            made = self._function(self._address)
            while made:
                self._attend(made - 1)
                made = self._function(self._address)
        except BaseException:
            self._failed = self._attending or self._next
            self._attending = None
            self._table[NEXT] = 0
            raise

    def _attend(self, entry: int) -> None:
        place = self._places[entry]
        self._attending = self.blocks[place]
        self._attending.on_event()
        self._attending = None
        if self._now is not None and self._cursor[0] and place < len(self.blocks) - 1:
            address = int(self._cursor[0]) + 8 * (self._first_stamp + place)
            ctypes.c_int64.from_address(address).value = self._now()

    @property
    def _next(self) -> Block:
        return self.blocks[self._places[min(int(self._table[NEXT]), len(self._places) - 1)]]

    @property
    def current(self) -> Block:
        """The block that runs, or whose failure ended the last run."""
        return self._attending or self._failed or self._next
