"""Kernels call functions of Numba: the same bytes in all tiers, kept between processes, and refused by name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from aloft.mathematics.arrays import Array1D, Vector3
from aloft.mathematics.compiling import compile_calls as module
from aloft.mathematics.compiling import numba_calls
from aloft.mathematics.compiling.arguments import type_of
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.fingerprint import fingerprint
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.rehearsal import explained, mistake_in
from aloft.mathematics.kernel import kernel

GAIN = 2.0


@numba.njit
def inner(x: float) -> float:
    return GAIN * x


@numba.njit
def outer(x: float) -> tuple[float, int]:
    if x > 100.0:
        raise ValueError("too large")
    return inner(x) + 1.0, 3


@numba.njit
def drawn() -> float:
    return np.random.normal()  # noqa: NPY002  # Numba has no other


@numba.njit
def makes(a: Any) -> Any:
    return a * 2.0


@numba.njit
def matches(a: Any) -> None:
    try:
        a[0] = 1.0 / a[1]
    except ZeroDivisionError:
        a[0] = 2.0


@numba.njit
def prints(x: float) -> float:
    print("x is", x)
    return 2.0 * x


@kernel
def catches(y: Vector3) -> None:
    matches(y)


@kernel
def speaks(y: Vector3) -> None:
    y[0] = prints(y[1])


@kernel
def calls(u: Vector3, y: Vector3) -> None:
    y[0], y[1] = outer(u[0])
    y[2] = y[0] * u[1]


@kernel
def draws(y: Array1D) -> None:
    y[0] = drawn()


@kernel
def takes_an_array(u: Vector3, y: Vector3) -> None:
    made = makes(u)
    y[0] = made[0]


def test_tiers_agree_and_an_error_keeps_its_text(own_cache: None) -> None:
    u, y = np.array([1.5, -2.0, 0.0]), np.zeros(3)
    call = KernelCall(calls, u, y)
    assert compile_calls([call]) == ""
    call.run()
    plain = np.zeros(3)
    calls(u, plain)
    assert y.tolist() == [4.0, 3.0, -8.0] and y.tobytes() == plain.tobytes()
    u[0] = 101.0
    with pytest.raises(RuntimeError, match="called a numba function that raised an error") as error:
        call.run()
    said = str(explained(error.value, [call]))
    assert said.startswith(f"{__file__}:") and said.endswith("ValueError: too large")


def test_the_name_of_machine_code_counts_functions_below(monkeypatch: pytest.MonkeyPatch) -> None:
    types = (type_of(np.zeros(3)),) * 2
    first = fingerprint(calls, types, "tools")
    assert first == fingerprint(calls, types, "tools")

    @numba.njit
    def other(x: float) -> float:
        return GAIN - x

    monkeypatch.setitem(outer.py_func.__globals__, "inner", other)
    assert fingerprint(calls, types, "tools") != first
    monkeypatch.undo()
    monkeypatch.setitem(inner.py_func.__globals__, "GAIN", 3.0)
    assert fingerprint(calls, types, "tools") != first


def test_what_cannot_be_called_is_named(own_cache: None) -> None:
    name = f"{__name__}.drawn"
    text = mistake_in(draws, [np.zeros(1)], run=True)
    assert (
        f"numba function {name} draws random numbers without a seed" in text
        and f"{__file__}:" in text
    )
    reason = compile_calls([KernelCall(takes_an_array, np.zeros(3), np.zeros(3))])
    assert "returns array(float64, 1d, C); a kernel takes numbers" in reason


def test_what_numba_does_not_compile_is_a_mistake_with_its_line(own_cache: None) -> None:
    text = mistake_in(catches, [np.zeros(3)], run=False)
    line = matches.py_func.__code__.co_firstlineno + 4
    assert text.startswith(f"{__file__}:") and "kernel catches: numba function " in text
    assert f"does not compile: line {line} of " in text
    assert text.endswith("test_numba_calls.py: UnsupportedError: Exception matching is limited to <class 'Exception'>")  # fmt: skip


def test_code_that_needs_objects_of_python_is_made_anew(
    own_cache: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        y = np.array([0.0, 0.25, 0.0])
        call = KernelCall(speaks, y)
        assert compile_calls([call]) == "" and call.compiled is not None
        call.run()
        sys.stdout.flush()
        assert y[0] == 0.5 and capfd.readouterr().out == "x is 0.25\n"
        monkeypatch.setattr(numba_calls, "_made", {})
        monkeypatch.setattr(numba_calls, "_addresses", {})
        monkeypatch.setattr(module, "_loaded", {})


def test_another_process_compiles_nothing_of_numba(
    own_cache: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run() -> bytes:
        y = np.zeros(3)
        call = KernelCall(calls, np.array([1.5, -2.0, 0.0]), y)
        assert compile_calls([call]) == "" and call.compiled is not None
        call.run()
        return y.tobytes()

    monkeypatch.setattr(numba_calls, "_made", {})
    monkeypatch.setattr(numba_calls, "_addresses", {})
    first = run()
    monkeypatch.setattr(module, "_loaded", {})
    monkeypatch.setattr(numba_calls, "_addresses", {})
    monkeypatch.setattr(numba_calls, "_make", None)  # would fail if something were compiled
    assert run() == first


def test_numba_is_not_imported_without_a_function_of_it() -> None:
    code = (
        "import sys, numpy as np\n"
        "from aloft.mathematics.landing_law import keep_within\n"
        "from aloft.mathematics.compiling.compile_calls import compile_calls\n"
        "from aloft.mathematics.compiling.kernel_call import KernelCall\n"
        "compile_calls([KernelCall(keep_within, *[np.zeros(3)] * 4)])\n"
        "assert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120, cwd=Path(__file__).parent)
