"""``blocks.Demux``: exact values."""

from aloft.blocks.general.demux import Demux
from aloft.runtime.testing import BlockBench


def test_demux() -> None:
    bench = BlockBench(Demux, {"n_a": 1, "n_b": 2})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("a").value.tolist() == [1.0]
    assert bench.get("b").value.tolist() == [2.0, 3.0]
