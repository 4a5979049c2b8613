"""Equations of kernels: the loops that replace them compute what NumPy or hand-written loops do."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pytest

from aloft.mathematics.arrays import Array, Array0D, Array1D, Array2D, Flags1D, Indices1D
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.expressions import EquationError, cross
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.kernel import expand, kernel
from aloft.mathematics.linear_algebra import multiply_matrices, multiply_vector


class Colour(IntEnum):
    """Something to choose from."""

    RED = 3
    BLUE = 5


class Body(NamedTuple):
    """A record with arrays of known dimensions."""

    R: Array2D
    v: Array1D
    mass: Array0D
    contact: Flags1D
    count: Indices1D


@kernel
def half(x: float) -> float:
    """Half of a number."""
    return x / 2.0


@kernel
def elementwise(a: Array1D, b: Array1D, s: float, out: Array1D) -> None:
    """Sums, products, functions of numbers, and conditions, for each element."""
    out[:] = a + s * b - (1.0 - s) * a / 3.0
    out[:] += half(abs(min(a, b))) if s > 0.0 else math.sin(a)


@kernel
def choices(a: Array1D, contact: Flags1D, out: Array1D) -> None:
    """A condition on each element chooses between numbers, and between elements."""
    out[:] = 1.0 if contact else 0.0
    out[:] += a if a > 0.5 and contact else -a


@kernel
def product(R: Array2D, v: Array1D, x: Array1D, out: Array1D) -> None:
    """Products of a matrix with an expression, on both sides."""
    out[:] = R @ (v - x) + R.T @ x - v @ R


@kernel
def squares(a: Array2D, b: Array2D, out: Array2D) -> None:
    """A product of matrices, a row, a column and the whole."""
    out[:] = a @ b + 2.0 * a.T
    out[0, :] = a[:, 1]
    out[1:3, 0] = -b[0, 1:3]


@kernel
def turn(a: Array1D, b: Array1D, out: Array1D) -> None:
    """The target of a cross product may be an operand."""
    out[:] = a + cross(b, out)


@kernel
def turned_sum(R: Array2D, a: Array1D, b: Array1D, out: Array1D) -> None:
    """A cross product within a product with a matrix, and the other way round."""
    out[:] = R.T @ (a + cross(b, R @ a)) - cross(a, b) @ R


@kernel
def fields(body: Body, kind: int, out: Array1D) -> float:
    """Scalar fields, elements, members of an enumeration, and a dot product."""
    body.mass = 2.0 * body.mass + body.v @ out
    body.mass += 1.0
    row = body.R[1]
    if body.contact[0] and kind == Colour.BLUE:
        out[0] = row[2] + body.count[1]
    return body.mass


def both(function: Callable[..., None], make: Callable[[], tuple[Any, ...]]) -> Any:
    """The last argument after a plain run; a compiled one must give the same bytes."""
    plain = make()
    function(*plain)
    arguments = make()
    call = KernelCall(function, *arguments)
    assert compile_calls([call]) == ""
    call.run()
    for one, other in zip(plain, arguments, strict=True):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
    return plain[-1]


def arrays(*shapes: tuple[int, ...]) -> Callable[[], tuple[Array, ...]]:
    return lambda: tuple(np.random.default_rng(5).normal(size=shape) for shape in shapes)


def test_elementwise_statements_are_numpys() -> None:
    def make() -> tuple[Any, ...]:
        a, b, out = arrays((4,), (4,), (4,))()
        return a, b, 0.3, out

    a, b, s, _ = make()
    expected = a + s * b - (1.0 - s) * a / 3.0
    expected += np.abs(np.minimum(a, b)) / 2.0
    assert both(elementwise, make).tobytes() == expected.tobytes()


def test_a_condition_holds_for_each_element() -> None:
    def make() -> tuple[Any, ...]:
        return np.array([0.2, 0.7, 0.9]), np.array([True, False, True]), np.zeros(3)

    assert both(choices, make).tolist() == [1.0 - 0.2, -0.7, 1.0 + 0.9]


def test_products_sum_from_the_first_to_the_last() -> None:
    make = arrays((3, 3), (3,), (3,), (3,))
    R, v, x, _ = make()
    first, second, third = np.zeros(3), np.zeros(3), np.zeros(3)
    multiply_vector(R, v - x, first)
    multiply_vector(np.ascontiguousarray(R.T), x, second)
    multiply_vector(np.ascontiguousarray(R.T), v, third)
    assert both(product, make).tobytes() == (first + second - third).tobytes()


def test_matrices_rows_and_columns() -> None:
    make = arrays((3, 3), (3, 3), (3, 3))
    a, b, _ = make()
    expected = np.zeros((3, 3))
    multiply_matrices(a, b, expected)
    expected += 2.0 * a.T
    expected[0, :] = a[:, 1]
    expected[1:3, 0] = -b[0, 1:3]
    assert both(squares, make).tobytes() == expected.tobytes()


def test_a_cross_product_may_write_its_operand() -> None:
    make = arrays((3,), (3,), (3,))
    a, b, out = make()
    np.testing.assert_allclose(both(turn, make), a + np.cross(b, out), rtol=1e-14)


def test_a_matrix_may_turn_a_cross_product() -> None:
    make = arrays((3, 3), (3,), (3,), (3,))
    R, a, b, _ = make()
    expected = R.T @ (a + np.cross(b, R @ a)) - np.cross(a, b) @ R
    np.testing.assert_allclose(both(turned_sum, make), expected, rtol=1e-13, atol=1e-13)


def test_scalar_fields_read_and_are_assigned_like_numbers() -> None:
    out = np.array([1.0, 2.0, 3.0])
    body = Body(
        np.arange(9.0).reshape(3, 3), np.ones(3), np.array(1.5), np.array([True]), np.array([0, 7])
    )
    assert fields(body, 5, out) == 3.0 + 6.0 + 1.0 == body.mass[()]
    assert out[0] == 5.0 + 7.0
    assert isinstance(fields(body, 3, out), float)


@kernel
def reads_its_target(R: Array2D, v: Array1D) -> None:
    """NotCompilable: R is applied to what is already overwritten."""
    v[:] = R @ v


@kernel
def reads_another_part(v: Array1D) -> None:
    """NotCompilable: each element is read after it has been written."""
    v[1:3] = v[0:2]


@kernel
def makes_an_array(a: Array1D, out: Array1D) -> None:
    """NotCompilable: a sum of arrays needs room."""
    both_of = a + out
    out[:] = both_of


@kernel
def does_not_fit(a: Array2D, out: Array1D) -> None:
    """NotCompilable: two dimensions in one."""
    out[:] = a


@kernel
def unknown_member(kind: int, out: Array1D) -> None:
    """NotCompilable: no such colour."""
    out[0] = 1.0 if kind == Colour.GREEN else 0.0  # type: ignore[attr-defined]


@kernel
def unknown_field(body: Body, out: Array1D) -> None:
    """NotCompilable: no such field."""
    out[0] = body.speed  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (reads_its_target, "v is written while @ still reads it; use another array"),
        (reads_another_part, "v is written while another part of it is read"),
        (makes_an_array, "this makes a new array: assign it into one, as in scratch.x[:] = ..."),
        (does_not_fit, "a value of 2 dimensions does not fit into 1"),
        (unknown_member, "Colour has no GREEN; it has RED, BLUE"),
        (unknown_field, "Body has no field 'speed'; it has R, v, mass, contact, count"),
    ],
)
def test_what_cannot_be_rewritten_is_refused_with_its_line(
    function: Callable[..., None], text: str
) -> None:
    with pytest.raises(EquationError) as error:
        expand(function)
    assert text in str(error.value)
    assert f"{__file__}:" in str(error.value) and function.__name__ in str(error.value)
