"""``blocks.Saturation``: exact values, and a law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.nonlinear import (
    Backlash,
    DeadZone,
    Quantiser,
    RateLimiter,
    Relay,
    Saturation,
)
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

FLOATS = st.floats(-1e6, 1e6)


def saturate(u: list[float], **bounds: object) -> list[float]:
    bench = BlockBench(Saturation, {"n": len(u), **bounds})
    bench.set("u", value=u)
    bench.step()
    return list(bench.get("y").value)


def test_each_element_has_its_bounds() -> None:
    assert saturate([-5.0, 5.0, 0.5], lower=[-1.0, 0.0, 0.0], upper=1.0) == [-1.0, 1.0, 0.5]
    assert saturate([-5.0, 5.0], lower=0.0) == [0.0, 5.0]


@settings(max_examples=20, deadline=None)
@given(st.lists(FLOATS, min_size=1, max_size=4), FLOATS, FLOATS)
def test_saturating_twice_is_saturating_once(u: list[float], a: float, b: float) -> None:
    bounds = {"lower": min(a, b), "upper": max(a, b)}
    once = saturate(u, **bounds)
    assert saturate(once, **bounds) == once
    assert all(bounds["lower"] <= y <= bounds["upper"] for y in once)


def test_bounds_must_not_cross() -> None:
    with pytest.raises(BlockError, match="lower bound of element 1 is above the upper one"):
        BlockBench(Saturation, {"n": 2, "lower": [0.0, 2.0], "upper": 1.0})


def test_dead_zone_takes_off_the_zone() -> None:
    bench = BlockBench(DeadZone, {"n": 4, "lower": -1.0, "upper": 0.5})
    bench.set("u", value=[-3.0, -0.5, 0.5, 2.0])
    bench.step()
    assert bench.get("y").value.tolist() == [-2.0, 0.0, 0.0, 1.5]


def test_the_driven_part_follows_with_play() -> None:
    bench = BlockBench(Backlash, {"width": 2.0})
    values = []
    for u in (0.5, 3.0, 1.5, 1.0, 0.0):
        bench.set("u", value=u)
        bench.step()
        values.append(bench.get("y").value[0])
    assert values == [0.0, 2.0, 2.0, 2.0, 1.0]


def test_quantiser_rounds_to_whole_steps() -> None:
    bench = BlockBench(Quantiser, {"n": 5, "interval": 0.5})
    bench.set("u", value=[0.2, 0.3, -0.8, 0.25, 0.75])
    bench.step()
    assert bench.get("y").value.tolist() == [0.0, 0.5, -1.0, 0.0, 1.0]


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


def test_relay_keeps_its_state_between_the_thresholds() -> None:
    bench = BlockBench(
        Relay, {"switch_on": 1.0, "switch_off": 0.0, "on_value": 5.0, "off_value": -5.0}
    )
    values = []
    for u in (0.5, 1.0, 0.5, 0.0, 0.5, 2.0):
        bench.set("u", value=u)
        bench.step()
        assert bool(bench.get("on").value[0]) == (bench.get("y").value[0] > 0)
        values.append(bench.get("y").value[0])
    assert values == [-5, 5, 5, -5, -5, 5]


def test_thresholds_must_not_cross() -> None:
    with pytest.raises(BlockError, match="switch_off is above switch_on"):
        BlockBench(Relay, {"switch_on": 0.0, "switch_off": 1.0})
