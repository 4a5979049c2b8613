"""``blocks.WhiteNoise``: mean, deviation, independence."""

import math

import numpy as np
import pytest

from aloft.blocks.general.noise import ColouredNoise, WhiteNoise
from aloft.runtime.testing import BlockBench


def test_mean_deviation_and_independence() -> None:
    bench = BlockBench(WhiteNoise, {"n": 2, "std": [1.0, 3.0], "mean": [0.0, 5.0], "seed": 4})
    found = np.zeros((4000, 2))
    for row in found:
        bench.step()
        row[:] = bench.get("y").value
    assert found.mean(axis=0) == pytest.approx([0.0, 5.0], abs=0.15)
    assert found.std(axis=0) == pytest.approx([1.0, 3.0], rel=0.05)
    assert abs(np.corrcoef(found[:-1, 0], found[1:, 0])[0, 1]) < 0.05
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.05


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
