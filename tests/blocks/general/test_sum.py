"""``blocks.Sum``: exact values."""

from aloft.blocks.general.sum import Sum
from aloft.runtime.testing import BlockBench


def test_sum_subtracts_with_a_negative_weight() -> None:
    bench = BlockBench(Sum, {"n": 2, "weights": [2.0, -1.0]})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[0.5, 5.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.5, -1.0]
