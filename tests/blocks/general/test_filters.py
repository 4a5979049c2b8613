"""``blocks.LowPass``: its start, its response, its error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.filters import (
    BandStop,
    FilteredDerivative,
    HighPass,
    LowPass,
    MovingAverage,
)
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize("order", [1, 2])
def test_a_sine_at_the_cutoff_is_damped_by_the_root_of_two(order: int) -> None:
    bench = BlockBench(LowPass, {"cutoff": "10 Hz", "order": order}, rate=1000.0)
    found = []
    for k in range(1000):
        bench.set("u", value=math.sin(2 * math.pi * 10.0 * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert np.max(found[800:]) == pytest.approx(math.sqrt(0.5), abs=1e-3)


def test_it_begins_settled() -> None:
    bench = BlockBench(LowPass, {"cutoff": 10.0, "order": 2, "n": 2})
    bench.set("u", value=[3.0, -1.0])
    bench.step(5)
    np.testing.assert_allclose(bench.get("y").value, [3.0, -1.0], rtol=1e-12)


def test_the_cutoff_must_be_below_half_of_the_rate() -> None:
    with pytest.raises(BlockError, match="cutoff is not below half of the block's rate"):
        BlockBench(LowPass, {"cutoff": 250.0}, rate=500.0)


@pytest.mark.parametrize("order", [1, 2])
def test_a_constant_does_not_pass_and_the_cutoff_is_damped(order: int) -> None:
    bench = BlockBench(HighPass, {"cutoff": "10 Hz", "order": order}, rate=1000.0)
    found = []
    for k in range(1000):
        bench.set("u", value=5.0 + math.sin(2 * math.pi * 10.0 * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert np.max(found[800:]) == pytest.approx(math.sqrt(0.5), abs=1e-3)
    assert np.min(found[800:]) == pytest.approx(-math.sqrt(0.5), abs=1e-3)


@pytest.mark.parametrize(("frequency", "left"), [(10.0, 0.0), (100.0, 1.0)])
def test_only_the_centre_is_taken_out(frequency: float, left: float) -> None:
    bench = BlockBench(BandStop, {"centre": "10 Hz", "width": "2 Hz"}, rate=1000.0)
    found = []
    for k in range(3000):
        bench.set("u", value=2.0 + math.sin(2 * math.pi * frequency * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found[0] == pytest.approx(2.0)
    assert math.sqrt(2.0) * np.std(found[2500:]) == pytest.approx(left, abs=2e-3)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=12), st.integers(1, 6))
def test_it_is_the_mean_of_the_last_inputs(inputs: list[float], samples: int) -> None:
    bench = BlockBench(MovingAverage, {"samples": samples})
    for k, u in enumerate(inputs):
        bench.set("u", value=u)
        bench.step()
        expected = np.mean(inputs[max(0, k + 1 - samples) : k + 1])
        np.testing.assert_allclose(bench.get("y").value[0], expected, atol=1e-10)


def run(inputs: list[float], **params: object) -> list[float]:
    bench = BlockBench(FilteredDerivative, params, rate=10.0)
    values = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        values.append(bench.get("y").value[0])
    return values


def test_without_smoothing_it_is_the_difference() -> None:
    assert run([5.0, 6.0, 4.0], time_constant=0.0) == pytest.approx([0.0, 10.0, -20.0])


def test_on_a_ramp_it_tends_to_the_slope() -> None:
    found = run([0.1 * 3.0 * k for k in range(60)], time_constant="0.3 s")
    assert found[0] == 0.0
    assert found == sorted(found)
    assert found[-1] == pytest.approx(3.0, rel=1e-5)
