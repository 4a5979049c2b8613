"""``blocks.Compare``: every comparison."""

import pytest

from aloft.blocks.general.compare import Compare
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("operation", "expected"),
    [("<", "100"), ("<=", "110"), ("==", "010"), ("!=", "101"), (">=", "011"), (">", "001")],
)
def test_compare(operation: str, expected: str) -> None:
    bench = BlockBench(Compare, {"n": 3, "operation": operation})
    bench.set("a", value=[1.0, 2.0, 3.0])
    bench.set("b", value=2.0)
    bench.step()
    assert bench.get("y").value.tolist() == [digit == "1" for digit in expected]
