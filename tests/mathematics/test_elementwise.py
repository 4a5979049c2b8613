"""Functions of arrays are those of a multiprecision library, have the same bits as machine code, and leave the numbers outside of their
domain to the check that all signals are finite."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from aloft.mathematics import elementwise
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.kernel_registry import arguments_of

TRUE = {
    "tan": mpmath.tan, "asin": mpmath.asin, "atan": mpmath.atan, "sinh": mpmath.sinh, "cosh": mpmath.cosh,
    "log10": mpmath.log10,
}  # fmt: skip
KERNELS = {
    **elementwise.FUNCTIONS, **elementwise.OF_TWO, "/": elementwise.divide, "%": elementwise.remainder,
    "**": elementwise.power, "<": elementwise.less, "<=": elementwise.less_equal,
    "==": elementwise.equal, "!=": elementwise.not_equal, "choose": elementwise.choose,
    "+": elementwise.add, "-": elementwise.subtract, "*": elementwise.multiply, "same": elementwise.positive,
    "negative": elementwise.negative,
}  # fmt: skip
RANDOM = np.random.default_rng(5)
SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, -3.0, 100.0, 710.0, 5e-324, math.inf, -math.inf]
NUMBERS = np.concatenate(
    (SPECIAL, RANDOM.uniform(-1.0, 1.0, 80), RANDOM.normal(size=80) * 10.0 ** RANDOM.uniform(-9, 9, 80))
)  # fmt: skip


def arrays(count: int) -> list[np.ndarray]:
    return [np.random.default_rng(k).permutation(NUMBERS) for k in range(count)]


@pytest.mark.parametrize("name", TRUE)
def test_errors_are_below_four_ulps(name: str) -> None:
    numbers = RANDOM.uniform(0.0, 1.0, 200) if name == "asin" else abs(NUMBERS)
    u = numbers[np.isfinite(numbers) & (numbers > 0.0) & (numbers < 1e5)]
    out = np.zeros_like(u)
    with np.errstate(over="ignore"):
        elementwise.FUNCTIONS[name](u, out)
    with mpmath.workdps(40):
        for x, found in zip(u.tolist(), out.tolist(), strict=True):
            exact = TRUE[name](mpmath.mpf(x))
            if abs(exact) < np.finfo(float).max:
                error = abs(mpmath.mpf(found) - exact)
                assert error <= 4.0 * math.ulp(float(exact)), x
            else:
                assert found == math.inf


def test_powers_are_near_and_those_of_whole_numbers_nearer() -> None:
    a, b = abs(RANDOM.normal(size=300)) + 1e-3, RANDOM.uniform(-30.0, 30.0, 300)
    b[:150] = np.round(b[:150])
    out = np.zeros_like(a)
    elementwise.power(a, b, out)
    with mpmath.workdps(40):
        for x, y, found in zip(a.tolist(), b.tolist(), out.tolist(), strict=True):
            exact = mpmath.power(mpmath.mpf(x), mpmath.mpf(y))
            allowed = abs(y) if y == round(y) else 4.0 + 2.0 * abs(y * math.log(x))
            assert abs(mpmath.mpf(found) - exact) <= (1.0 + allowed) * math.ulp(float(exact)), (
                x,
                y,
            )


def test_powers_of_ten_have_whole_logarithms() -> None:
    whole = np.arange(-22.0, 23.0)
    out = np.zeros_like(whole)
    elementwise.FUNCTIONS["log10"](np.array([float(f"1e{int(k)}") for k in whole]), out)
    assert out.tolist() == whole.tolist()


@pytest.mark.parametrize(
    ("name", "a", "b", "expected"),
    [
        ("/", 1.0, 0.0, math.inf), ("/", -1.0, 0.0, -math.inf), ("/", 1.0, -0.0, -math.inf), ("/", 0.0, 0.0, math.nan),
        ("%", -1.0, 3.0, 2.0), ("%", 1.0, 0.0, math.nan), ("**", 0.0, 0.0, 1.0), ("**", 0.0, -1.0, math.inf),
        ("**", -2.0, 3.0, -8.0), ("**", -8.0, 1.0 / 3.0, math.nan), ("**", 4.0, 0.5, 2.0), ("**", -1.0, 65.0, -1.0),
    ],
)  # fmt: skip
def test_the_borders_of_domains(name: str, a: float, b: float, expected: float) -> None:
    out = np.zeros(1)
    KERNELS[name](np.array([a]), np.array([b]), out)
    assert out[0] == pytest.approx(expected, rel=1e-12, nan_ok=True)


def test_machine_code_has_the_bits_of_plain_python() -> None:
    plain, calls = {}, {}
    for name, function in KERNELS.items():
        given = arrays(len(arguments_of(function)) - 1)
        plain[name], out = np.zeros_like(NUMBERS), np.zeros_like(NUMBERS)
        with np.errstate(all="ignore"):
            function(*given, plain[name])
        calls[name] = KernelCall(function, *given, out), out
    assert compile_calls([call for call, _ in calls.values()]) == ""
    for name, (call, out) in calls.items():
        call.run()
        wanted = np.where(np.isnan(plain[name]), 0.0, plain[name])
        assert np.array_equal(np.isnan(out), np.isnan(plain[name])), name
        assert np.where(np.isnan(out), 0.0, out).tobytes() == wanted.tobytes(), name
