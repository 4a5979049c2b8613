"""``blocks.RateLimiter``: exact values, and a law."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.rate_limiter import RateLimiter
from aloft.runtime.testing import BlockBench


def run(inputs: list[float], rising: float, falling: float, rate: float) -> list[float]:
    bench = BlockBench(RateLimiter, {"rising": rising, "falling": falling}, rate=rate)
    values = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        values.append(float(bench.get("y").value[0]))
    return values


def test_rate_limiter_starts_at_the_input_and_follows_it() -> None:
    assert run([3, 10, 10, 10, -10, 2.5], 4.0, 8.0, 2.0) == [3, 5, 7, 9, 5, 2.5]


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-100, 100), min_size=2, max_size=20))
def test_no_step_is_greater_than_allowed(inputs: list[float]) -> None:
    steps = np.diff(run(inputs, 50.0, 20.0, 10.0))
    assert np.all(steps <= 5.0 + 1e-9)
    assert np.all(steps >= -2.0 - 1e-9)
