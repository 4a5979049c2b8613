"""Statements of kernels beside the same statements by NumPy: slices, aliasing, products, whole numbers."""

from __future__ import annotations

import math
import types
from typing import Any

import numpy as np
import pytest

from aloft.mathematics.arrays import Array1D, Array2D, Indices1D, Matrix3, Vector3
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.expressions import EquationError
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.kernel_registry import written_code
from aloft.mathematics.kernel import expand, kernel

LAST = 2


def untouched(function: Any) -> Any:
    """The function as it is written, without loops in place of equations."""
    return types.FunctionType(written_code(function), function.__globals__)


def three(function: Any, *arguments: Any) -> None:
    """NumPy, plain Python and machine code give the same."""

    def copies() -> list[Any]:
        return [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]

    expected, plain, compiled = copies(), copies(), copies()
    untouched(function)(*expected)
    function(*plain)
    call = KernelCall(function, *compiled)
    assert compile_calls([call]) == ""
    call.run()
    for one, two, three in zip(expected, plain, compiled, strict=True):
        np.testing.assert_allclose(two, one, rtol=1e-14, atol=1e-14)
        assert np.asarray(two).tobytes() == np.asarray(three).tobytes()


@kernel
def steps(a: Vector3, b: Array1D, y: Array1D) -> None:
    """Slices with steps and bounds of all kinds, of known and of unknown lengths."""
    y[0:3] = a[::-1]
    y[1::2] += b[-1::-2] - b[::2]
    y[4:] += b[3::-3] - b[::4]
    y[-3:-1] = b[:-4] + a[-2:]
    y[::-3] = 5.0
    y[:LAST] *= b[LAST : LAST + 2]
    y[:0] = 7.0


@kernel
def moving(b: Array1D, k: int, y: Array1D) -> None:
    """Bounds that are only known as it runs, negative ones, too."""
    y[k:] = b[k:]
    y[: k + 1] -= b[: k + 1]
    y[k - 1 :: -1] += 1.0
    for i in range(2):
        y[i : i + 2] = b[i : i + 2] * 2.0


@kernel
def beyond_the_end(b: Array1D, k: int, y: Array1D, r: Array1D) -> None:
    """Slices whose end, or all of which, lies beyond an array of open size."""
    y[1:7] = 2.0 * b[1:7]
    y[4:9] += 1.0
    y[k : k + 4] -= b[k : k + 4]
    y[8:9] = 5.0
    r[0], r[1] = np.sum(b[3:8]), sum(b[k : k + 9])
    r[2] = (b[2:9] * b[2:9]).max() + b[k + 1 : k + 7] @ b[k + 1 : k + 7]
    r[3] = np.sum(b[k : k + 1] * b[0:3]) + np.sum(np.ones(1) + b)
    r[0] += np.sum(b[k + 5 : 3]) + b[9:k] @ b[7:k] + np.sum(b[8:] * b[k + 7 : -1])
    r[4] = (b - np.dot(b[:0:-3], b[:0:-3])).max() + np.abs(b * np.sum(b[::-1])).min()


@kernel
def columns(A: Array2D, y: Array1D, B: Matrix3) -> None:
    """Slices in two dimensions, and of a transpose."""
    y[:] = A[::-1, 0] - A.T[1, ::-1]
    B[::2, 1:] = A[::-2, :-1]
    B[0][:] = A[-1][:]


@kernel
def own_elements(v: Array1D, A: Array2D) -> None:
    """Elements of the target, and rows of it, are read before any is written."""
    v[:] = v / v[0] + (v @ v) ** 0.5
    A[0, :] = A[1] + A[0]


@kernel
def views(a: Array1D, y: Array1D) -> None:
    """A part with a step handed on."""
    back = a[::-2]
    for i in range(back.shape[0]):
        y[i] = back[i]
    doubled(a[3:0:-1], y[1:4])


@kernel
def doubled(a: Array1D, y: Array1D) -> None:
    y[:] = 2.0 * a


@kernel
def whole(n: Indices1D, y: Array1D) -> None:
    """Division and rest of negative numbers, shifts, powers, and bits."""
    y[0] = n[0] // n[1] + n[0] % n[1] + n[2] // -3 - n[2] % -3
    y[1] = (n[1] << 3) + (n[0] >> 1) + n[1] ** 3 + (~n[0] & 255)
    y[2] = n[0] / n[1] + round(2.5) + math.floor(-1.5) + int(-1.5)


