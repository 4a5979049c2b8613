"""Elementary functions are within 1 ULP of a multiprecision library, keep C's special values, and have the same bits as machine code."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics import elementary
from aloft.mathematics.arrays import Array1D
from aloft.mathematics.compiling.arguments import pack, type_of
from aloft.mathematics.compiling.machine_code import MachineCode
from aloft.mathematics.compiling.translate import Translator
from aloft.mathematics.elementary import acos, atan2, cos, exp, expm1, hypot, log, sin, tanh
from aloft.mathematics.kernel import kernel

DIGITS = 60
LARGEST = sys.float_info.max
Numbers = np.ndarray


@kernel
def sines(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = sin(x)


@kernel
def cosines(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = cos(x)


@kernel
def angles(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = atan2(x, y)


@kernel
def arc_cosines(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = acos(x)


@kernel
def hypotenuses(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = hypot(x, y)


@kernel
def exponentials(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = exp(x)


@kernel
def exponentials_less_one(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = expm1(x)


@kernel
def logarithms(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = log(x)


@kernel
def tangents(x: Array1D, y: Array1D, out: Array1D) -> None:
    out[:] = tanh(x)


COMPILED = {
    "sin": sines, "cos": cosines, "atan2": angles, "acos": arc_cosines, "hypot": hypotenuses,
    "exp": exponentials, "expm1": exponentials_less_one, "log": logarithms, "tanh": tangents,
}  # fmt: skip
TWO = ("atan2", "hypot")
PRECISE = {
    "sin": np.sin, "cos": np.cos, "atan2": np.arctan2, "acos": np.arccos, "hypot": np.hypot,
    "exp": np.exp, "expm1": np.expm1, "log": np.log, "tanh": np.tanh,
}  # fmt: skip


def logarithmic(least: float, most: float) -> Callable[..., Numbers]:
    """Numbers of both signs with sizes from 10^least to 10^most."""

    def draw(random: np.random.Generator, n: int) -> Numbers:
        return random.choice([-1.0, 1.0], n) * 10.0 ** random.uniform(least, most, n)

    return draw


def near_quarter_turns(random: np.random.Generator, n: int) -> Numbers:
    """The numbers next to multiples of half of pi, where a reduction cancels most."""
    with mpmath.workdps(DIGITS):
        turns = [int(2.0**k) for k in random.uniform(0.0, 52.0, n)]
        return np.array([float(each * mpmath.pi / 2) for each in turns])


def up_to(size: float) -> Callable[..., Numbers]:
    return lambda random, n: random.uniform(-size, size, n)


DRAWS = {
    "sin": (up_to(0.8), up_to(7.0), up_to(1e6), up_to(9e15), logarithmic(-300, 15), near_quarter_turns),
    "cos": (up_to(0.8), up_to(7.0), up_to(1e6), up_to(9e15), logarithmic(-300, 15), near_quarter_turns),
    "atan2": (up_to(1.0), logarithmic(-20, 20), logarithmic(-300, 300)),
    "hypot": (up_to(1.0), logarithmic(-20, 20), logarithmic(-300, 300)),
    "acos": (up_to(1.0), logarithmic(-300, 0), lambda r, n: np.sign(up_to(1)(r, n)) * (1.0 - abs(logarithmic(-16, 0)(r, n)))),
    "exp": (up_to(0.4), up_to(20.0), up_to(709.0), lambda r, n: r.uniform(-745.0, -700.0, n)),
    "expm1": (up_to(0.8), up_to(20.0), up_to(709.0), logarithmic(-300, 1)),
    "log": (
        lambda r, n: r.uniform(0.6, 1.6, n), lambda r, n: 1.0 + logarithmic(-16, -0.5)(r, n),
        lambda r, n: abs(logarithmic(-307, 308)(r, n)), lambda r, n: abs(up_to(1e-310)(r, n)),
    ),
    "tanh": (up_to(1.0), up_to(22.0), logarithmic(-300, 1)),
}  # fmt: skip
CASES = [(name, k) for name, draws in DRAWS.items() for k in range(len(draws))]


@pytest.mark.parametrize(("name", "draw"), CASES)
def test_errors_are_below_one_ulp(name: str, draw: int) -> None:
    random = np.random.default_rng(draw)
    columns = [DRAWS[name][draw](random, 250).tolist() for _ in range(1 + (name in TWO))]
    function, true = getattr(elementary, name), getattr(mpmath, name)
    with mpmath.workdps(DIGITS):
        for arguments in zip(*columns, strict=True):
            exact = true(*map(mpmath.mpf, arguments))
            if abs(exact) > LARGEST:
                continue
            error = abs(mpmath.mpf(function(*arguments)) - exact)
            assert error < math.ulp(float(exact)), (name, arguments)


@pytest.mark.parametrize("name", COMPILED)
def test_machine_code_has_the_bits_of_plain_python(name: str) -> None:
    random = np.random.default_rng(8)
    x, y = (
        np.concatenate([draw(random, 200) for draw in DRAWS[name]] + [SPECIAL]) for _ in range(2)
    )
    random.shuffle(y)
    out = np.zeros_like(x)
    run(name, x, y, out)
    plain = getattr(elementary, name)
    arguments = zip(x.tolist(), y.tolist(), strict=True)
    expected = [plain(*each) if name in TWO else plain(each[0]) for each in arguments]
    assert out.tobytes() == np.array(expected).tobytes()


def run(name: str, x: Numbers, y: Numbers, out: Numbers) -> None:
    """Write the values of a compiled function."""
    signature = tuple(type_of(each) for each in (x, y, out))
    code = MachineCode(Translator().object_code(COMPILED[name], signature))
    words = pack((x, y, out))
    code.function(ctypes.c_size_t(words.ctypes.data))


SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, 5e-324, LARGEST, 710.0, -746.0])


@pytest.mark.parametrize("name", COMPILED)
def test_special_values_are_those_of_c(name: str) -> None:
    for x in SPECIAL.tolist():
        for y in SPECIAL.tolist() if name in TWO else [0.0]:
            arguments = (x, y) if name in TWO else (x,)
            try:
                expected = getattr(math, name)(*arguments)
            except ValueError:
                expected = -math.inf if name == "log" and x == 0.0 else math.nan
            except OverflowError:
                expected = math.inf
            if name in ("sin", "cos") and abs(x) > 2.0**53:
                expected = math.nan
            found = getattr(elementary, name)(*arguments)
            assert found == pytest.approx(expected, rel=4e-16, abs=0.0, nan_ok=True), arguments
            assert math.copysign(1.0, found) == math.copysign(1.0, expected) or math.isnan(expected)


@pytest.mark.parametrize("name", COMPILED)
def test_what_is_no_number_stays_none(name: str) -> None:
    arguments = (math.nan, 1.0) if name in TWO else (math.nan,)
    assert math.isnan(getattr(elementary, name)(*arguments))


@given(st.floats(-1e9, 1e9))
def test_sine_and_cosine_together_have_the_same_bits(angle: float) -> None:
    assert elementary.sincos(angle) == (elementary.sin(angle), elementary.cos(angle))


@given(st.floats(-1e100, 1e100), st.floats(-1e100, 1e100))
def test_two_numbers_are_their_sum_and_their_product(a: float, b: float) -> None:
    with mpmath.workdps(700):
        high, low = elementary.two_sum(a, b)
        assert mpmath.mpf(high) + mpmath.mpf(low) == mpmath.mpf(a) + mpmath.mpf(b)
        high, low = elementary.two_product(a, b)
        if a == 0.0 or b == 0.0 or abs(high) > 1e-200:
            assert mpmath.mpf(high) + mpmath.mpf(low) == mpmath.mpf(a) * mpmath.mpf(b)


@pytest.mark.long
@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long doubles are no longer here")
@pytest.mark.parametrize(("name", "draw"), CASES)
def test_ten_million_errors_are_below_one_ulp(name: str, draw: int) -> None:
    if DRAWS[name][draw] is near_quarter_turns:
        pytest.skip("drawn with many digits, so the fast test has them")
    random = np.random.default_rng(99)
    n = 10_000_000 // len(CASES)
    x, y = DRAWS[name][draw](random, n), DRAWS[name][draw](random, n)
    out = np.zeros(n)
    run(name, x, y, out)
    columns = [each.astype(np.longdouble) for each in ((x, y) if name in TWO else (x,))]
    with np.errstate(over="ignore", under="ignore"):
        exact = PRECISE[name](*columns)
    fits = np.abs(exact) <= LARGEST
    ulp = np.spacing(np.abs(exact[fits]).astype(np.float64)).astype(np.longdouble)
    assert np.max(np.abs(out[fits] - exact[fits]) / ulp) < 1.0
