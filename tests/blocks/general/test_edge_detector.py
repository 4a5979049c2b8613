"""``blocks.EdgeDetector``: exact values."""

import pytest

from aloft.blocks.general.edge_detector import EdgeDetector
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("edge", "expected"), [("rising", "00100"), ("falling", "01001"), ("either", "01101")]
)
def test_edges(edge: str, expected: str) -> None:
    bench = BlockBench(EdgeDetector, {"edge": edge})
    found = ""
    for u in (True, False, True, True, False):
        bench.set("u", value=u)
        bench.step()
        found += str(int(bench.get("y").value[0]))
    assert found == expected
