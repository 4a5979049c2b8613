"""``TwistSchedule`` gives each velocity from its time on."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from aloft.extensions.hopping.blocks.twist_schedule import TwistSchedule
from aloft.runtime.testing import BlockBench


def test_each_velocity_holds_from_its_time_on() -> None:
    twists = [{"at": 0.004, "ahead": 0.2}, {"at": 0.008, "aside": -0.1, "turn": 0.3}]
    bench = BlockBench(TwistSchedule, {"twists": twists})
    found = []
    for _ in range(6):
        bench.step()
        twist = bench.get("twist")
        found.append([*np.array(twist.linear)[:2], float(np.array(twist.angular)[2])])
    assert found[:2] == [[0.0, 0.0, 0.0]] * 2
    assert found[2:4] == [[0.2, 0.0, 0.0]] * 2
    assert found[4:] == [[0.0, -0.1, 0.3]] * 2


def test_times_must_rise() -> None:
    with pytest.raises(ValidationError, match="rising times"):
        BlockBench(TwistSchedule, {"twists": [{"at": 1.0}, {"at": 1.0}]})
