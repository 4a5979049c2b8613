"""A kernel is judged by the function as it is written, run by NumPy."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from aloft import Block, Field, Input, Output, Signal, cross, kernel
from aloft.mathematics.arrays import Array1D, Indices0D, Indices1D, Matrix3, Vector3
from aloft.mathematics.kernel import expand
from aloft.runtime.testing.conformance import ConformanceError, check_block
from aloft.runtime.testing.numpy_oracle import NotJudged, difference


class Three(Signal):
    """Three numbers and one."""

    v = Field(3, unit="1", text="three")
    s = Field(unit="1", text="one")


class Direction(IntEnum):
    THERE = 0
    BACK = 1


class Memory(NamedTuple):
    x: Vector3
    count: Indices1D


@kernel
def half(x: float, gain: float = 0.5) -> float:
    return gain * x if x > 0.0 else x


@kernel
def everything(A: Matrix3, u: Vector3, memory: Memory, way: int, y: Array1D) -> None:
    memory.x[:] = half(A @ u) + cross(u, A[0]) - math.sin(y[0]) * np.exp(-abs(u))
    memory.count[0] += 3 if way == Direction.BACK else 5
    y[:] = min(max(memory.x, -1.0), 1.0)


@kernel
def cancels(u: Vector3, y: Vector3) -> None:
    y[0] = np.sum(u) - u[0] - u[1] - u[2]


@kernel
def jumps(u: Vector3, y: Vector3) -> None:
    y[0] = math.floor(u[0])


@numba.njit
def power(k: int) -> int:
    return 2**k


@numba.njit
def both(u: Any, k: int) -> Any:
    return float(power(k)), np.sum(u)


@kernel
def by_numba(u: Vector3, k: int, y: Vector3) -> None:
    y[0], y[1] = both(u, k)


class Counted(NamedTuple):
    count: Indices0D
    x: Vector3


@kernel
def counts(memory: Counted, y: Vector3) -> None:
    memory.count[()] = memory.count[()] + 1
    y[0] = memory.count * memory.x[0]


@kernel
def decides(u: Vector3, count: Indices1D, y: Vector3) -> None:
    count[0] = math.floor(u[0])
    y[0] = u[1] + u[2]


def after(function: Any, *arguments: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Arguments before a call, and after it."""

    def one(each: Any) -> Any:
        if isinstance(each, tuple):
            return type(each)(*map(one, each))
        return each.copy() if isinstance(each, np.ndarray) else each

    found = tuple(map(one, arguments))
    function(*found)
    return arguments, found


def test_a_right_kernel_is_numpys_and_any_other_number_is_not() -> None:
    random = np.random.default_rng(0)
    memory = Memory(np.zeros(3), np.array([7]))
    given = random.normal(size=(3, 3)), random.normal(size=3), memory, 1, random.normal(size=3)
    before, found = after(everything, *given)
    assert not difference(everything, before, found)
    found[2].x[1] *= 1.0 + 1e-11
    assert "where NumPy has" in difference(everything, before, found)
    before, found = after(everything, *given)
    found[2].count[0] += 1
    assert difference(everything, before, found) == "[11] where NumPy has [10]"


def test_what_is_left_of_a_difference_is_rounding() -> None:
    before, found = after(cancels, np.array([1e3, 0.1, 0.7]), np.zeros(3))
    found[1][0] += 1e-13
    assert not difference(cancels, before, found)
    found[1][0] += 1e-9
    assert difference(cancels, before, found)


def test_a_number_at_a_threshold_is_judged_where_rounding_does_not_decide() -> None:
    before, found = after(jumps, np.array([2.5, 0.0, 0.0]), np.zeros(3))
    assert not difference(jumps, before, found)

    @kernel
    def refused(y: Vector3) -> None:
        y[:] = 2.0 * y if y > 0.0 else y

    with pytest.raises(NotJudged):
        difference(refused, (np.zeros(3),), (np.zeros(3),))


def block_of(kernel_function: Any) -> type[Block]:
    class Judged(Block):
        """A block."""

        u = Input(Three, text="u")
        y = Output(Three, text="y")
        step = staticmethod(kernel_function)

    return Judged


@kernel
def turned(u: Three, y: Three) -> None:
    """What the block is to do."""
    y.v[:] = u.v[::-1] * u.s
    y.s = u.s + 1.0


def not_turned(u: Three, y: Three) -> None:
    for i in range(3):
        y.v[i] = float(u.v[i]) * float(u.s[()])
    y.s[()] = float(u.s[()]) + 1.0


def test_a_block_is_checked_with_numpys_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    check_block(block_of(turned), cases=["kernels"])
    expand(turned)
    monkeypatch.setattr("aloft.runtime.testing.bench.compile_calls", lambda calls: "")
    monkeypatch.setattr(turned, "__code__", not_turned.__code__)
    with pytest.raises(ConformanceError, match=r"turned makes .* where NumPy has"):
        check_block(block_of(turned), cases=["kernels"])


def test_a_number_in_memory_of_its_own_is_read_like_an_array_too() -> None:
    given = Counted(np.array(3), np.array([0.5, 1.0, 2.0])), np.zeros(3)
    before, found = after(counts, *given)
    assert found[0].count == 4
    assert found[1][0] == 2.0
    assert not difference(counts, before, found)
    found[0].count[()] = 5
    assert difference(counts, before, found)


def test_at_a_threshold_only_what_is_numpys_is_judged() -> None:
    given = np.array([2.0, 0.1, 0.2]), np.zeros(1, np.int64), np.zeros(3)
    before, found = after(decides, *given)
    assert not difference(decides, before, found)
    found[1][0] = 1
    with pytest.raises(NotJudged):
        difference(decides, before, found)


def test_functions_of_numba_are_judged_as_they_are_written() -> None:
    u = np.array([0.1, 0.2, 0.3])
    assert not difference(by_numba, *after(by_numba, u, 3, np.zeros(3)))
    said = difference(by_numba, *after(by_numba, u, -1, np.zeros(3)))
    assert said.endswith("where NumPy has [0.5 0.6 0. ]")