def test_statements_are_numpys() -> None:
    random = np.random.default_rng(0)
    a, b, A = random.normal(size=3), random.normal(size=6), random.normal(size=(3, 3))
    three(steps, a, b, np.arange(6.0))
    for k in (1, 2, 3):
        three(moving, b, k, np.arange(6.0))
        three(beyond_the_end, np.arange(6.0), k, np.arange(6.0), np.zeros(5))
    three(moving, b, -2, np.arange(6.0))
    three(columns, A, np.zeros(3), np.ones((3, 3)))
    three(own_elements, a, A)
    three(views, b, np.zeros(6))
    three(functions, A, a, b[:3].copy(), np.zeros(3), np.zeros(8))
    three(whole, np.array([-7, 2, 8]), np.zeros(3))


TABLE = np.array([1.0, 2.0, 3.0])
LIMITS = (0.5, 1.5)


@kernel
def gained(x: float, gain: float = 2.0, offset: float = 0.0) -> float:
    return gain * x + offset


@kernel
def functions(A: Matrix3, u: Vector3, w: Vector3, y: Vector3, r: Array1D) -> None:
    """What people write: functions of arrays, arrays of the kernel's own, names of arguments."""
    y[:] = np.clip(u, -1.0, 1.0) + np.where(w > 0.0, w, TABLE) * np.minimum(u, w)
    y[:] += np.cross(u, np.dot(A, w)) / np.linalg.norm(u) + np.outer(u, w)[1] + np.sin(w)
    y[:] += w - np.dot(np.cross(u, A[:, 1]), np.cross(u, A[:, 1]))
    t = np.zeros(3)
    for i, (a, b) in enumerate(zip(u, w, strict=True)):
        t[i] = a - b
    both = u + t
    both *= 2.0
    y[u > 0.0] = gained(w[0], offset=0.5)
    y[w < 0.0] += both[w < 0.0]
    r[0], r[1], r[2] = np.sum(A), u.max(), sum(u)
    r[3], r[4], r[5] = np.argmax(both), np.mean(A @ u), np.eye(3)[1] @ np.array([w[2], 1.0, 2.0])
    if (x := r[0]) > 0.0 and np.any(u < 0.0):
        r[6] = x
    for row in A:
        r[7] += row[0] * row[-1]
    filled = np.full(3, LIMITS[1])
    r[:3] += np.minimum(filled, np.clip(filled[::-1], LIMITS[0], r[0]))


@kernel
def grows(n: Indices1D) -> None:
    n[0] = n[0] * n[1] + n[2]


@kernel
def divided(n: Indices1D) -> None:
    n[0] = n[0] // n[1]


@kernel
def shifted(n: Indices1D) -> None:
    n[0] = n[0] << n[1]


@kernel
def rounded(x: Array1D) -> None:
    x[0] = int(x[1])


@kernel
def root(x: Array1D) -> None:
    x[0] = math.sqrt(x[1])


@kernel
def power(x: Array1D) -> None:
    x[0] = x[1] ** x[2]


@pytest.mark.parametrize(
    ("function", "values", "error", "text"),
    [
        (grows, [2**40, 2**40, 0], OverflowError, "does not fit into 64 bits"),
        (grows, [2**62, 1, 2**62], OverflowError, "does not fit into 64 bits"),
        (divided, [-(2**63), -1, 0], OverflowError, "does not fit into 64 bits"),
        (shifted, [1, 64, 0], OverflowError, "does not fit into 64 bits"),
        (shifted, [1, -1, 0], ValueError, "outside of its domain"),
        (rounded, [0.0, 1e30], OverflowError, "does not fit into 64 bits"),
        (root, [0.0, -1.0], ValueError, "outside of its domain"),
        (power, [0.0, -8.0, 1 / 3], ValueError, "outside of its domain"),
        (power, [0.0, 1e300, 2.5], OverflowError, "beyond the largest float"),
    ],
)
def test_numbers_out_of_range_end_the_run_and_never_wrap(
    function: Any, values: list[float], error: type[Exception], text: str
) -> None:
    call = KernelCall(function, np.array(values))
    assert compile_calls([call]) == ""
    with pytest.raises(error, match=text):
        call.run()
    assert call.arguments[0].tolist() == values


@kernel
def too_short(b: Array1D, k: int, y: Vector3) -> None:
    y[:] = y - b[k : k + 3]


