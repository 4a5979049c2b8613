"""``blocks.ZeroOrderHold``: exact values."""

from aloft.blocks.general.zero_order_hold import ZeroOrderHold
from aloft.runtime.testing import BlockBench


def test_every_third_input_is_held() -> None:
    bench = BlockBench(ZeroOrderHold, {"samples": 3})
    found = []
    for u in range(8):
        bench.set("u", value=float(u))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [0, 0, 0, 3, 3, 3, 6, 6]
