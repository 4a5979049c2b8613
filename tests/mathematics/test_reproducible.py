"""Products and inverses without BLAS: NumPy's values, in a fixed order of operations."""

import numpy as np
import pytest

from aloft.mathematics.linear import multiply_matrices
from aloft.mathematics.reproducible import inverse, product

RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("a", "b"),
    [((3, 3), (3,)), ((3,), (3, 4)), ((5,), (5,)), ((2, 3), (3, 4)), ((7, 3, 3), (3,)),
     ((7, 3, 3), (7, 3, 3)), ((7, 2, 3), (7, 3, 1)), ((3, 3), (7, 3, 2))],
)  # fmt: skip
def test_products_are_numpys(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    left, right = RNG.normal(size=a), RNG.normal(size=b)
    found = product(left, right)
    assert found.shape == (left @ right).shape
    np.testing.assert_allclose(found, left @ right, rtol=1e-13, atol=1e-14)


def test_a_product_rounds_after_every_operation_in_the_order_of_the_elements() -> None:
    a, b = RNG.normal(size=(4, 6)), RNG.normal(size=(6, 5))
    expected = np.empty((4, 5))
    multiply_matrices(a, b, expected)
    np.testing.assert_array_equal(product(a, b), expected)


def test_the_inverse_is_numpys() -> None:
    for n in (1, 2, 5, 20):
        matrix = RNG.normal(size=(n, n))
        np.testing.assert_allclose(inverse(matrix), np.linalg.inv(matrix), rtol=1e-9, atol=1e-11)


def test_the_inverse_exchanges_rows_where_a_pivot_is_zero() -> None:
    matrix = np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -4.0]])
    before = matrix.copy()
    expected = [[0.0, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -0.25]]
    np.testing.assert_array_equal(inverse(matrix), expected)
    np.testing.assert_array_equal(matrix, before)


def test_a_singular_matrix_has_no_inverse() -> None:
    with pytest.raises(ValueError, match="the matrix is singular, so it has no inverse"):
        inverse(np.array([[1.0, 2.0], [2.0, 4.0]]))
