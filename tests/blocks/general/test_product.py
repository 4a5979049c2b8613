"""``blocks.Product``: exact values."""

import pytest

from aloft.blocks.general.product import Product
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("operation", "expected"), [("multiply", [6.0, -2.0]), ("divide", [1.5, -0.5])]
)
def test_product(operation: str, expected: list[float]) -> None:
    bench = BlockBench(Product, {"n": 2, "operation": operation})
    bench.set("a", value=[3.0, 1.0])
    bench.set("b", value=[2.0, -2.0])
    bench.step()
    assert bench.get("y").value.tolist() == expected
