"""``blocks.Quantiser``: exact values."""

from aloft.blocks.general.quantiser import Quantiser
from aloft.runtime.testing import BlockBench


def test_quantiser_rounds_to_whole_steps() -> None:
    bench = BlockBench(Quantiser, {"n": 5, "interval": 0.5})
    bench.set("u", value=[0.2, 0.3, -0.8, 0.25, 0.75])
    bench.step()
    assert bench.get("y").value.tolist() == [0.0, 0.5, -1.0, 0.0, 1.0]
