"""Calls of kernels and of libraries in a row: by machine code they do what Python does."""

from __future__ import annotations

import ctypes
from functools import partial

import numpy as np
import pytest

from aloft.mathematics.compiling.call_sequence import CallSequence
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.foreign_call import ForeignCall, address_of
from aloft.mathematics.compiling.kernel_call import KernelCall

from .kernels_for_tests import add_scaled, divide

MEMCPY = ctypes.CDLL(None).memcpy
"""The C function that copies bytes."""


def copying(source: np.ndarray, target: np.ndarray) -> ForeignCall:
    return ForeignCall(
        partial(np.copyto, target, source), address_of(MEMCPY), target.ctypes.data,
        source.ctypes.data, source.nbytes,
    )  # fmt: skip


def made(native: bool) -> tuple[CallSequence, np.ndarray, np.ndarray]:
    """y += 0.1 x and x = y, three times; the last copy only where ``when`` says so."""
    x, y, last = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.0, -1.0]), np.zeros(3)
    adding = KernelCall(add_scaled, x, 0.1, y)
    final = copying(y, last)
    final.when = np.array([0])
    sequence = CallSequence([adding, copying(y, x), *([adding, copying(y, x)] * 2), final])
    if native:
        assert not compile_calls([adding])
    sequence.prepare()
    assert sequence.native is native
    return sequence, x, last


def test_both_ways_give_the_same_bytes_and_leave_out_the_same_calls() -> None:
    results = []
    for native in (False, True):
        sequence, x, last = made(native)
        for _ in range(5):
            sequence.run()
        assert x[0] != 1.0
        assert not last.any(), "left out"
        sequence.calls[-1].when[0] = 1  # type: ignore[index]
        sequence.run()
        assert last.tobytes() == x.tobytes()
        results.append(x.tobytes())
    assert results[0] == results[1]


def test_a_call_without_an_address_keeps_all_of_them_in_python() -> None:
    seen: list[int] = []
    x = np.ones(3)
    adding = KernelCall(add_scaled, x, 0.1, x)
    assert not compile_calls([adding])
    sequence = CallSequence([adding, ForeignCall(partial(seen.append, 1), 0)])
    sequence.prepare()
    assert not sequence.native
    sequence.run()
    assert seen == [1] and x.tolist() == [1.1, 1.1, 1.1]


def test_an_error_of_a_kernel_is_raised_and_the_next_run_begins_anew() -> None:
    values, count = np.array([0.0, 1.0, 0.0]), np.zeros(2)
    counting = KernelCall(add_scaled, np.ones(2), 1.0, count)
    dividing = KernelCall(divide, values)
    assert not compile_calls([counting, dividing])
    sequence = CallSequence([counting, dividing])
    sequence.prepare()
    assert sequence.native
    with pytest.raises(ZeroDivisionError, match="divided by zero"):
        sequence.run()
    values[2] = 4.0
    sequence.run()
    assert values[0] == 0.25
    assert count[0] == 2.0, "the run after the error began with the first call"


def test_a_function_gets_three_arguments_at_most() -> None:
    with pytest.raises(ValueError, match="gets 3 arguments, not 4"):
        ForeignCall(lambda: None, 0, 1, 2, 3, 4)
    with pytest.raises(ValueError, match="the address of the function is not known"):
        _ = ForeignCall(lambda: None, 0).addresses
