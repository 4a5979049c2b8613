"""Machine code that makes several calls of compiled kernels, one after the other.

The calls stand in a table of 64-bit words, which it reads; so one and the same machine code serves
every table, and the calls themselves are those that would be made one by one. It is written in
LLVM's language here, because it calls functions by their addresses, which kernels cannot.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .arguments import error_record

ERROR_FLAG, CLOCK, ENTRIES, NEXT, RUNNING, CURSOR = range(6)
"""The words at the beginning of a table: the address of the word in which kernels report an error;
the address of the system's function that reads a clock, or zero; the number of entries; the
entry to go on with; the address of the word for the call that runs; that of the word with the
address of the present row of time stamps, which is zero where none are taken."""
HEAD = 6
"""The number of words before the first entry."""
FUNCTION, ARGUMENTS, OWNER, ATTENTION, STAMP, WHEN = range(6)
"""The words of an entry: the addresses of machine code and of its arguments; who makes the call; the
address of the word that asks for attention after the call, or zero; the place of the time stamp that
is taken after the call, in bytes from the present row, or -1; the address of the word that is zero
where the call is left out, or zero where it is always made."""
WIDTH = 6
"""The number of words of an entry."""
_MONOTONIC = 1
"""Linux's number of the clock that ``time.perf_counter_ns`` reads."""


@cache
def chain_function() -> Callable[[ctypes.c_size_t], int]:
    """Return the function that makes the calls of the table at an address, from the entry ``NEXT``
    on.

    It returns zero after the last entry. Where an entry asks for attention it returns the number of
    entries made so far, and goes on behind it when it is called again. A Python error that a call
    has set is raised; then ``NEXT`` is the entry that failed.
    """
    from .machine_code import machine_code_of

    code = machine_code_of(_module)
    function: Any = ctypes.PYFUNCTYPE(ctypes.c_int64, ctypes.c_size_t)(code.address)
    return function  # type: ignore[no-any-return]  # llvmlite is not typed


class HasAddresses(Protocol):
    """A call that machine code can make."""

    when: NDArray[np.int64] | None

    @property
    def addresses(self) -> tuple[int, int]:
        """The addresses of machine code and of its arguments."""


