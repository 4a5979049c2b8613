"""``StartFrame`` gives the base relative to where a jump begins."""

import math

import numpy as np
import pytest

from aloft.extensions.hopping.blocks.start_frame import StartFrame
from aloft.mathematics.rotations import yaw
from aloft.runtime.testing import BlockBench


def test_place_velocity_and_heading_turn_with_the_frame() -> None:
    bench = BlockBench(StartFrame)
    half = 0.5 * math.radians(120.0)
    bench.set(
        "state",
        position=[1.0, 3.0, 0.4],
        orientation=[0.0, 0.0, math.sin(half), math.cos(half)],
        linear_velocity=[0.0, 2.0, 0.1],
        angular_velocity=[0.1, 0.2, 0.3],
    )
    bench.set("frame", origin=[1.0, 1.0, 0.1], heading=math.radians(90.0))
    bench.step()
    base = bench.get("base")
    assert base.position == pytest.approx([2.0, 0.0, 0.3])
    assert base.linear_velocity == pytest.approx([2.0, 0.0, 0.1])
    assert yaw(np.array(base.orientation)) == pytest.approx(math.radians(30.0))
    assert base.angular_velocity == pytest.approx([0.1, 0.2, 0.3])
