"""``blocks.Gain``: exact values."""

from aloft.blocks.general.gain import Gain
from aloft.runtime.testing import BlockBench


def test_gain_multiplies() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": -3.0})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [-3.0, -1.5]
