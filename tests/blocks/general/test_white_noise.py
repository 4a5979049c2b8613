"""``blocks.WhiteNoise``: mean, deviation, independence."""

import numpy as np
import pytest

from aloft.blocks.general.white_noise import WhiteNoise
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
