"""Kernels become machine code that computes what Python computes, or are refused with their line."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.mathematics.compiling.arguments import pack, type_of
from aloft.mathematics.compiling.failures import CompileError
from aloft.mathematics.compiling.machine_code import MachineCode
from aloft.mathematics.compiling.translate import Translator
from aloft.mathematics.kernel import kernel

from .kernels_for_tests import total_of_positive

Array = Any
SIZES = (2.0, 3)


class Mode(IntEnum):
    """Two numbers with names."""

    UP = 3
    DOWN = 7


class Body(NamedTuple):
    """Arrays and a number."""

    R: Array
    v: Array
    mass: float


def run(function: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel as machine code."""
    signature = tuple(type_of(each) for each in arguments)
    code = MachineCode(Translator().object_code(function, signature))
    words = pack(arguments)
    code.function(ctypes.c_size_t(words.ctypes.data))


def both(function: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel as machine code and as Python, and compare what they write."""
    plain = tuple(a.copy(order="K") if isinstance(a, np.ndarray) else a for a in arguments)
    function(*plain)
    run(function, *arguments)
    for a, b in zip(arguments, plain, strict=True):
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b)


@kernel
def whole_numbers(a: int, b: int, out: Array) -> None:
    out[0] = a // b
    out[1] = a % b
    out[2] = a * b - (a + b)
    out[3] = abs(a) + max(a, b, 3) - min(a, b)
    out[4] = (a & 7) | (abs(b) << 2) ^ (a >> 1)
    out[5] = -a
    out[6] = 2 ** abs(b) + b**2
    out[7] = int(a / b)
    out[8] = a**3 - b**5 + 10**13


@kernel
def fractions(x: float, y: float, out: Array) -> None:
    out[0] = x // y
    out[1] = x % y
    out[2] = x / y + x**2 - 3
    out[3] = max(x, y) - min(x, y, 1)
    out[4] = round(x)
    out[5] = math.floor(x) + math.ceil(y)
    out[6] = int(x)
    out[7] = math.copysign(1.0, x) * abs(y)
    out[8] = max(x, 2) - min(-3, y)


@given(st.integers(-60, 60), st.integers(-20, 20).filter(bool))
def test_whole_numbers_are_those_of_python(a: int, b: int) -> None:
    compare(whole_numbers, a, b)


@given(
    st.floats(-1e6, 1e6),
    st.floats(-1e3, 1e3).filter(lambda y: abs(y) > 1e-3) | st.sampled_from([0.5, -2.0]),
)
@settings(max_examples=300)
def test_numbers_with_a_fraction_are_those_of_python(x: float, y: float) -> None:
    compare(fractions, x, y)


_compiled: dict[Any, MachineCode] = {}


def compare(function: Callable[..., None], *numbers: float) -> None:
    """Compile once, and compare for many numbers."""
    out, expected = np.zeros(9), np.zeros(9)
    arguments = (*numbers, out)
    if function not in _compiled:
        signature = tuple(type_of(each) for each in arguments)
        _compiled[function] = MachineCode(Translator().object_code(function, signature))
    words = pack(arguments)
    _compiled[function].function(ctypes.c_size_t(words.ctypes.data))
    function(*numbers, expected)
    assert out.tobytes() == expected.tobytes(), (out, expected)


@kernel
def conditions(x: Array, flags: Array, out: Array) -> None:
    for i in range(x.shape[0]):
        value = x[i]
        flags[i] = value > 0.0 and not (value < 1.0 or value == 2.0)
        if 0.0 < value <= 2.0:
            out[i] = 1
        elif value or flags[i]:
            out[i] = 2 if value < 0.0 else 3.5
        else:
            out[i] = Mode.UP + Mode.DOWN
    first = -1
    while first < 10:
        first += 1
        if first == 3:
            continue
        if first >= x.shape[0]:
            break
        out[first] += SIZES[0] * SIZES[1]
    for i in range(5, 0, -2):
        if i == 100:
            break
        out[0] += i
    else:
        out[0] += 0.5


def test_conditions_and_loops() -> None:
    both(conditions, np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 3.0]), np.zeros(6, bool), np.zeros(6))


@kernel
def parts(body: Body, A: Array, out: Array, counts: Array) -> None:
    row = A[-1]
    column = A[:, 1]
    block = A[1:3, :2]
    out[0] = row[-2] + column[2] + block[-1, 0] + A.T[3, 1] + A[0, 1:][0]
    out[1] = len(column) + A.size + row.shape[0] + A.ndim
    for i in range(3):
        out[2] += body.R[i, 0] * body.v[i] * body.mass
    block[:] = 0.5
    np.multiply(row, 2.0, row)
    np.add(row, A[0], row)
    column[1:] = A[1:, 3]
    counts[1] = counts[0] + 3
    counts[0] -= 1
    a, (b, c) = 1.0, (2, 3)
    out[3] = a + b * c
    a, b = b, a
    out[4] = a - b


@pytest.mark.parametrize("order", ["C", "F", "A"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_parts_of_arrays(order: str, dtype: type) -> None:
    A = np.array(np.arange(1.0, 13.0).reshape(3, 4), dtype, order=order if order != "A" else "C")
    if order == "A":
        A = np.arange(60.0).astype(dtype).reshape(6, 10)[::2, 1:9:2]
    body = Body(np.arange(9.0).reshape(3, 3), np.ones(3), 2.5)
    both(parts, body, A, np.zeros(6), np.array([5, 6], np.int32))


@kernel
def begins_whole(values: Array, out: Array) -> None:
    total = 0
    for i in range(values.shape[0]):
        total = total + values[i]
    best = 0 if total > 100.0 else total
    out[0], out[1] = best, total


def test_a_variable_has_the_widest_of_its_types() -> None:
    both(begins_whole, np.array([0.25, 1.5]), np.zeros(2))


@kernel
def products(A: Array, x: Array, y: Array, z: Array) -> None:
    np.dot(A, x, y)
    z[0] = np.dot(x, x)
    np.negative(y, y)


def test_products_sum_from_the_first_to_the_last() -> None:
    A, x, y, z = np.arange(12.0).reshape(3, 4), np.arange(4.0), np.zeros(3), np.zeros(1)
    run(products, A, x, y, z)
    np.testing.assert_array_equal(y, -A @ x)
    assert z[0] == x @ x


def test_a_kernel_is_not_translated_again_for_a_variable_that_begins_as_zero() -> None:
    arguments = (np.array([1.0, -2.0, 3.0]), np.zeros(1))
    module = Translator().module(total_of_positive, tuple(type_of(a) for a in arguments))
    assert module.count("define internal") == 2


@kernel
def divides(x: Array) -> None:
    for i in range(1, x.shape[0]):
        x[0] += 1.0 / x[i]
        x[0] += 7 % int(x[i])


@pytest.mark.parametrize("value", [0.0, -0.0])
def test_a_division_by_zero_is_pythons_error_and_ends_the_kernel(value: float) -> None:
    x = np.array([0.0, 2.0, value, 4.0])
    with pytest.raises(ZeroDivisionError, match=r"test_translate\.divides divided by zero"):
        run(divides, x)
    assert x[0] == 1.5


@kernel
def reads_unknown(out: Array) -> None:
    out[0] = never  # type: ignore[name-defined]  # noqa: F821


@kernel
def mixes(out: Array) -> None:
    mixed = 1.0
    if out[0] > 0.0:
        mixed = out
    out[0] = mixed


@kernel
def copies(out: Array) -> None:
    other = out.copy()
    out[0] = other[0]


@kernel
def returns_array(out: Array) -> Array:
    return out[1:]


@kernel
def indexes(x: float, out: Array) -> None:
    out[x] = 1.0


@kernel
def goes_over(values: Array, out: Array) -> None:
    for value in values:
        out[0] += value


@kernel
def names_argument(out: Array) -> None:
    out[0] = max(1.0, key=2.0)  # type: ignore[call-overload]


@kernel
def has_list(out: Array) -> None:
    out[0] = [1.0][0]


@pytest.mark.parametrize(
    ("function", "arguments", "text", "line"),
    [
        (reads_unknown, (np.zeros(1),), "there is no never", 1),
        (mixes, (np.zeros(1),), "this is a number (float) here and an array of 1 dim", 3),
        (copies, (np.zeros(2),), "out.copy is no kernel, and nothing that kernels may call", 1),
        (returns_array, (np.zeros(2),), "a kernel returns numbers, or a tuple of numbers", 1),
        (indexes, (1.0, np.zeros(2)), "an index is a whole number; write int(...)", 1),
        (goes_over, (np.zeros(2), np.zeros(2)), "a loop goes over range(...)", 1),
        (names_argument, (np.zeros(2),), "a kernel passes arguments by position; write a loop", 1),
        (has_list, (np.zeros(2),), "compiled kernels have no list", 1),
        (divides, (1.0,), "this takes an array, not a number (float)", 1),
        (divides, (), "takes 1 arguments, and gets 0", 0),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_line(
    function: Any, arguments: tuple[Any, ...], text: str, line: int
) -> None:
    with pytest.raises(CompileError) as error:
        Translator().object_code(function, tuple(type_of(each) for each in arguments))
    said = str(error.value)
    first = function.__code__.co_firstlineno
    assert text in said
    assert f"{__file__}:{first + 1 + line}: " in said or line == 0
    assert f".{function.__name__} does not compile" in said
