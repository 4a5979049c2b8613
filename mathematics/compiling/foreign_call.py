"""A call of a function in a library, such as a simulator's, among the calls of kernels.

::

    step = ForeignCall(partial(mujoco.mj_step1, model, data), address, model_address, data_address)

``run`` calls it through its own module for Python. Where the address of the function is known a
``CallSequence`` calls it without the interpreter.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST = 3
"""The largest number of arguments."""


class ForeignCall:
    """One call of a function of C, whose arguments are fixed once.

    Args:
        run: performs the same call from Python.
        address: of the function; zero where it is not known. The function returns nothing.
        arguments: up to three whole numbers or addresses. The caller keeps alive what they point to.

    Attributes:
        run: performs the call.
        words: the address of the function and the arguments, (4,). What changes them, such as a kernel
            that writes a count, changes the next call.
        when: as that of a ``KernelCall``.

    Raises:
        ValueError: there are more than three arguments.
    """

    def __init__(self, run: Callable[[], Any], address: int, *arguments: int) -> None:
        if len(arguments) > MOST:
            raise ValueError(f"a function of a library gets {MOST} arguments, not {len(arguments)}")
        self.run = run
        self.words = np.zeros(1 + MOST, np.int64)
        self.words[: 1 + len(arguments)] = (address, *arguments)
        self.when: NDArray[np.int64] | None = None
        self._count = len(arguments)

    @property
    def compiled(self) -> NDArray[np.int64] | None:
        """Words that keep the call alive, as those of a ``KernelCall``; ``None`` where Python makes
        it."""
        return self.words if self.words[0] else None

    @property
    def addresses(self) -> tuple[int, int]:
        """The addresses of machine code that makes the call, and of what it needs.

        Raises:
            ValueError: the address of the function is not known.
        """
        if not self.words[0]:
            raise ValueError("the address of the function is not known")
        return _caller(self._count), int(self.words.ctypes.data)

    def take_turn(self) -> None:
        """Perform the call, unless ``when`` leaves it out."""
        if self.when is None or self.when[0]:
            self.run()


def address_of(function: Any) -> int:
    """Return the address of a function of a library that ``ctypes`` has loaded."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@cache
def _caller(count: int) -> int:
    """Return the address of machine code that calls a function; the words at an address are those
    of the function and of its ``count`` arguments."""
    from .machine_code import machine_code_of

    return machine_code_of(_caller_module, count).address


def _caller_module(count: int) -> Any:
    from llvmlite import ir

    from .machine_code import ENTRY

    word = ir.IntType(64)
    module = ir.Module(f"aloft.library.{count}")
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [word]), ENTRY)
    builder = ir.IRBuilder(entry.append_basic_block())
    words = builder.inttoptr(entry.args[0], word.as_pointer())
    values = [
        builder.load(builder.gep(words, [ir.Constant(word, place)])) for place in range(1 + count)
    ]
    kind = ir.FunctionType(ir.VoidType(), [word] * count).as_pointer()
    builder.call(builder.inttoptr(values[0], kind), values[1:])
    builder.ret_void()
    return module
