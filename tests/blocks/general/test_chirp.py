"""``blocks.Chirp``: its frequency is the derivative of its phase."""

import itertools
import math

import numpy as np
import pytest

from aloft.blocks.general.chirp import Chirp
from aloft.runtime.testing import BlockBench


def run(ticks: int, **params: object) -> np.ndarray:
    bench = BlockBench(Chirp, params, rate=1000.0)
    values = []
    for _ in range(ticks):
        bench.step()
        values.append(bench.get("y").value[0])
    return np.array(values)


@pytest.mark.parametrize(("sweep", "middle"), [("linear", 5.0), ("exponential", 3.0)])
def test_zero_crossings_follow_the_frequency(sweep: str, middle: float) -> None:
    found = run(3000, start_frequency=1.0, end_frequency=9.0, duration=2.0, sweep=sweep)
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
        found = run(
            50, start_frequency=3.0, end_frequency=3.0, sweep=sweep, amplitude=2.0, offset=0.5
        )
        np.testing.assert_allclose(found, expected, atol=1e-12)
