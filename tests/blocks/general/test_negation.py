"""``blocks.Not``: exact values."""

from aloft.blocks.general.negation import Not
from aloft.runtime.testing import BlockBench


def test_not() -> None:
    bench = BlockBench(Not, {"n": 2})
    bench.set("u", value=[True, False])
    bench.step()
    assert bench.get("y").value.tolist() == [False, True]
