"""``blocks.Mux``: exact values."""

from aloft.blocks.general.mux import Mux
from aloft.runtime.testing import BlockBench


def test_mux() -> None:
    bench = BlockBench(Mux, {"n_a": 2, "n_b": 1})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, 2.0, 3.0]
