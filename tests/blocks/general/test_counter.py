"""``blocks.Counter``: exact values."""

from aloft.blocks.general.counter import Counter
from aloft.runtime.testing import BlockBench


def test_counter_counts_wraps_and_starts_anew() -> None:
    bench = BlockBench(Counter, {"last": 2})
    found = []
    for u, reset in ((0, 0), (1, 0), (1, 0), (0, 0), (1, 0), (1, 0), (1, 1)):
        bench.set("u", value=bool(u))
        bench.set("reset", value=bool(reset))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [0, 1, 2, 2, 0, 1, 0]
