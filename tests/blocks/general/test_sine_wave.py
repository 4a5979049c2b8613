"""``blocks.SineWave``: exact values."""

import math

import numpy as np

from aloft.blocks.general.sine_wave import SineWave
from aloft.runtime.testing import BlockBench


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
