"""``blocks.Pulse``: exact values."""

from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.pulse import Pulse
from aloft.runtime.testing import BlockBench


def run(ticks: int, rate: float, **params: object) -> list[float]:
    bench = BlockBench(Pulse, params, rate=rate)
    values = []
    for _ in range(ticks):
        bench.step()
        values.append(bench.get("y").value[0])
    return values


def test_pulse_repeats_from_its_start() -> None:
    found = run(10, 10.0, start="0.2 s", duration="0.4 s", width=0.25, amplitude=3.0, offset=1.0)
    assert found == [1, 1, 4, 1, 1, 1, 4, 1, 1, 1]


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 9), st.integers(0, 9), st.sampled_from([100.0, 333.0, 1000.0]))
def test_a_pulse_has_as_many_high_ticks_as_its_width_says(
    period: int, high: int, rate: float
) -> None:
    high = min(high, period)
    found = run(10 * period, rate, duration=period / rate, width=high / period)
    assert found == ([1.0] * high + [0.0] * (period - high)) * 10
