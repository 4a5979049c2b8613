"""``blocks.Backlash``: exact values."""

from aloft.blocks.general.backlash import Backlash
from aloft.runtime.testing import BlockBench


def test_the_driven_part_follows_with_play() -> None:
    bench = BlockBench(Backlash, {"width": 2.0})
    values = []
    for u in (0.5, 3.0, 1.5, 1.0, 0.0):
        bench.set("u", value=u)
        bench.step()
        values.append(bench.get("y").value[0])
    assert values == [0.0, 2.0, 2.0, 2.0, 1.0]
