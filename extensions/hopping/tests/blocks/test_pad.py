"""``Pad`` has the velocity of its page as long as the page is heard."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.extensions.hopping.blocks.pad import Pad
from aloft.runtime.testing import BlockBench


def test_a_velocity_holds_for_a_time_and_needs_a_page() -> None:
    bench = BlockBench(Pad, {"ahead": 0.1, "turn": 0.2, "hold_time": 0.05}, rate=100.0)
    bench.step()
    assert not np.asarray(bench.get("twist").linear).any(), "no page has held it yet"
    bench = BlockBench(Pad, {"ahead": 0.1, "turn": 0.2, "beat": 7, "hold_time": 0.05}, rate=100.0)
    seen = []
    for _ in range(8):
        bench.step()
        twist = bench.get("twist")
        seen.append((float(twist.linear[0]), float(twist.angular[2])))
    assert seen[:5] == [pytest.approx((0.1, 0.2))] * 5
    assert seen[6:] == [(0.0, 0.0)] * 2, "the page is no longer heard"
