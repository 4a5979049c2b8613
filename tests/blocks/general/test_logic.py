"""``blocks.Logic``: the truth tables."""

import pytest

from aloft.blocks.general.logic import Logic
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("operation", "expected"),
    [("and", "0001"), ("or", "0111"), ("xor", "0110"), ("nand", "1110"), ("nor", "1000")],
)
def test_logic(operation: str, expected: str) -> None:
    bench = BlockBench(Logic, {"n": 4, "operation": operation})
    bench.set("a", value=[False, False, True, True])
    bench.set("b", value=[False, True, False, True])
    bench.step()
    assert bench.get("y").value.tolist() == [digit == "1" for digit in expected]
