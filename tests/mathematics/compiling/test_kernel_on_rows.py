"""Calls on the first rows of kept arrays: they compute what the kernel does on arrays of that length."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
import pytest

from aloft.mathematics.arrays import Array, Array1D, Array2D
from aloft.mathematics.compiling import kernel_on_rows
from aloft.mathematics.compiling.kernel_on_rows import LEAST, KernelOnRows
from aloft.mathematics.kernel import kernel


class Terms(NamedTuple):
    """What is computed: one number a row, and one for each stretch and its end."""

    sums: Array1D
    ends: Array1D


@kernel
def add_rows(factor: float, rows: Array2D, starts: Array1D, fixed: Array1D, out: Terms) -> None:
    """Sums of rows, and what is in the starts doubled."""
    for i in range(rows.shape[0]):
        out.sums[i] = fixed[0] * factor
        for k in range(rows.shape[1]):
            out.sums[i] = out.sums[i] + rows[i, k]
    for i in range(starts.shape[0]):
        out.ends[i] = starts[i] + starts[i]


def make(count: int, stretches: int) -> tuple[Any, ...]:
    ends = np.zeros(stretches + 1)
    return 2.0, np.zeros((count, 3)), np.zeros(stretches + 1), FIXED, Terms(np.zeros(count), ends)


FIXED = np.array([0.5])


def check(call: KernelOnRows, count: int, stretches: int) -> None:
    rng = np.random.default_rng(count)
    _, rows, starts, fixed, out = call.rows(count, stretches)
    assert rows.shape == (count, 3) and starts.shape == out.ends.shape == (stretches + 1,)
    assert fixed is FIXED
    rows[:], starts[:] = rng.normal(size=rows.shape), rng.normal(size=len(starts))
    call.run()
    assert (out.sums == 1.0 + rows[:, 0] + rows[:, 1] + rows[:, 2]).all()
    assert (out.ends == 2.0 * starts).all()


@pytest.mark.parametrize("compiled", [True, False])
def test_rows_of_any_number(compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not compiled:
        monkeypatch.setattr(kernel_on_rows, "compile_calls", lambda calls: "none of them")
    call = KernelOnRows(add_rows, make)
    for count, stretches in ((5, 1), (3, 2), (0, 0), (LEAST + 1, 2), (7, LEAST + 5), (7, 2)):
        check(call, count, stretches)
        check(call, count, stretches)


def test_what_is_behind_the_rows_stays() -> None:
    call = KernelOnRows(add_rows, make)
    longer = call.rows(9, 3)[-1]
    longer.sums[:], longer.ends[:] = 7.0, 7.0
    check(call, 4, 1)
    assert (longer.sums[4:] == 7.0).all() and (longer.ends[2:] == 7.0).all()


def test_each_thread_has_its_own_rows() -> None:
    call, found = KernelOnRows(add_rows, make), list[Array]()

    def other() -> None:
        check(call, 6, 1)
        found.append(call.rows(6, 1)[1])

    own = call.rows(6, 1)[1]
    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert len(found) == 1 and not np.shares_memory(own, found[0])


def test_rows_come_before_the_call() -> None:
    with pytest.raises(
        ValueError, match=r"rows\(\) must tell how many rows there are before run\(\)"
    ):
        KernelOnRows(add_rows, make).run()
