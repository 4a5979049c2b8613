"""``blocks.ColouredNoise``: deviation and autocorrelation."""

import math

import numpy as np
import pytest

from aloft.blocks.general.coloured_noise import ColouredNoise
from aloft.runtime.testing import BlockBench


def test_deviation_and_autocorrelation() -> None:
    params = {"n": 200, "std": 2.0, "correlation_time": "50 ms", "seed": 1}
    bench = BlockBench(ColouredNoise, params, rate=100.0)
    found = np.zeros((100, 200))
    for row in found:
        bench.step()
        row[:] = bench.get("y").value
    assert found[0].std() == pytest.approx(2.0, rel=0.12)
    assert found.std() == pytest.approx(2.0, rel=0.05)
    lag = 5
    correlation = np.mean(found[:-lag] * found[lag:]) / np.mean(found**2)
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.06)
