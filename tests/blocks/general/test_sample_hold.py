"""``blocks.SampleHold``: exact values."""

from aloft.blocks.general.sample_hold import SampleHold
from aloft.runtime.testing import BlockBench


def test_it_holds_what_it_sampled() -> None:
    bench = BlockBench(SampleHold, {"initial": -1.0})
    found = []
    for u, trigger in ((1.0, False), (2.0, True), (3.0, False), (4.0, True)):
        bench.set("u", value=u)
        bench.set("trigger", value=trigger)
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [-1, 2, 2, 4]
