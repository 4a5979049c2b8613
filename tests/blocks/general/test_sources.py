"""``blocks.Constant``: exact values."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from aloft.blocks.general.sources import Chirp, Constant, Pulse, Ramp, SineWave, Step
from aloft.runtime.testing import BlockBench


def test_constant_has_as_many_elements_as_its_value() -> None:
    bench = BlockBench(Constant, {"value": [1.0, -2.0]})
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, -2.0]


def test_step_jumps_once() -> None:
    bench = BlockBench(Step, {"n": 2, "at": "2 s", "before": [1.0, 2.0], "after": 5.0}, rate=1.0)
    values = []
    for _ in range(4):
        bench.step()
        values.append(bench.get("y").value.tolist())
    assert values == [[1.0, 2.0], [1.0, 2.0], [5.0, 5.0], [5.0, 5.0]]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 20_000), st.sampled_from([100.0, 333.0, 500.0, 1000.0]))
def test_a_step_on_a_tick_comes_in_that_tick(tick: int, rate: float) -> None:
    bench = BlockBench(Step, {"at": tick / rate}, rate=rate)
    bench.clock.tick = tick
    bench.step()
    assert bench.get("y").value[0] == 1.0
    bench.clock.tick = tick - 1
    bench.step()
    assert bench.get("y").value[0] == 0.0


def test_a_list_must_have_n_elements() -> None:
    with pytest.raises(ValidationError, match="after has 2 elements, expected n = 3"):
        BlockBench(Step, {"n": 3, "after": [1.0, 2.0]})


def run(**params: object) -> list[list[float]]:
    bench = BlockBench(Ramp, params, rate=2.0)
    values = []
    for _ in range(6):
        bench.step()
        values.append(bench.get("y").value.tolist())
    return values


def test_ramp_grows_from_its_start() -> None:
    assert run(start="1 s", slope=2.0, offset=3.0) == [[3], [3], [3], [4], [5], [6]]


def test_ramp_stops_after_its_duration() -> None:
    found = run(n=2, duration="1 s", slope=[2.0, -1.0])
    assert found == [[0, 0], [1, -0.5], [2, -1], [2, -1], [2, -1], [2, -1]]


def pulse_run(ticks: int, rate: float, **params: object) -> list[float]:
    bench = BlockBench(Pulse, params, rate=rate)
    values = []
    for _ in range(ticks):
        bench.step()
        values.append(bench.get("y").value[0])
    return values


def test_pulse_repeats_from_its_start() -> None:
    found = pulse_run(
        10, 10.0, start="0.2 s", duration="0.4 s", width=0.25, amplitude=3.0, offset=1.0
    )
    assert found == [1, 1, 4, 1, 1, 1, 4, 1, 1, 1]


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 9), st.integers(0, 9), st.sampled_from([100.0, 333.0, 1000.0]))
def test_a_pulse_has_as_many_high_ticks_as_its_width_says(
    period: int, high: int, rate: float
) -> None:
    high = min(high, period)
    found = pulse_run(10 * period, rate, duration=period / rate, width=high / period)
    assert found == ([1.0] * high + [0.0] * (period - high)) * 10


@pytest.mark.parametrize("hours", [0, 10, 100])
def test_pulses_keep_their_ticks_for_hours(hours: int) -> None:
    bench = BlockBench(Pulse, {"duration": "1 ms", "width": 0.375}, rate=8000.0)
    found = []
    for tick in range(hours * 3600 * 8000, hours * 3600 * 8000 + 80):
        bench.clock.tick = tick
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0] * 10


def test_sine_wave_follows_time() -> None:
    bench = BlockBench(
        SineWave, {"n": 2, "amplitude": 2.0, "frequency": "50 Hz", "offset": 1.0}, rate=1000.0
    )
    values = []
    for _ in range(20):
        bench.step()
        values.append(bench.get("y").value.copy())
    expected = [1.0 + 2.0 * math.sin(2.0 * math.pi * 50.0 * k / 1000.0) for k in range(20)]
    np.testing.assert_allclose(np.array(values)[:, 1], expected, rtol=0, atol=1e-12)


def chirp_run(ticks: int, **params: object) -> np.ndarray:
    bench = BlockBench(Chirp, params, rate=1000.0)
    values = []
    for _ in range(ticks):
        bench.step()
        values.append(bench.get("y").value[0])
    return np.array(values)


@pytest.mark.parametrize(("sweep", "middle"), [("linear", 5.0), ("exponential", 3.0)])
def test_zero_crossings_follow_the_frequency(sweep: str, middle: float) -> None:
    found = chirp_run(3000, start_frequency=1.0, end_frequency=9.0, duration=2.0, sweep=sweep)
    rising = np.flatnonzero((found[:-1] < 0) & (found[1:] >= 0)) / 1000.0

    def frequency(t: float) -> float:
        t = min(t, 2.0)
        return 1.0 + 4.0 * t if sweep == "linear" else 9.0 ** (t / 2.0)

    assert frequency(1.0) == pytest.approx(middle)
    for one, two in itertools.pairwise(rising):
        assert 1.0 / (two - one) == pytest.approx(frequency(0.5 * (one + two)), rel=0.03)


def test_equal_frequencies_make_a_plain_sine() -> None:
    expected = [0.5 + 2.0 * math.sin(2.0 * math.pi * 3.0 * k / 1000.0) for k in range(50)]
    for sweep in ("linear", "exponential"):
        found = chirp_run(
            50, start_frequency=3.0, end_frequency=3.0, sweep=sweep, amplitude=2.0, offset=0.5
        )
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_sine_of_each_element() -> None:
    given = {
        "n": 3,
        "amplitude": [1.0, 2.0, 3.0],
        "frequency": ["10 Hz", 20.0, 30.0],
        "phase": ["0 deg", "90 deg", 0.0],
    }
    bench = BlockBench(SineWave, {**given, "offset": 0.5}, rate=1000.0)
    bench.clock.tick = 7
    bench.step()
    angle = 2.0 * np.pi * np.array([10.0, 20.0, 30.0]) * 0.007 + [0.0, np.pi / 2.0, 0.0]
    assert bench.get("y").value == pytest.approx(0.5 + np.array([1.0, 2.0, 3.0]) * np.sin(angle))
