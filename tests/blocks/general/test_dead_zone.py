"""``blocks.DeadZone``: exact values."""

from aloft.blocks.general.dead_zone import DeadZone
from aloft.runtime.testing import BlockBench


def test_dead_zone_takes_off_the_zone() -> None:
    bench = BlockBench(DeadZone, {"n": 4, "lower": -1.0, "upper": 0.5})
    bench.set("u", value=[-3.0, -0.5, 0.5, 2.0])
    bench.step()
    assert bench.get("y").value.tolist() == [-2.0, 0.0, 0.0, 1.5]
