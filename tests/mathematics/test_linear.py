"""Products in plain loops are those of NumPy."""

import numpy as np

from aloft.mathematics.linear import add_product, multiply_matrices, multiply_vector


def test_products_are_numpys() -> None:
    rng = np.random.default_rng(0)
    a, b, x = rng.normal(size=(3, 4)), rng.normal(size=(4, 2)), rng.normal(size=4)
    out = np.ones(3)
    add_product(a, x, out)
    np.testing.assert_allclose(out, 1.0 + a @ x, rtol=1e-14)
    multiply_vector(a, x, out)
    np.testing.assert_allclose(out, a @ x, rtol=1e-14)
    product = np.empty((3, 2))
    multiply_matrices(a, b, product)
    np.testing.assert_allclose(product, a @ b, rtol=1e-14)
