"""``blocks.Constant``: exact values."""

from aloft.blocks.general.constant import Constant
from aloft.runtime.testing import BlockBench


def test_constant_has_as_many_elements_as_its_value() -> None:
    bench = BlockBench(Constant, {"value": [1.0, -2.0]})
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, -2.0]