def call_table(
    calls: Sequence[HasAddresses], running: NDArray[np.int64], cursor: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Make the table of calls without owners, attention and time stamps. Keep the calls and arrays
    alive.

    Args:
        calls: what is called, in this order.
        running: (1,), the number of the call that runs is written there.
        cursor: (1,), the address of the present row of time stamps.

    Raises:
        ValueError: a call has no machine code.
    """
    table = np.zeros(HEAD + WIDTH * len(calls), np.int64)
    for row, call in zip(rows_of(table), calls, strict=True):
        row[:2] = call.addresses
        row[STAMP] = -1
        if call.when is not None:
            row[WHEN] = call.when.ctypes.data
    table[ERROR_FLAG] = error_record().ctypes.data
    table[CLOCK] = clock_address()
    table[ENTRIES] = len(calls)
    table[RUNNING] = running.ctypes.data
    table[CURSOR] = cursor.ctypes.data
    return table


def rows_of(table: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the entries of a table, (n, ``WIDTH``), in its memory."""
    return table[HEAD:].reshape(-1, WIDTH)


@cache
def clock_address() -> int:
    """Return the address of the function behind ``time.perf_counter_ns``; zero where it is not
    known."""
    if not sys.platform.startswith("linux"):
        return 0
    return ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value or 0


def _module() -> Any:
    """Return the function in LLVM's language."""
    from llvmlite import ir

    from .machine_code import ENTRY

    word, narrow = ir.IntType(64), ir.IntType(32)
    module = ir.Module("aloft.chain")
    function = ir.Function(module, ir.FunctionType(word, [word]), ENTRY)
    blocks = [function.append_basic_block(name) for name in _STEPS]
    start, test, call, look, make, failed, called, asks, stamps, take, following, done = blocks
    builder = ir.IRBuilder(start)

    def constant(value: int) -> Any:
        return ir.Constant(word, value)

    def pointer(address: Any) -> Any:
        return builder.inttoptr(address, word.as_pointer())

    def at(address: Any, place: int) -> Any:
        return builder.gep(pointer(address), [constant(place)])

    (table,) = function.args
    failure = builder.load(at(table, ERROR_FLAG))
    builder.store(constant(0), pointer(failure))
    clock = builder.load(at(table, CLOCK))
    count = builder.load(at(table, ENTRIES))
    running = builder.load(at(table, RUNNING))
    stamped = builder.load(pointer(builder.load(at(table, CURSOR))))
    no_stamps = builder.icmp_signed("==", stamped, constant(0))
    time = builder.alloca(ir.ArrayType(word, 2))
    first = builder.load(at(table, NEXT))
    builder.branch(test)

    builder.position_at_end(test)
    number = builder.phi(word)
    number.add_incoming(first, start)
    builder.cbranch(builder.icmp_signed("<", number, count), call, done)

    builder.position_at_end(call)
    entry = builder.add(table, builder.mul(number, constant(8 * WIDTH)))
    entry = builder.add(entry, constant(8 * HEAD))
    builder.store(number, at(table, NEXT))
    builder.store(builder.load(at(entry, OWNER)), pointer(running))
    when = builder.load(at(entry, WHEN))
    builder.cbranch(builder.icmp_signed("!=", when, constant(0)), look, make)

    builder.position_at_end(look)
    now_made = builder.icmp_signed("!=", builder.load(pointer(when)), constant(0))
    builder.cbranch(now_made, make, called)

    builder.position_at_end(make)
    kernel = ir.FunctionType(ir.VoidType(), [word]).as_pointer()
    address = builder.inttoptr(builder.load(at(entry, FUNCTION)), kernel)
    builder.call(address, [builder.load(at(entry, ARGUMENTS))])
    error = builder.load(pointer(failure))
    builder.cbranch(builder.icmp_signed("!=", error, constant(0)), failed, called)

    builder.position_at_end(failed)
    builder.ret(constant(-1))

    builder.position_at_end(called)
    after = builder.add(number, constant(1))
    attention = builder.load(at(entry, ATTENTION))
    builder.cbranch(builder.icmp_signed("!=", attention, constant(0)), asks, stamps)

    builder.position_at_end(asks)
    wanted = builder.icmp_signed("!=", builder.load(pointer(attention)), constant(0))
    leave = function.append_basic_block("leave")
    builder.cbranch(wanted, leave, stamps)
    builder.position_at_end(leave)
    builder.store(after, at(table, NEXT))
    builder.ret(after)

    builder.position_at_end(stamps)
    place = builder.load(at(entry, STAMP))
    skipped = builder.or_(no_stamps, builder.icmp_signed("<", place, constant(0)))
    builder.cbranch(skipped, following, take)

    builder.position_at_end(take)
    kind = ir.FunctionType(narrow, [narrow, word.as_pointer()]).as_pointer()
    value = builder.bitcast(time, word.as_pointer())
    builder.call(builder.inttoptr(clock, kind), [ir.Constant(narrow, _MONOTONIC), value])
    seconds = builder.load(value)
    rest = builder.load(builder.gep(value, [constant(1)]))
    now = builder.add(builder.mul(seconds, constant(10**9)), rest)
    builder.store(now, pointer(builder.add(stamped, place)))
    builder.branch(following)

    builder.position_at_end(following)
    number.add_incoming(after, following)
    builder.branch(test)

    builder.position_at_end(done)
    builder.store(constant(0), at(table, NEXT))
    builder.ret(constant(0))
    return module


_STEPS = (
    "start", "test", "call", "look", "make", "failed", "called", "asks", "stamps", "take", "following", "done",
)  # fmt: skip