@kernel
def too_short_a_copy(b: Array1D, k: int, y: Vector3) -> None:
    t = b[k : k + 2].copy()
    y[0] = t[0]


@kernel
def too_short_a_factor(b: Array1D, k: int, y: Vector3) -> None:
    y[0] = y @ b[k:8]


@kernel
def repeated_by_numpy(b: Array1D, k: int, y: Vector3) -> None:
    y[0] = np.sum(y * b[k:6])


@kernel
def empty(b: Array1D, k: int, y: Vector3) -> None:
    y[0] = np.sum(y * b[k + 1 : k + 2])


@pytest.mark.parametrize(
    ("function", "most"),
    [(too_short, 3), (too_short_a_copy, 4), (too_short_a_factor, 3), (empty, 4)],
)
def test_slices_that_are_too_short_end_the_run_in_all_tiers(function: Any, most: int) -> None:
    three(function, np.arange(6.0), most, np.ones(3))
    for k in (most + 1, most + 2):
        y = np.ones(3)
        with pytest.raises(IndexError, match=r"a slice of . elements stands where . are"):
            function(np.arange(6.0), k, y)
        call = KernelCall(function, np.arange(6.0), k, y)
        assert compile_calls([call]) == ""
        with pytest.raises(IndexError, match="slice of another length than what it is combined"):
            call.run()
        assert y.tolist() == [1.0, 1.0, 1.0]


@kernel
def mean_of_nothing(b: Array1D, k: int, y: Vector3) -> None:
    y[0] = np.mean(b[k + 2 : 3])


def test_the_mean_of_nothing_is_a_division_by_zero() -> None:
    three(mean_of_nothing, np.arange(6.0), 0, np.zeros(3))
    call = KernelCall(mean_of_nothing, np.arange(6.0), 3, np.zeros(3))
    assert compile_calls([call]) == ""
    for run in (call.run, lambda: mean_of_nothing(*call.arguments)):
        with pytest.raises(ZeroDivisionError):
            run()


def test_what_is_written_out_is_numpys() -> None:
    random = np.random.default_rng(2)
    u, A = random.normal(size=3), random.normal(size=(3, 3))
    three(written_out, u, A, np.zeros(4, np.int64), np.zeros(3), np.ones((3, 3)))


def test_arrays_carried_from_round_to_round_are_numpys() -> None:
    random = np.random.default_rng(1)
    u, A = random.normal(size=3), random.normal(size=(3, 3))
    three(carried, u, A, np.zeros(3), np.zeros((3, 3)))


def test_a_slice_that_numpy_would_repeat_ends_the_run() -> None:
    untouched(repeated_by_numpy)(np.arange(6.0), 5, np.ones(3))
    with pytest.raises(IndexError, match=r"a slice of . elements stands where . are"):
        repeated_by_numpy(np.arange(6.0), 5, np.ones(3))


def test_whole_numbers_at_the_limit_are_exact() -> None:
    for function, values, found in (
        (grows, [2**31, 2**31, -1], 2**62 - 1),
        (grows, [2**62, -2, 0], -(2**63)),
        (divided, [-(2**63), 1, 0], -(2**63)),
        (shifted, [-1, 63, 0], -(2**63)),
    ):
        call = KernelCall(function, np.array(values))
        assert compile_calls([call]) == ""
        call.run()
        assert call.arguments[0][0] == found


@kernel
def made_in_a_loop(u: Vector3, y: Vector3) -> None:
    last = u
    for i in range(3):
        t = u * i
        y[:] = last
        last = t


@kernel
def carried(u: Vector3, A: Matrix3, y: Vector3, M: Matrix3) -> None:
    """Arrays that each round makes anew of those of the round before."""
    T, x, a, b, k = np.eye(3), u, u + 0.0, 0.5 * u, 0
    for i in range(3):
        T = T @ A
        if u[i] > -0.5:
            x = A @ x - x[::-1] + u
        a, b = b + u, a - x
    while k < 3:
        x = np.outer(x, u)[1] + np.array([x[1], x[0], x[2]])
        k += 1
    y[:] = x + a - 2.0 * b
    M[:] = T


