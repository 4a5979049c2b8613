"""Calls that are always made one after the other, by machine code where that can be."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .chain_code import NEXT, call_table, chain_function


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


class CallSequence:
    """Makes calls in their order. A call may stand in it several times.

    Once all of them are machine code, ``prepare`` has them made without the interpreter in between,
    with the same bytes. A call that is compiled anew later needs ``prepare`` again.
    """

    def __init__(self, calls: Iterable[Call]) -> None:
        self.calls = tuple(calls)
        self._function: Callable[[ctypes.c_size_t], int] | None = None

    @property
    def native(self) -> bool:
        """True if the calls are made without the interpreter."""
        return self._function is not None

    def prepare(self) -> None:
        """Make the calls without the interpreter from now on, if all of them can be."""
        self._function = None
        self._kept = [getattr(call, "compiled", None) for call in self.calls]
        """Keeps machine code and arguments alive."""
        self._running, self._cursor = np.zeros(1, np.int64), np.zeros(1, np.int64)
        try:
            self._table = call_table(self.calls, self._running, self._cursor)
        except ValueError:
            return
        self._address = ctypes.c_size_t(self._table.ctypes.data)
        self._function = chain_function()

    def run(self) -> None:
        """Make all calls."""
        if self._function is None:
            for call in self.calls:
                call.take_turn()
            return
        try:
            self._function(self._address)
        except BaseException:
            self._table[NEXT] = 0
            raise
