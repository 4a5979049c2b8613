"""The latch: closes at once or after some samples, holds, never bounces, point by point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.estimation.contact_detector import ContactDetector
from aloft.runtime.testing import BlockBench

POINTS = {"n_contacts": 4}


def run(pattern, **params):
    """What point 0 is said to be, tick by tick; the others stay open."""
    bench = BlockBench(ContactDetector, params, dimensions=POINTS, rate=500.0)
    result = []
    for closed in pattern:
        bench.set("switches", closed=[bool(closed), False, False, False])
        bench.step()
        assert not bench.get("state").active[1:].any()
        result.append(bool(bench.get("state").active[0]))
    return result


def test_closes_in_the_same_tick():
    assert run([0, 0, 1, 1]) == [False, False, True, True]


def test_closes_after_so_many_samples_in_a_row():
    assert run([1, 1, 0, 1, 1, 1], close_samples=3) == [False] * 5 + [True]


def test_holds_for_thirty_milliseconds_and_no_longer():
    assert run([1] + [0] * 20) == [True] * 16 + [False] * 5


def test_hold_is_a_time_not_a_number_of_ticks():
    bench = BlockBench(ContactDetector, {"hold": "10 ms"}, dimensions=POINTS, rate=1000.0)
    bench.set("switches", closed=True)
    bench.step()
    bench.set("switches", closed=False)
    bench.step(10)
    assert bench.get("state").active.all()
    bench.step()
    assert not bench.get("state").active.any()


def test_no_hold_follows_the_switch():
    assert run([1, 0, 1, 0], hold=0.0) == [True, False, True, False]


@given(st.lists(st.booleans(), min_size=20, max_size=60))
def test_bouncing_within_the_hold_is_not_seen(bounces):
    """Any bouncing with gaps of at most 15 ticks after the first touch is one contact."""
    gaps = [len(gap) for gap in "".join("x" if b else "." for b in bounces).split("x")]
    if max(gaps) <= 15:
        assert all(run([True, *bounces]))
    else:
        assert not all(run([True, *bounces]))


@pytest.mark.parametrize("point", range(4))
def test_points_are_independent(point):
    bench = BlockBench(ContactDetector, dimensions=POINTS)
    closed = np.arange(4) == point
    bench.set("switches", closed=closed)
    bench.step()
    assert bench.get("state").active.tolist() == closed.tolist()


def test_restores_in_the_middle_of_a_hold():
    bench = BlockBench(ContactDetector, dimensions=POINTS)
    bench.set("switches", closed=True)
    bench.step()
    bench.set("switches", closed=False)
    bench.step(10)
    half = bench.snapshot()
    bench.step(6)
    assert not bench.get("state").active.any()
    bench.restore(half)
    bench.step(5)
    assert bench.get("state").active.all()


def test_a_switch_at_fault_counts_as_open():
    bench = BlockBench(ContactDetector, dimensions=POINTS, rate=500.0)
    bench.set("switches", closed=[True] * 4)
    bench.set("faults", fault=[0, 1, 0, 3])
    bench.step()
    assert bench.get("state").active.tolist() == [True, False, True, False]
    bench.set("faults", fault=[1, 1, 0, 3])
    bench.step(15)
    assert bench.get("state").active.tolist() == [True, False, True, False], "it is held a while"
    bench.step()
    assert bench.get("state").active.tolist() == [False, False, True, False]
