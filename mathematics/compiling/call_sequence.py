"""Calls that are always made one after the other, by machine code where that can be."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .chain_code import ATTENTION, NEXT, OWNER, STAMP, call_table, chain_function, rows_of


class Call(Protocol):
    """A ``KernelCall`` or a ``ForeignCall``."""

    run: Callable[[], Any]
    when: NDArray[np.int64] | None

    @property
    def addresses(self) -> tuple[int, int]:
        """The addresses of machine code that makes the call, and of what it needs; ``ValueError``
        where there is none."""

    def take_turn(self) -> None:
        """Perform the call, unless ``when`` leaves it out."""


@dataclass(frozen=True)
class Owner:
    """One of those whose calls follow each other in a sequence, such as a block.

    Attributes:
        who: the owner itself.
        name: its name.
        number: what is written to ``running`` while its calls are made.
        calls: gives its present calls.
        attention: (1,), not zero where ``attend`` is to be called after its last call.
        attend: called then, in Python.
    """

    who: Any
    name: str
    number: int
    calls: Callable[[], Sequence[Call]]
    attention: NDArray[np.int64] | None = None
    attend: Callable[[], None] = lambda: None


class CallSequence:
    """Makes calls in their order. A call may stand in it several times.

    Once all of them are machine code, ``prepare`` has them made without the interpreter in between,
    with the same bytes. A call that is compiled anew later needs ``prepare`` again.

    With owners it makes the very calls that those would make one by one. Between two owners it takes
    a time stamp, so that the time of each is known as before, and it notes which one is at work, so that
    a failure, and one that hangs, are named as before.

    Args:
        calls: the calls, where there are no owners.
        owners: whose calls are made.
        running: (1,), where the number of the owner at work is written.
    """

    def __init__(
        self,
        calls: Iterable[Call] = (),
        *,
        owners: Sequence[Owner] = (),
        running: NDArray[np.int64] | None = None,
    ) -> None:
        self.calls = tuple(calls)
        self.owners = tuple(owners)
        self._places: list[int] = []
        self._running = np.zeros(1, np.int64) if running is None else running
        self._cursor: NDArray[np.int64] = np.zeros(1, np.int64)
        self._first_stamp = 0
        self._now: Callable[[], int] | None = None
        self._attending: Owner | None = None
        self._failed: Owner | None = None
        self._function: Callable[[ctypes.c_size_t], int] | None = None

    @property
    def native(self) -> bool:
        """True if the calls are made without the interpreter."""
        return self._function is not None

    def prepare(self) -> None:
        """Take over the owners' calls, and make all of them without the interpreter from now on, if
        they can be."""
        self._function = None
        if self.owners:
            entries = [(k, call) for k, owner in enumerate(self.owners) for call in owner.calls()]
            self._places = [place for place, _ in entries]
            self.calls = tuple(call for _, call in entries)
        self._kept = [(getattr(call, "compiled", None), call.when) for call in self.calls]
        """Keeps machine code and arguments alive."""
        try:
            self._table = call_table(self.calls, self._running, self._cursor)
        except ValueError:
            return
        rows = rows_of(self._table)
        lasts = {place: entry for entry, place in enumerate(self._places)}
        if self.owners:
            rows[:, OWNER] = [self.owners[place].number for place in self._places]
        for place, owner in enumerate(self.owners):
            if owner.attention is not None:
                rows[lasts[place], ATTENTION] = owner.attention.ctypes.data
            if self._now is not None and place < len(self.owners) - 1:
                rows[lasts[place], STAMP] = 8 * (self._first_stamp + place)
        self._address = ctypes.c_size_t(self._table.ctypes.data)
        self._function = chain_function()

    def stamp(self, cursor: NDArray[np.int64], first: int, now: Callable[[], int]) -> None:
        """Take a time stamp after every owner but the last.

        Args:
            cursor: (1,), the address of the present row of stamps.
            first: the place of the first stamp in that row.
            now: reads the same clock, for owners that need attention.
        """
        self._cursor, self._first_stamp, self._now = cursor, first, now
        self.prepare()

    def run(self) -> None:
        """Make all calls."""
        function = self._function
        if function is None:
            for call in self.calls:
                call.take_turn()
            return
        try:
            made = function(self._address)
            while made:
                self._attend(made - 1)
                made = function(self._address)
        except BaseException:
            if self.owners:
                self._failed, self._attending = self._attending or self._next, None
            self._table[NEXT] = 0
            raise

    def _attend(self, entry: int) -> None:
        place = self._places[entry]
        self._attending = self.owners[place]
        self._attending.attend()
        self._attending = None
        if self._now is not None and self._cursor[0] and place < len(self.owners) - 1:
            address = int(self._cursor[0]) + 8 * (self._first_stamp + place)
            ctypes.c_int64.from_address(address).value = self._now()

    @property
    def _next(self) -> Owner:
        return self.owners[self._places[min(int(self._table[NEXT]), len(self._places) - 1)]]

    @property
    def current(self) -> Any:
        """The owner at work, or whose failure ended the last run."""
        return (self._attending or self._failed or self._next).who
