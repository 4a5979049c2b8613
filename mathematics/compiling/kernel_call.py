"""Kernel with the arrays it works on, which a block calls in a tick.

::

    self._advance = KernelCall(advance, self.estimate.position, self.imu.specific_force, 0.002)
    ...
    self._advance.run()

By default ``run`` calls the kernel as plain Python. ``compile_calls`` replaces
it by the machine code of the same kernel on the same memory, which computes the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array

if TYPE_CHECKING:
    from .machine_code import MachineCode


class KernelCall:
    """One call of a kernel, whose arguments are fixed once.

    Arrays are views that keep their place in memory, so a tick changes what is in them and passes
    nothing. Numbers and flags keep their value; what changes between two ticks belongs in an array.

    Args:
        kernel: a function marked with ``@kernel`` that returns nothing.
        arguments: arrays, floats, ints, bools, and named tuples of these.

    Attributes:
        run: performs the call. It is replaced when the kernel is compiled, so keep the call and not
            this attribute.
        when: (1,); who makes several calls in turn, such as a ``KernelBlock``, leaves this one out
            where it is zero. None: it is always made. ``run`` does not look at it.
    """

    __slots__ = ("arguments", "compiled", "kernel", "run", "when")

    def __init__(self, kernel: Callable[..., None], *arguments: Any) -> None:
        self.kernel = kernel
        self.arguments = arguments
        self.run: Callable[[], Any] = partial(kernel, *arguments)
        self.compiled: tuple[MachineCode, NDArray[np.int64]] | None = None
        """The machine code and the packed arguments, kept alive here; none for plain Python."""
        self.when: NDArray[np.int64] | None = None
        for calls in _collecting:
            calls.append(self)

    @property
    def addresses(self) -> tuple[int, int]:
        """The addresses of the machine code and of its packed arguments.

        Raises:
            ValueError: the call runs as plain Python.
        """
        if self.compiled is None:
            raise ValueError(f"{self.name} is not compiled")
        code, words = self.compiled
        return code.address, int(words.ctypes.data)

    def take_turn(self) -> None:
        """Perform the call, unless ``when`` leaves it out."""
        if self.when is None or self.when[0]:
            self.run()

    @property
    def name(self) -> str:
        """The kernel's name with its module."""
        return f"{self.kernel.__module__}.{self.kernel.__qualname__}"

    def use_plain(self) -> None:
        """Go back to plain Python."""
        self.run = partial(self.kernel, *self.arguments)
        self.compiled = None


CACHE_LINE = 64
"""bytes"""


def aligned_zeros(shape: tuple[int, int]) -> Array:
    """Return zeros that begin with a line of the cache, so that no vector of a processor's in rows of whole lines lies
    in two of them.
    """
    memory = np.zeros(shape[0] * shape[1] + CACHE_LINE // 8)
    start = -memory.ctypes.data % CACHE_LINE // 8
    return memory[start : start + shape[0] * shape[1]].reshape(shape)


_collecting: list[list[KernelCall]] = []


@contextmanager
def collect_calls() -> Iterator[list[KernelCall]]:
    """Collect all calls that are made within the context, in their order."""
    calls: list[KernelCall] = []
    _collecting.append(calls)
    try:
        yield calls
    finally:
        _collecting[:] = [each for each in _collecting if each is not calls]