@kernel
def written_out(u: Vector3, A: Matrix3, n: Indices1D, y: Vector3, M: Matrix3) -> None:
    """Lists of numbers, elements by names, rows and columns in one number each, constants of modules."""
    a, b, c = u - 1.0
    M[0] = [a, 2, u[0]]
    M[:, 1] = (1.0, b, M[0, 0])
    M[2] += [c, 0.0, 1]
    y[:] = np.linalg.norm(A, axis=1) + np.sum(A * 2.0 - M, axis=0)
    y += np.mod(u, 2 * np.pi) - np.clip(A.max(axis=-1), -math.pi, np.pi / 2)
    y -= np.round(4.0 * u) + np.deg2rad(u)
    n[:3] = np.argmin(A, axis=0)


@kernel
def seen_later(u: Vector3, y: Vector3) -> None:
    x = u + 0.0
    for _ in range(3):
        last = x
        x = x + u
        y += last


@kernel
def part_kept(u: Vector3, A: Matrix3, y: Vector3) -> None:
    row = u
    for i in range(3):
        T = A * i
        if i > 0:
            y += row
        row = T[0]


@kernel
def unknown_argument(y: Vector3) -> None:
    y[0] = gained(1.0, factor=2.0)


@kernel
def of_unknown_size(a: Array1D, y: Array1D) -> None:
    t = a * 2.0
    y[:] = t


@kernel
def selected(u: Vector3, y: Vector3) -> None:
    y[0] = np.sum(u[u > 0.0])


@kernel
def beyond(a: Vector3, y: Vector3) -> None:
    y[:] = a * a[3]


@kernel
def below(a: Vector3) -> None:
    a[-4] = 1.0


@kernel
def unequal(a: Vector3, A: Matrix3, b: Array1D, y: Vector3) -> None:
    y[:] = a + A[0, :2]


@kernel
def turned(A: Matrix3) -> None:
    A[:] = A.T


@kernel
def rows_by_a_list(A: Matrix3) -> None:
    A[[0, 2]] = A[[2, 0]]


@kernel
def taken_apart(B: Array2D, y: Vector3) -> None:
    y[2], y[0] = np.sign(B[1, 1:])


@kernel
def new_axis(u: Vector3, A: Matrix3) -> None:
    A[:] = u[:, None] * u


@kernel
def changing_step(a: Array1D, k: int) -> None:
    a[::k] = 0.0


@kernel
def rolled(u: Vector3, y: Vector3, M: Matrix3) -> None:
    t = np.roll(u, 1)
    y[:] = 2.0 * t
    y += np.roll(u, 2)
    M[0] = np.roll(u, 1)


def test_what_kernels_do_not_know_is_numpys_in_plain_python_and_named() -> None:
    u, plain, expected = np.arange(3.0), [np.zeros(3), np.zeros((3, 3))], [np.zeros(3), np.zeros((3, 3))]  # fmt: skip
    rolled(u, *plain)
    untouched(rolled)(u, *expected)
    assert all(map(np.array_equal, plain, expected))
    reason = compile_calls([KernelCall(rolled, u, *plain)])
    assert "np.roll is no kernel, and nothing that kernels may call; put it into an @numba.njit function" in reason  # fmt: skip


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (beyond, "a[3] is beyond a: the indices of its 3 elements are -3 to 2"),
        (below, "a[-4] is beyond a: the indices of its 3 elements are -3 to 2"),
        (unequal, "shapes (3,) and (2,) do not fit together"),
        (turned, "A is written while another part of it is read; use another array"),
        (
            made_in_a_loop,
            "last would keep an array that the loop makes anew; make both before the loop",
        ),
        (
            seen_later,
            "last would keep an array that the loop makes anew; make both before the loop",
        ),
        (part_kept, "row would keep an array that the loop makes anew; make both before the loop"),
        (unknown_argument, "gained has no argument 'factor'; it has x, gain, offset"),
        (of_unknown_size, "this makes a new array: assign it into one, as in scratch.x[:] = ..."),
        (
            selected,
            "a mask selects elements in y[mask] = ...; for others write a loop, or np.where",
        ),
        (
            rows_by_a_list,
            "A[[0, 2]]: an index is a number; take one row, or element, after the other",
        ),
        (
            taken_apart,
            "2 names take an array of shape (?,); read its elements one after the other",
        ),
        (new_axis, "u[:, None]: None adds a dimension; write np.outer, or a loop"),
        (changing_step, "the step of a[::k] is not a constant"),
    ],
)
def test_what_numpy_would_compute_otherwise_is_refused(function: Any, text: str) -> None:
    with pytest.raises(EquationError) as error:
        expand(function)
    assert text in str(error.value) and f"{__file__}:" in str(error.value)
