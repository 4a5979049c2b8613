"""``blocks.Switch``: exact values."""

from aloft.blocks.general.switch import Switch
from aloft.runtime.testing import BlockBench


def test_switch() -> None:
    bench = BlockBench(Switch, {"n": 2})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[3.0, 4.0])
    for condition, expected in ((True, [1.0, 2.0]), (False, [3.0, 4.0])):
        bench.set("condition", value=condition)
        bench.step()
        assert bench.get("y").value.tolist() == expected
