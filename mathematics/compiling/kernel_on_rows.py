"""Calls of one kernel for arrays of many lengths, in memory that is kept: to make a call takes longer than most calls do."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from operator import gt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arguments import HEADER
from .compile_calls import compile_calls
from .kernel_call import KernelCall

LEAST = 64
"""The number of rows for which there is memory at first."""
KEPT = 32
"""The lengths whose arrays are kept: to cut them takes longer than many calls."""


class KernelOnRows(threading.local):
    """A call of a kernel on the first rows of arrays; each thread has memory of its own.

    ::

        call = KernelOnRows(kernel, lambda count: (tree, np.zeros((count, 3)), np.zeros((count, 7))))
        tree, position, out = call.rows(20)
        position[:] = ...
        call.run()
        found = out.copy()

    Args:
        kernel: a function marked with ``@kernel`` that returns nothing.
        make: makes the arguments for so many rows, of one or several lengths. Only the first axis of an array may
            depend on a length.
    """

    def __init__(self, kernel: Callable[..., None], make: Callable[..., tuple[Any, ...]]) -> None:
        self._kernel, self._make = kernel, make
        self._most: tuple[int, ...] = ()  # none yet
        self._counts: tuple[int, ...] = ()
        self.run: Callable[[], Any] = self._not_yet

    def rows(self, *counts: int) -> tuple[Any, ...]:
        """Return the arguments, with arrays of so many rows, for the next ``run``; they hold what earlier calls left
        there, and later ones overwrite it.
        """
        if not self._most or any(map(gt, counts, self._most)):
            self._make_room(counts)
        if counts not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            lengths = [None if j is None else counts[j] + more for j, more in self._lengths]
            given = _cut(self._arguments, iter(lengths))
            self._known[counts] = given, [length for length in lengths if length is not None]
        given, own = self._known[counts]
        if counts != self._counts:
            self._counts = counts
            if self._words is None:
                self.run = partial(self._kernel, *given)
            else:
                self._words[self._places] = own
        return given

    def _make_room(self, counts: tuple[int, ...]) -> None:
        """Make memory for at least so many rows, and the call."""
        most = self._most or (0,) * len(counts)
        self._most = tuple(
            now if count <= now else max(2 * count, LEAST)
            for count, now in zip(counts, most, strict=True)
        )
        self._counts = ()
        self._known: dict[tuple[int, ...], tuple[tuple[Any, ...], list[int]]] = {}
        self._arguments = self._make(*self._most)
        leaves = list(_leaves(self._arguments))
        self._lengths: list[tuple[int | None, int]] = [(None, 0)] * len(leaves)
        for j in range(len(counts)):
            fewer = self._make(*(0 if k == j else most for k, most in enumerate(self._most)))
            for k, (leaf, short) in enumerate(zip(leaves, _leaves(fewer), strict=True)):
                if np.shape(leaf) != np.shape(short):
                    self._lengths[k] = j, len(leaf) - self._most[j]
        call = KernelCall(self._kernel, *self._arguments)
        compile_calls([call])
        self.run = call.run
        self._words: NDArray[np.int64] | None = call.compiled and call.compiled[1]
        sizes = [1 + 2 * leaf.ndim if isinstance(leaf, np.ndarray) else 1 for leaf in leaves]
        starts = HEADER + np.cumsum([0, *sizes[:-1]])
        # The first length of an array is behind its address.
        self._places = np.array(
            [
                start + 1
                for start, (j, _) in zip(starts, self._lengths, strict=True)
                if j is not None
            ]
        )

    def _not_yet(self) -> None:
        raise ValueError("rows() must tell how many rows there are before run()")


def _leaves(arguments: tuple[Any, ...]) -> Iterator[Any]:
    """Yield the arrays and numbers of arguments, also those in named tuples."""
    for each in arguments:
        if isinstance(each, tuple):
            yield from _leaves(each)
        else:
            yield each


def _cut(arguments: tuple[Any, ...], lengths: Iterator[int | None]) -> tuple[Any, ...]:
    """Return the arguments with arrays of these lengths, in the order of ``_leaves``."""
    found: list[Any] = []
    for each in arguments:
        if isinstance(each, tuple):
            found.append(type(each)(*_cut(each, lengths)))
        else:
            length = next(lengths)
            found.append(each if length is None else each[:length])
    return tuple(found)
