"""``blocks.Timer``: exact values."""

import pytest

from aloft.blocks.general.timer import Timer
from aloft.runtime.testing import BlockBench


def test_timer_begins_again_after_a_break() -> None:
    bench = BlockBench(Timer, {"duration": "200 ms"}, rate=10.0)
    elapsed, done = [], ""
    for u in (False, True, True, True, True, False, True):
        bench.set("u", value=u)
        bench.step()
        elapsed.append(bench.get("elapsed").value[0])
        done += str(int(bench.get("done").value))
    assert elapsed == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.3, 0.0, 0.0])
    assert done == "0001100"
