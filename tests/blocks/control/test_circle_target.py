"""The circling target: where it begins, and that its rates are derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.circle_target import CircleTarget
from aloft.runtime.testing import BlockBench

CENTRE = [0.3, -0.2, 0.8]


def points(rate=10_000.0, ticks=20_000, **params):
    bench = BlockBench(CircleTarget, {"centre": CENTRE, "start": 0.2, **params}, rate=rate)
    target, rows = bench.get("target"), []
    for _ in range(ticks):
        bench.step()
        rows.append(np.concatenate((target.position, target.velocity, target.acceleration)))
    return np.array(rows)


@pytest.mark.parametrize(("axis", "across"), [("x", 0), ("y", 1), ("z", 2)])
def test_it_rests_and_then_circles_across_its_axis(axis, across):
    rows = points(axis=axis, radius=0.06, turn_time=0.7)
    assert (rows[:2000] == [*CENTRE, 0, 0, 0, 0, 0, 0]).all()
    apart = rows[:, :3] - CENTRE
    assert (apart[:, across] == 0.0).all()
    assert np.linalg.norm(apart[12_100:], axis=1) == pytest.approx(0.06)
    first, second = np.delete(np.roll(np.arange(3), -across), 0)
    assert apart[15_900, first] * 0.06 != 0.0
    turning = np.cross(apart[13_000], apart[13_100])[across]
    assert turning > 0.0 and {first, second, across} == {0, 1, 2}


def test_velocity_and_acceleration_are_derivatives():
    rows = points()
    for first in (0, 3):
        change = (rows[2:, first : first + 3] - rows[:-2, first : first + 3]) * 5_000.0
        assert change == pytest.approx(rows[1:-1, first + 3 : first + 6], abs=2e-3)
